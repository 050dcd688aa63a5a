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
inline constexpr std::array parameters = frame_displacement(
    3e-4, 2e-3,
    EffectParameter{.name = "settling",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.5,
                    .soft_low = -1,
                    .soft_high = 1,
                    .hard_low = -2,
                    .hard_high = 2,
                    .role = Role::shape,
                    .meaning = "how much faster than on average it drifts at first, and slower at last: 0 evenly, "
                               "1 twice as fast at first and not at all at last"});
}  // namespace frame_drift

/// T_ref that drifts from the first to the last row, evenly or ever more slowly, about the centre of all readings.
template <int N, class P = double>
struct FrameDrift : EffectValues<frame_drift::parameters, N, P> {
  static constexpr const EffectInfo& info = frame_drift::info;

  /// Between first and last row the drift is 1, in the middle of the session about 0.
  void sense(const Occasion& at, Frame<P>& reading) const noexcept {
    displace_frame(at, P(at.part - 0.5 + at.part * (1 - at.part) * this->template get<6>()), this->values, reading);
  }
};

}  // namespace ctcr
