#pragma once
#include "ctcr/effects/hooks.hpp"

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
inline constexpr std::array parameters{
    EffectParameter{.name = "cosine",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.0087,
                    .soft_low = -0.03,
                    .soft_high = 0.03,
                    .hard_low = -0.3,
                    .hard_high = 0.3,
                    .per_tube = true,
                    .meaning = "at motor angle 0"},
    EffectParameter{.name = "sine",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.0087,
                    .soft_low = -0.03,
                    .soft_high = 0.03,
                    .hard_low = -0.3,
                    .hard_high = 0.3,
                    .per_tube = true,
                    .meaning = "at a quarter turn"},
    EffectParameter{.name = "turns",
                    .unit = "",
                    .neutral = 1,
                    .sigma = 0.5,
                    .soft_low = 0.01,
                    .soft_high = 100,
                    .hard_low = 0.001,
                    .hard_high = 1000,
                    .role = Role::shape,
                    .meaning = "periods per turn of the tube"},
    EffectParameter{.name = "cosine_twice",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.002,
                    .soft_low = -0.02,
                    .soft_high = 0.02,
                    .hard_low = -0.3,
                    .hard_high = 0.3,
                    .per_tube = true,
                    .role = Role::detail,
                    .meaning = "of what returns twice as often"},
    EffectParameter{.name = "sine_twice",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.002,
                    .soft_low = -0.02,
                    .soft_high = 0.02,
                    .hard_low = -0.3,
                    .hard_high = 0.3,
                    .per_tube = true,
                    .role = Role::detail,
                    .meaning = "of what returns twice as often"},
};
}  // namespace periodic_rotation

/// Error of rotation once per turn of the motor.
template <int N, class P = double>
struct PeriodicRotation : EffectValues<periodic_rotation::parameters, N, P> {
  static constexpr const EffectInfo& info = periodic_rotation::info;

  void actuate(const Occasion&, std::array<P, N>&, std::array<P, N>& alpha) const noexcept {
    for (std::size_t i = 0; i < N; ++i) {
      P s, c;
      sincos(this->template get<2>() * alpha[i], s, c);
      const P &cosine = this->template get<3>(int(i)), &sine = this->template get<4>(int(i));
      P error = this->template get<0>(int(i)) * c + this->template get<1>(int(i)) * s;
      if (!vanishes(cosine) || !vanishes(sine)) error = error + cosine * (c * c - s * s) + sine * (2.0 * (s * c));
      alpha[i] = alpha[i] + error;
    }
  }
};

}  // namespace ctcr
