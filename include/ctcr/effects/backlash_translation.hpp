#pragma once
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/functions.hpp"

namespace ctcr {
namespace backlash_translation {
inline constexpr EffectInfo info{
    .id = "backlash_translation",
    .title = "Backlash of translation",
    .physics =
        "Gears, couplings and screws have play: after a reversal the motor moves a little before the tube follows.",
    .signature =
        "The error flips with the last direction of insertion, by the same amount everywhere, whatever the load.",
    .measure = "Reverse the insertion often, at the same joints.",
    .look_alikes = "delay",
    .reference = "Modes & Burgner-Kahrs 2020",
    .needs = {.order = true},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "play",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 5e-05,
                    .soft_low = 0,
                    .soft_high = 0.0005,
                    .hard_low = 0,
                    .hard_high = 0.001,
                    .per_tube = true,
                    .meaning = "half the play of a tube"},
};
}  // namespace backlash_translation

/// Play operator on beta: the tube stands where it was pushed to, anywhere within +-b of its motor.
template <int N, class P = double>
struct BacklashTranslation : EffectValues<backlash_translation::parameters, N, P, N> {
  static constexpr const EffectInfo& info = backlash_translation::info;

  void remember(const Path<N, P>& path, std::size_t row) noexcept {
    if (row == 0) return;
    for (std::size_t i = 0; i < N; ++i) {
      P& lag = this->past.state[i];
      const P& b = this->template get<0>(int(i));
      const P moved = path.q[row].beta[i] - path.q[row - 1].beta[i];
      if (value(moved) != 0) lag = clamped(P(lag - moved), P(-b), b);
    }
  }

  void actuate(const Occasion&, std::array<P, N>& beta, std::array<P, N>&) const noexcept {
    for (std::size_t i = 0; i < N; ++i) beta[i] = beta[i] + this->past.state[i];
  }
};

}  // namespace ctcr
