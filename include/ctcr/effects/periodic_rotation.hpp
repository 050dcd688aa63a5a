#pragma once
#include "ctcr/effects/periodic_error.hpp"

namespace ctcr {
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
inline constexpr auto parameters = periodic_error({.name = {},
                                                   .unit = "rad",
                                                   .sigma = 0.0087,
                                                   .soft_low = -0.03,
                                                   .soft_high = 0.03,
                                                   .hard_low = -0.3,
                                                   .hard_high = 0.3},
                                                  {.name = {},
                                                   .unit = "rad",
                                                   .sigma = 0.002,
                                                   .soft_low = -0.02,
                                                   .soft_high = 0.02,
                                                   .hard_low = -0.3,
                                                   .hard_high = 0.3},
                                                  {.name = "turns",
                                                   .unit = "",
                                                   .neutral = 1,
                                                   .sigma = 0.5,
                                                   .soft_low = 0.01,
                                                   .soft_high = 100,
                                                   .hard_low = 0.001,
                                                   .hard_high = 1000,
                                                   .role = Role::shape,
                                                   .meaning = "periods per turn of the tube"});
}  // namespace periodic_rotation

/// Error of rotation once per turn of the motor.
template <int N, class P = double>
struct PeriodicRotation : EffectValues<periodic_rotation::parameters, N, P> {
  static constexpr const EffectInfo& info = periodic_rotation::info;

  void actuate(const Occasion&, std::array<P, N>&, std::array<P, N>& alpha) const noexcept {
    for (int i = 0; i < N; ++i) {
      P& x = alpha[std::size_t(i)];
      x = x + error_at(this->template get<2>() * x, *this, i);
    }
  }
};

}  // namespace ctcr
