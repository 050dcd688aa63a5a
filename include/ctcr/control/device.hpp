#pragma once
// The small interface between a controller and what it controls, simulated or real.
#include <concepts>

#include "ctcr/actuation/transmission.hpp"
#include "ctcr/core/types.hpp"

namespace ctcr {

/// The readings of encoders and tracker in a period.
template <int N>
struct Measurement {
  MotorAngles<N> theta;  ///< [rad]
  Pose reading;          ///< T_tracker_sensor
};

/// A robot that can be moved and measured. Both calls are real time.
template <class D, int N>
concept Device = requires(D& device, const MotorAngles<N>& velocity, double period, Measurement<N>& measured) {
  /// Motor velocities [rad/s] for one period [s].
  { device.move(velocity, period) } noexcept -> std::same_as<Status>;
  /// The present readings of encoders and tracker.
  { device.measure(measured) } noexcept -> std::same_as<Status>;
};

}  // namespace ctcr
