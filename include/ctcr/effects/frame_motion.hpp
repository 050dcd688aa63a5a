#pragma once
// Displacements of the tracker frame during a session: a drift and a jump.
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/frame_algebra.hpp"

namespace ctcr {
namespace detail {

/// Displacements along the tracker's axes [m], rotations about them [rad], then `course`, which sets the course in time.
/// @param sigma, turn_sigma  plausible standard deviation of a displacement [m] and of a rotation [rad]
constexpr std::array<EffectParameter, 7> frame_displacement(double sigma, double turn_sigma,
                                                            const EffectParameter& course) noexcept {
  const EffectParameter along{.name = {}, .unit = "m", .sigma = sigma, .soft = {-0.003, 0.003}, .hard = {-0.1, 0.1}};
  const EffectParameter about{
      .name = {}, .unit = "rad", .sigma = turn_sigma, .soft = {-0.03, 0.03}, .hard = {-0.5, 0.5}};
  return {along.named("x", "along the tracker axis x"),
          along.named("y", "along the tracker axis y"),
          along.named("z", "along the tracker axis z"),
          about.named("turn_x", "about the tracker axis x"),
          about.named("turn_y", "about the tracker axis y"),
          about.named("turn_z", "about the tracker axis z"),
          course};
}

/// Displaces a reading by a part of the first six values, about the centre of all readings.
template <class P, std::size_t Count>
void displace_frame(const Occasion& at, const P& part, const std::array<P, Count>& values, Frame<P>& reading) noexcept {
  const Triple<P> about{-at.centre[0], -at.centre[1], -at.centre[2]}, back{at.centre[0], at.centre[1], at.centre[2]};
  const auto by = [&](std::size_t k) { return part * values[k]; };
  shift(reading, about);
  reading = composed(displacement<P>({by(0), by(1), by(2)}, {by(3), by(4), by(5)}), reading);
  shift(reading, back);
}

}  // namespace detail

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
inline constexpr std::array parameters = detail::frame_displacement(
    3e-4, 2e-3,
    {.name = "settling",
     .neutral = 0,
     .sigma = 0.5,
     .soft = {-1, 1},
     .hard = {-2, 2},
     .role = Role::shape,
     .meaning = "how much faster than on average it drifts at first, and slower at last: 0 evenly, "
                "1 twice as fast at first and not at all at last"});
}  // namespace frame_drift

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
    detail::frame_displacement(5e-4, 5e-3,
                               {.name = "when",
                                .neutral = 0.5,
                                .sigma = 0.3,
                                .soft = {0, 1},
                                .hard = {0, 1},
                                .role = Role::choice,
                                .quantity = Quantity::moment,
                                .meaning = "part of the session after which it jumped"});
}  // namespace frame_jump

/// T_ref drifts from the first to the last row, at a constant rate or ever more slowly. The displacement grows by 1 from
/// the first row to the last and is about 0 in the middle of the session.
template <int N, class P = double>
struct FrameDrift : EffectValues<frame_drift::parameters, N, P> {
  static constexpr const EffectInfo& info = frame_drift::info;

  void sense(const Occasion& at, Frame<P>& reading) const noexcept {
    const P part(at.part - 0.5 + at.part * (1 - at.part) * this->template get<6>());
    detail::displace_frame(at, part, this->values, reading);
  }
};

/// T_ref jumps once.
template <int N, class P = double>
struct FrameJump : EffectValues<frame_jump::parameters, N, P> {
  static constexpr const EffectInfo& info = frame_jump::info;

  void sense(const Occasion& at, Frame<P>& reading) const noexcept {
    if (!(at.part <= value(this->values[6]))) detail::displace_frame(at, P(1.0), this->values, reading);
  }
};

}  // namespace ctcr
