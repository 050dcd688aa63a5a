#pragma once
#include "ctcr/effects/frame_displacement.hpp"

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
inline constexpr std::array parameters =
    frame_displacement(5e-4, 5e-3,
                       EffectParameter{.name = "when",
                                       .unit = "",
                                       .neutral = 0.5,
                                       .sigma = 0.3,
                                       .soft_low = 0,
                                       .soft_high = 1,
                                       .hard_low = 0,
                                       .hard_high = 1,
                                       .role = Role::choice,
                                       .meaning = "part of the session after which it jumped"});
}  // namespace frame_jump

/// T_ref that jumps once, about the centre of all readings.
template <int N, class P = double>
struct FrameJump : EffectValues<frame_jump::parameters, N, P> {
  static constexpr const EffectInfo& info = frame_jump::info;

  void sense(const Occasion& at, Frame<P>& reading) const noexcept {
    if (!(at.part <= value(this->values[6]))) displace_frame(at, P(1.0), this->values, reading);
  }
};

}  // namespace ctcr
