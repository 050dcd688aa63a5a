#pragma once
#include "ctcr/effects/hooks.hpp"

namespace ctcr {
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
inline constexpr std::array parameters{
    EffectParameter{.name = "cosine",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 3e-05,
                    .soft_low = -0.0001,
                    .soft_high = 0.0001,
                    .hard_low = -0.002,
                    .hard_high = 0.002,
                    .per_tube = true,
                    .meaning = "at beta 0"},
    EffectParameter{.name = "sine",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 3e-05,
                    .soft_low = -0.0001,
                    .soft_high = 0.0001,
                    .hard_low = -0.002,
                    .hard_high = 0.002,
                    .per_tube = true,
                    .meaning = "a quarter turn on"},
    EffectParameter{.name = "pitch",
                    .unit = "m",
                    .neutral = 0.002,
                    .sigma = 0.0001,
                    .soft_low = 0.0002,
                    .soft_high = 0.02,
                    .hard_low = 1e-05,
                    .hard_high = 0.1,
                    .role = Role::shape,
                    .meaning = "translation per turn of the screw"},
    EffectParameter{.name = "cosine_twice",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 8e-06,
                    .soft_low = -0.0001,
                    .soft_high = 0.0001,
                    .hard_low = -0.002,
                    .hard_high = 0.002,
                    .per_tube = true,
                    .role = Role::detail,
                    .meaning = "of what returns twice as often"},
    EffectParameter{.name = "sine_twice",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 8e-06,
                    .soft_low = -0.0001,
                    .soft_high = 0.0001,
                    .hard_low = -0.002,
                    .hard_high = 0.002,
                    .per_tube = true,
                    .role = Role::detail,
                    .meaning = "of what returns twice as often"},
};
}  // namespace periodic_translation

/// Error of translation once per turn of the lead screw.
template <int N, class P = double>
struct PeriodicTranslation : EffectValues<periodic_translation::parameters, N, P> {
  static constexpr const EffectInfo& info = periodic_translation::info;

  void actuate(const Occasion&, std::array<P, N>& beta, std::array<P, N>&) const noexcept {
    constexpr double turn = 6.283185307179586;
    const P rate = turn * inverse(this->template get<2>());
    for (std::size_t i = 0; i < N; ++i) {
      P s, c;
      sincos(rate * beta[i], s, c);
      const P &cosine = this->template get<3>(int(i)), &sine = this->template get<4>(int(i));
      P error = this->template get<0>(int(i)) * c + this->template get<1>(int(i)) * s;
      if (!vanishes(cosine) || !vanishes(sine)) error = error + cosine * (c * c - s * s) + sine * (2.0 * (s * c));
      beta[i] = beta[i] + error;
    }
  }
};

}  // namespace ctcr
