#pragma once
#include <array>
#include <cstddef>

#include "ctcr/core/status.hpp"
#include "ctcr/core/types.hpp"
#include "ctcr/math/se3.hpp"

namespace ctcr {

/// A tracker that reads the pose of a sensor at one tube's tip in its own frame: T_ref T_base_tip T_tip_sensor.
/// Ref: Boyer et al., Section V, where the sensor is the tip.
struct PoseSensor {
  Pose T_tracker_base;  ///< T_ref
  int tube = 0;         ///< whose tip carries the sensor, 0 is the innermost
  Pose T_tip_sensor{};
};

/// Whether a robot of so many tubes can carry the sensor: it sits on one of them, positions are finite, and rotations are
/// rotations (is_rotation()).
/// @return ok or invalid_settings. Real time: yes.
[[nodiscard]] inline Status check_sensor(const PoseSensor& sensor, int tubes) noexcept {
  const auto is_pose = [](const Pose& T) { return is_rotation(T.rotation) && all_finite(T.position); };
  const bool possible =
      sensor.tube >= 0 && sensor.tube < tubes && is_pose(sensor.T_tracker_base) && is_pose(sensor.T_tip_sensor);
  return possible ? Status::ok : Status::invalid_settings;
}

/// Where the sensor is, in the axes of the tip instead of its own; tracker frame. Real time: yes.
[[nodiscard]] inline Pose seat(const PoseSensor& sensor, const Pose& T_base_tip) noexcept {
  return sensor.T_tracker_base * T_base_tip * Pose{Mat3::Identity(), sensor.T_tip_sensor.position};
}

/// The sensor's pose in such a seat, same frame. Real time: yes.
[[nodiscard]] inline Pose seated(const PoseSensor& sensor, const Pose& seat) noexcept {
  return {seat.rotation * sensor.T_tip_sensor.rotation, seat.position};
}

/// The reading of the sensor where the tubes' tips are at T_base_tip. Real time: yes.
template <std::size_t N>
[[nodiscard]] Pose reading(const PoseSensor& sensor, const std::array<Pose, N>& tube_tips) noexcept {
  return seated(sensor, seat(sensor, tube_tips[std::size_t(sensor.tube)]));
}

/// T_base_tip of the tube that carries the sensor, from what that reads. Real time: yes.
[[nodiscard]] inline Pose tip_of(const PoseSensor& sensor, const Pose& reading) noexcept {
  return sensor.T_tracker_base.inverse() * reading * sensor.T_tip_sensor.inverse();
}

/// Derivative of a reading, tracker axes, by the sensor's position [m] and a turn [rad] that leaves it in place, both in
/// the tip's axes: by the parameters tracker.sensor_position and tracker.sensor_rotation. Real time: yes.
[[nodiscard]] inline Mat6 reading_by_mount(const PoseSensor& sensor, const Pose& reading) noexcept {
  Mat6 D = Mat6::Zero();
  D.topLeftCorner<3, 3>() = reading.rotation * sensor.T_tip_sensor.rotation.transpose();
  D.bottomRightCorner<3, 3>() = D.topLeftCorner<3, 3>();
  return D;
}

/// Derivative of a reading's position [m] and rotation [rad], tracker axes, by those of the tip, base axes.
/// Real time: yes.
[[nodiscard]] inline Mat6 reading_by_tip(const PoseSensor& sensor, const Pose& reading) noexcept {
  const Mat3& R = sensor.T_tracker_base.rotation;
  const Vec3 arm = reading.rotation * sensor.T_tip_sensor.rotation.transpose() * sensor.T_tip_sensor.position;
  Mat6 D = Mat6::Zero();
  D.topLeftCorner<3, 3>() = D.bottomRightCorner<3, 3>() = R;
  for (int j = 0; j < 3; ++j) D.block<3, 1>(0, 3 + j) = R.col(j).cross(arm);
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

}  // namespace ctcr
