#pragma once
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/frame_algebra.hpp"

namespace ctcr {
namespace frame_jump {
inline constexpr EffectInfo info{
    .id = "frame_jump",
    .title = "Jump of the tracker frame",
    .physics = "Someone bumped the table or re-mounted the base in the middle of the session.",
    .signature = "All readings after one moment are off by the same displacement.",
    .measure = "Return to the same joints every 20 readings; fit one frame per run.",
    .look_alikes = "frame_drift",
    .reference = "practice",
    .needs = {.order = true, .time = true},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "x",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0005,
                    .soft_low = -0.003,
                    .soft_high = 0.003,
                    .hard_low = -0.1,
                    .hard_high = 0.1,
                    .meaning = "along the tracker axis x"},
    EffectParameter{.name = "y",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0005,
                    .soft_low = -0.003,
                    .soft_high = 0.003,
                    .hard_low = -0.1,
                    .hard_high = 0.1,
                    .meaning = "along the tracker axis y"},
    EffectParameter{.name = "z",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0005,
                    .soft_low = -0.003,
                    .soft_high = 0.003,
                    .hard_low = -0.1,
                    .hard_high = 0.1,
                    .meaning = "along the tracker axis z"},
    EffectParameter{.name = "turn_x",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.005,
                    .soft_low = -0.03,
                    .soft_high = 0.03,
                    .hard_low = -0.5,
                    .hard_high = 0.5,
                    .meaning = "about the tracker axis x"},
    EffectParameter{.name = "turn_y",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.005,
                    .soft_low = -0.03,
                    .soft_high = 0.03,
                    .hard_low = -0.5,
                    .hard_high = 0.5,
                    .meaning = "about the tracker axis y"},
    EffectParameter{.name = "turn_z",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.005,
                    .soft_low = -0.03,
                    .soft_high = 0.03,
                    .hard_low = -0.5,
                    .hard_high = 0.5,
                    .meaning = "about the tracker axis z"},
    EffectParameter{.name = "when",
                    .unit = "",
                    .neutral = 0.5,
                    .sigma = 0.3,
                    .soft_low = 0,
                    .soft_high = 1,
                    .hard_low = 0,
                    .hard_high = 1,
                    .role = Role::shape,
                    .meaning = "part of the session after which it jumped"},
};
}  // namespace frame_jump

/// T_ref that jumps once, about the centre of all readings.
template <int N, class P = double>
struct FrameJump : EffectValues<frame_jump::parameters, N, P> {
  static constexpr const EffectInfo& info = frame_jump::info;

  void sense(const Occasion& at, Frame<P>& reading) const noexcept {
    if (at.part <= value(this->values[6])) return;
    constexpr double part = 1;
    const Triple<P> about{-at.centre[0], -at.centre[1], -at.centre[2]}, back{at.centre[0], at.centre[1], at.centre[2]};
    const auto by = [&](std::size_t k) { return P(part * this->values[k]); };
    shift(reading, about);
    reading = composed(displacement<P>({by(0), by(1), by(2)}, {by(3), by(4), by(5)}), reading);
    shift(reading, back);
  }
};

}  // namespace ctcr
