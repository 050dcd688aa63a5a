#pragma once
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/functions.hpp"

namespace ctcr {
namespace backlash_rotation {
inline constexpr EffectInfo info{
    .id = "backlash_rotation",
    .title = "Backlash of rotation",
    .physics =
        "Gears, couplings and screws have play: after a reversal the motor moves a little before the tube follows.",
    .signature =
        "The error flips with the last direction of rotation, by the same amount everywhere, whatever the load.",
    .measure = "Turn one tube back and forth alone, straightened or far retracted: backlash stays, friction does not.",
    .look_alikes = "friction delay",
    .reference = "Modes & Burgner-Kahrs 2020",
    .needs = {.order = true},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "play",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.0087,
                    .soft_low = 0,
                    .soft_high = 0.05,
                    .hard_low = 0,
                    .hard_high = 0.1,
                    .per_tube = true,
                    .meaning = "half the play of a tube"},
};
}  // namespace backlash_rotation

/// Play operator on alpha: the tube stands where it was pushed to, anywhere within +-b of its motor.
template <int N, class P = double>
struct BacklashRotation : EffectValues<backlash_rotation::parameters, N, P, N> {
  static constexpr const EffectInfo& info = backlash_rotation::info;

  void remember(const Path<N, P>& path, std::size_t row) noexcept {
    if (row == 0) return;
    for (std::size_t i = 0; i < N; ++i) {
      P& lag = this->past.state[i];
      const P& b = this->template get<0>(int(i));
      const P moved = path.q[row].alpha[i] - path.q[row - 1].alpha[i];
      if (value(moved) != 0) lag = clamped(P(lag - moved), P(-b), b);
    }
  }

  void actuate(const Occasion&, std::array<P, N>&, std::array<P, N>& alpha) const noexcept {
    for (std::size_t i = 0; i < N; ++i) alpha[i] = alpha[i] + this->past.state[i];
  }
};

}  // namespace ctcr
