#pragma once
// What effects of clearance and of a soft plate share: a bundle that tilts with the moment that it carries.
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/functions.hpp"

namespace ctcr {

/// How soon the whole angle of a clearance is reached.
inline constexpr EffectParameter leaning_moment{.name = "moment",
                                                .unit = "N m",
                                                .neutral = 0.01,
                                                .sigma = 0.005,
                                                .soft_low = 0.002,
                                                .soft_high = 0.05,
                                                .hard_low = 0.0005,
                                                .hard_high = 0.5,
                                                .role = Role::shape,
                                                .meaning = "at which 76 % of the tilt is reached"};

/// What gives way where tubes lie against one another or against the bore.
inline constexpr EffectParameter leaning_compliance{.name = "contact_compliance",
                                                    .unit = "rad/(N m)",
                                                    .neutral = 0,
                                                    .sigma = 0.02,
                                                    .soft_low = 0,
                                                    .soft_high = 0.2,
                                                    .hard_low = -1,
                                                    .hard_high = 5,
                                                    .role = Role::detail,
                                                    .meaning = "of the contact, added to the tilt"};

/// Where the bundle turns in the front plate.
inline constexpr EffectParameter pivot_depth{.name = "pivot",
                                             .unit = "m",
                                             .neutral = 0,
                                             .sigma = 0.01,
                                             .soft_low = -0.005,
                                             .soft_high = 0.04,
                                             .hard_low = -0.1,
                                             .hard_high = 0.2,
                                             .role = Role::shape,
                                             .meaning = "depth behind the front of the plate about which it tilts"};

/// Tilt [rad] at a moment [N m]: `tilt` towards it, from `size` on, and `compliance` times it.
template <class P>
[[nodiscard]] std::array<P, 2> lean(const std::array<P, 2>& moment, const P& tilt, const P& size,
                                    const P& compliance) noexcept {
  const std::array<P, 2> direction = saturated(moment, size);
  return {tilt * direction[0] + compliance * moment[0], tilt * direction[1] + compliance * moment[1]};
}

/// The moment about a pivot so deep behind a station [N m].
template <class P, int N>
[[nodiscard]] std::array<P, 2> moment_about(const Station<P, N>& s, const P& depth) noexcept {
  return {s.moment[0] - depth * s.force[1], s.moment[1] + depth * s.force[0]};
}

/// Kinks a station by `turn` [rad].
template <class P, int N>
void kink(Station<P, N>& s, const std::array<P, 2>& turn) noexcept {
  for (std::size_t i = 0; i < 2; ++i) s.kink[i] = s.kink[i] + turn[i];
}

/// The same about a pivot so deep behind it [m].
template <class P, int N>
void kink_about(Station<P, N>& s, const std::array<P, 2>& turn, const P& depth) noexcept {
  kink(s, turn);
  s.shift[0] = s.shift[0] + depth * turn[1];
  s.shift[1] = s.shift[1] - depth * turn[0];
}

}  // namespace ctcr
