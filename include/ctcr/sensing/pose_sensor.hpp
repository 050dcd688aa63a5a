#pragma once
#include <array>
#include <cstddef>

#include "ctcr/core/types.hpp"
#include "ctcr/math/se3.hpp"

namespace ctcr {

/// A tracker that reads the pose of one tube's tip in its own frame: x_tracker = T_ref x_base.
/// Ref: Boyer et al., Section V.
struct PoseSensor {
  Pose T_tracker_base;  ///< T_ref
  int tube = 0;         ///< whose tip carries the sensor, 0 is the innermost
  double roll = 0;      ///< of the sensor's axes against those of the tip, about their common z axis [rad]
};

/// The sensor's pose where its tube's tip has the pose `tip`, in the same frame. Real time: yes.
[[nodiscard]] inline Pose mounted(const PoseSensor& sensor, const Pose& tip) noexcept {
  return {tip.rotation * rotation_matrix({0, 0, sensor.roll}), tip.position};
}

/// What the sensor reads of the tubes' tips T_base_tip. Real time: yes.
template <std::size_t N>
[[nodiscard]] Pose reading(const PoseSensor& sensor, const std::array<Pose, N>& tube_tips) noexcept {
  return mounted(sensor, sensor.T_tracker_base * tube_tips[std::size_t(sensor.tube)]);
}

/// T_base_tip of the tube that carries the sensor, from what that reads. Real time: yes.
[[nodiscard]] inline Pose tip_of(const PoseSensor& sensor, const Pose& reading) noexcept {
  const Pose tip = sensor.T_tracker_base.inverse() * reading;
  return {tip.rotation * rotation_matrix({0, 0, -sensor.roll}), tip.position};
}

/// Derivative of a reading's position [m] and rotation [rad], tracker axes, by those of the tip, base axes.
/// Real time: yes.
[[nodiscard]] inline Mat6 reading_by_tip(const PoseSensor& sensor) noexcept {
  Mat6 D = Mat6::Zero();
  D.topLeftCorner<3, 3>() = D.bottomRightCorner<3, 3>() = sensor.T_tracker_base.rotation;
  return D;
}

/// T_ref with its origin displaced by `change`[0-2] [m] and turned about it by `change`[3-5] [rad], tracker axes.
/// Real time: yes.
[[nodiscard]] inline Pose moved_frame(const Pose& T_ref, const Vec6& change) noexcept {
  return {rotation_matrix(change.tail<3>()) * T_ref.rotation, T_ref.position + change.head<3>()};
}

/// Derivative of a reading, tracker axes, by such a change of T_ref: by the parameters tracker.position and
/// tracker.rotation. Real time: yes.
[[nodiscard]] inline Mat6 reading_by_frame(const PoseSensor& sensor, const Pose& reading) noexcept {
  const Vec3 arm = reading.position - sensor.T_tracker_base.position;
  Mat6 D = Mat6::Identity();
  for (int j = 0; j < 3; ++j) D.block<3, 1>(0, 3 + j) = Vec3::Unit(j).cross(arm);
  return D;
}

/// Derivative of a reading, tracker axes, by the sensor's roll: by the parameter tracker.sensor_roll. Real time: yes.
[[nodiscard]] inline Vec6 reading_by_roll(const Pose& reading) noexcept {
  Vec6 d;
  d << Vec3::Zero(), reading.rotation.col(2);
  return d;
}

}  // namespace ctcr
