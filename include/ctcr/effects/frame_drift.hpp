#pragma once
#include "ctcr/effects/frame_displacement.hpp"

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
inline constexpr std::array parameters = frame_displacement(3e-4, 2e-3);
}  // namespace frame_drift

/// T_ref that drifts evenly from the first to the last row, about the centre of all readings.
template <int N, class P = double>
struct FrameDrift : EffectValues<frame_drift::parameters, N, P> {
  static constexpr const EffectInfo& info = frame_drift::info;

  void sense(const Occasion& at, Frame<P>& reading) const noexcept {
    displace_frame(at, at.part - 0.5, this->values, reading);
  }
};

}  // namespace ctcr
