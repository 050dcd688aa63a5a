#pragma once
#include "ctcr/actuation/transmission.hpp"
#include "ctcr/mechanics/solve.hpp"
#include "ctcr/sensing/pose_sensor.hpp"

namespace ctcr {

/// A robot with its motors and its tracker, as it is calibrated and controlled. Immutable; share it between threads.
/// @tparam Fx  EffectList<...> of what it has beyond the standard model
template <int N, class Fx = Standard>
struct System {
  Transmission<N> transmission;
  Model<N, Fx> model;
  PoseSensor sensor;
  Settings settings{};
};

}  // namespace ctcr
