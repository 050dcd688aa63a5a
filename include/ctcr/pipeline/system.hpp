#pragma once
#include "ctcr/actuation/transmission.hpp"
#include "ctcr/mechanics/solve.hpp"
#include "ctcr/robot/parameters.hpp"
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

/// The system with the parameter at a place of ParameterVector<N> changed by `change`, in that parameter's unit.
/// Real time: yes.
template <int N>
[[nodiscard]] System<N> changed(const System<N>& system, int index, double change) noexcept {
  const auto [kind, i] = ParameterVector<N>::entry(index);
  Robot<N> robot = system.model.robot();
  Transmission<N> transmission = system.transmission;
  PoseSensor sensor = system.sensor;
  switch (kind) {
    case Parameter::gravity: robot.gravity[i] += change; break;
    case Parameter::translation_ratio: transmission.translation_ratio += change; break;
    case Parameter::rotation_ratio: transmission.rotation_ratio += change; break;
    case Parameter::home_translation: transmission.home_translation[i] += change; break;
    case Parameter::home_rotation: transmission.home_rotation[i] += change; break;
    case Parameter::tracker_position:
      sensor.T_tracker_base = moved_frame(sensor.T_tracker_base, change * Vec6::Unit(i));
      break;
    case Parameter::tracker_rotation:
      sensor.T_tracker_base = moved_frame(sensor.T_tracker_base, change * Vec6::Unit(3 + i));
      break;
    case Parameter::sensor_roll: sensor.roll += change; break;
    default: robot.tubes[std::size_t(i)].*ParameterVector<N>::info(kind).field += change;
  }
  return {transmission, Model<N>(robot), sensor, system.settings};
}

}  // namespace ctcr
