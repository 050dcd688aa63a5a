#pragma once
// What effects of clearance share: a bundle that leans towards the moment that it carries, by a limited angle.
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/functions.hpp"

namespace ctcr {

/// How soon the whole angle is reached.
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

/// Kinks a station by `tilt` [rad] towards its moment; `moment` [N m] as above.
template <class P, int N>
void lean(Station<P, N>& s, const P& tilt, const P& moment) noexcept {
  const std::array<P, 2> direction = saturated(s.moment, moment);
  for (std::size_t i = 0; i < 2; ++i) s.kink[i] = s.kink[i] + tilt * direction[i];
}

}  // namespace ctcr
