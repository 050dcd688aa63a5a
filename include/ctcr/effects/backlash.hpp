#pragma once
// Backlash of the drives: of rotation and of translation.
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
                    .soft = {0, 0.05},
                    .hard = {0, 0.1},
                    .per_tube = true,
                    .meaning = "half the play of a tube"},
};
}  // namespace backlash_rotation

namespace backlash_translation {
inline constexpr EffectInfo info{
    .id = "backlash_translation",
    .title = "Backlash of translation",
    .physics = backlash_rotation::info.physics,
    .signature =
        "The error flips with the last direction of insertion, by the same amount everywhere, whatever the load.",
    .measure = "Reverse the insertion often, at the same joints.",
    .look_alikes = "delay",
    .reference = backlash_rotation::info.reference,
    .needs = {.order = true},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "play",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 5e-05,
                    .soft = {0, 0.0005},
                    .hard = {0, 0.001},
                    .per_tube = true,
                    .meaning = "half the play of a tube"},
};
}  // namespace backlash_translation

/// Play operator: a joint lags its motor by at most b = half the play, and is pushed along where the lag would exceed it.
/// Internal state: joint minus motor, of each tube [rad or m].
template <const auto& List, int N, class P>
struct Backlash : EffectValues<List, N, P, N> {
protected:
  /// @param joint  &Row::alpha or &Row::beta of the path
  void follow(const Path<N, P>& path, std::size_t row, std::array<P, N> Path<N, P>::Row::* joint) noexcept {
    if (row == 0) return;
    for (std::size_t i = 0; i < N; ++i) {
      P& lag = this->history.state[i];
      const P& b = this->template get<0>(int(i));
      const P moved = (path.q[row].*joint)[i] - (path.q[row - 1].*joint)[i];
      if (value(moved) != 0) lag = clamped(P(lag - moved), P(-b), b);
    }
  }
  void move(std::array<P, N>& joint) const noexcept {
    for (std::size_t i = 0; i < N; ++i) joint[i] = joint[i] + this->history.state[i];
  }
};

/// Play between the motors and alpha.
template <int N, class P = double>
struct BacklashRotation : Backlash<backlash_rotation::parameters, N, P> {
  static constexpr const EffectInfo& info = backlash_rotation::info;

  void update_history(const Path<N, P>& path, std::size_t row) noexcept {
    this->follow(path, row, &Path<N, P>::Row::alpha);
  }
  void actuate(const Occasion&, std::array<P, N>&, std::array<P, N>& alpha) const noexcept { this->move(alpha); }
};

/// Play between the motors and beta.
template <int N, class P = double>
struct BacklashTranslation : Backlash<backlash_translation::parameters, N, P> {
  static constexpr const EffectInfo& info = backlash_translation::info;

  void update_history(const Path<N, P>& path, std::size_t row) noexcept {
    this->follow(path, row, &Path<N, P>::Row::beta);
  }
  void actuate(const Occasion&, std::array<P, N>& beta, std::array<P, N>&) const noexcept { this->move(beta); }
};

}  // namespace ctcr
