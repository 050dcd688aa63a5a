#pragma once
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/frame_algebra.hpp"

namespace ctcr {
namespace frame_drift {
inline constexpr EffectInfo info{
    .id = "frame_drift",
    .title = "Drift of the tracker frame",
    .physics = "The base, the table or the field generator creeps during the session.",
    .signature = "The error grows with time, whatever the joints.",
    .measure = "Return to the same joints every 20 readings.",
    .look_alikes = "frame_jump",
    .reference = "Jang et al. 2016",
    .needs = {.order = true, .time = true},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "x",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.003,
                    .soft_high = 0.003,
                    .hard_low = -0.1,
                    .hard_high = 0.1,
                    .meaning = "along the tracker axis x"},
    EffectParameter{.name = "y",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.003,
                    .soft_high = 0.003,
                    .hard_low = -0.1,
                    .hard_high = 0.1,
                    .meaning = "along the tracker axis y"},
    EffectParameter{.name = "z",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.003,
                    .soft_high = 0.003,
                    .hard_low = -0.1,
                    .hard_high = 0.1,
                    .meaning = "along the tracker axis z"},
    EffectParameter{.name = "turn_x",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.002,
                    .soft_low = -0.03,
                    .soft_high = 0.03,
                    .hard_low = -0.5,
                    .hard_high = 0.5,
                    .meaning = "about the tracker axis x"},
    EffectParameter{.name = "turn_y",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.002,
                    .soft_low = -0.03,
                    .soft_high = 0.03,
                    .hard_low = -0.5,
                    .hard_high = 0.5,
                    .meaning = "about the tracker axis y"},
    EffectParameter{.name = "turn_z",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.002,
                    .soft_low = -0.03,
                    .soft_high = 0.03,
                    .hard_low = -0.5,
                    .hard_high = 0.5,
                    .meaning = "about the tracker axis z"},
};
}  // namespace frame_drift

/// T_ref that drifts evenly from the first to the last row, about the centre of all readings.
template <int N, class P = double>
struct FrameDrift : EffectValues<frame_drift::parameters, N, P> {
  static constexpr const EffectInfo& info = frame_drift::info;

  void sense(const Occasion& at, Frame<P>& reading) const noexcept {
    const double part = at.part - 0.5;
    const Triple<P> about{-at.centre[0], -at.centre[1], -at.centre[2]}, back{at.centre[0], at.centre[1], at.centre[2]};
    const auto by = [&](std::size_t k) { return P(part * this->values[k]); };
    shift(reading, about);
    reading = composed(displacement<P>({by(0), by(1), by(2)}, {by(3), by(4), by(5)}), reading);
    shift(reading, back);
  }
};

}  // namespace ctcr
