#pragma once
// Errors of the drives that return with every turn of a gear or of a lead screw.
#include <numbers>

#include "ctcr/effects/hooks.hpp"

namespace ctcr {
namespace detail {

/// Amplitudes of the error, how often it returns, then amplitudes of the second harmonic.
/// @param once, twice  unit, deviation and bounds of the amplitudes of the first and of the second harmonic
/// @param period       how often the error returns
constexpr std::array<EffectParameter, 5> periodic_error(EffectParameter once, EffectParameter twice,
                                                        const EffectParameter& period) noexcept {
  once.per_tube = twice.per_tube = true;
  twice.role = Role::detail;
  return {once.named("cosine", "where the joint stands at 0"), once.named("sine", "a quarter of the period on"), period,
          twice.named("cosine_twice", "of the second harmonic"), twice.named("sine_twice", "of the second harmonic")};
}

/// The error of a tube's joint at a phase [rad] of its period. @param effect  with these parameters
template <class P, class Effect>
[[nodiscard]] P error_at(const P& phase, const Effect& effect, int tube) noexcept {
  P s, c;
  sincos(phase, s, c);
  const P &cosine = effect.template get<3>(tube), &sine = effect.template get<4>(tube);
  P error = effect.template get<0>(tube) * c + effect.template get<1>(tube) * s;
  if (!vanishes(cosine) || !vanishes(sine)) error = error + cosine * (c * c - s * s) + sine * (2.0 * (s * c));
  return error;
}

}  // namespace detail

namespace periodic_rotation {
inline constexpr EffectInfo info{
    .id = "periodic_rotation",
    .title = "Rotation error once per turn",
    .physics =
        "An eccentric gear, coupling or encoder turns the tube a little too far and then not far enough, once per "
        "turn.",
    .signature = "The error is periodic in the angle of a motor.",
    .measure = "Drive all tubes together through two turns.",
    .look_alikes = "anisotropy",
    .reference = "gear metrology, general practice",
};
inline constexpr auto parameters =
    detail::periodic_error({.name = {}, .unit = "rad", .sigma = 0.0087, .soft = {-0.03, 0.03}, .hard = {-0.3, 0.3}},
                           {.name = {}, .unit = "rad", .sigma = 0.002, .soft = {-0.02, 0.02}, .hard = {-0.3, 0.3}},
                           {.name = "turns",
                            .neutral = 1,
                            .sigma = 0.5,
                            .soft = {0.01, 100},
                            .hard = {0.001, 1000},
                            .role = Role::shape,
                            .quantity = Quantity::gear_ratio,
                            .meaning = "periods per turn of the tube"});
}  // namespace periodic_rotation

namespace periodic_translation {
inline constexpr EffectInfo info{
    .id = "periodic_translation",
    .title = "Translation error once per screw turn",
    .physics = "A lead screw that wobbles moves the tube too far and then not far enough, once per turn.",
    .signature = "The error along the tube is periodic in the insertion, with the pitch of the screw.",
    .measure = "Insert in steps that are no divisor of the pitch.",
    .look_alikes = "backlash_translation",
    .reference = "lead screw metrology, general practice",
};
inline constexpr auto parameters = detail::periodic_error(
    {.name = {}, .unit = "m", .sigma = 3e-05, .soft = {-0.0001, 0.0001}, .hard = {-0.002, 0.002}},
    {.name = {}, .unit = "m", .sigma = 8e-06, .soft = {-0.0001, 0.0001}, .hard = {-0.002, 0.002}},
    {.name = "pitch",
     .unit = "m",
     .neutral = 0.002,
     .sigma = 0.0001,
     .soft = {0.0002, 0.02},
     .hard = {1e-05, 0.1},
     .role = Role::shape,
     .quantity = Quantity::screw_pitch,
     .meaning = "translation per turn of the screw"});
}  // namespace periodic_translation

/// Error of alpha, periodic in alpha itself, in `turns` periods per turn of the tube.
template <int N, class P = double>
struct PeriodicRotation : EffectValues<periodic_rotation::parameters, N, P> {
  static constexpr const EffectInfo& info = periodic_rotation::info;

  void actuate(const Occasion&, std::array<P, N>&, std::array<P, N>& alpha) const noexcept {
    for (int i = 0; i < N; ++i) {
      P& x = alpha[std::size_t(i)];
      x = x + detail::error_at(this->template get<2>() * x, *this, i);
    }
  }
};

/// Error of beta, once per turn of the lead screw.
template <int N, class P = double>
struct PeriodicTranslation : EffectValues<periodic_translation::parameters, N, P> {
  static constexpr const EffectInfo& info = periodic_translation::info;

  void actuate(const Occasion&, std::array<P, N>& beta, std::array<P, N>&) const noexcept {
    const P rate = 2 * std::numbers::pi * inverse(this->template get<2>());
    for (int i = 0; i < N; ++i) {
      P& x = beta[std::size_t(i)];
      x = x + detail::error_at(rate * x, *this, i);
    }
  }
};

}  // namespace ctcr
