#pragma once
// A system without effects from the values of its parameters.
#include <ctcr/system/parameters.hpp>

namespace ctcr::python {

/// @param parameters   as ParameterVector<N>; tracker.rotation: rotation vector of T_ref   @param sensor_tube  from 0
template <int N>
System<N> plain_system(const Eigen::VectorXd& parameters, int sensor_tube, int steps) {
  using P = ParameterVector<N>;
  const auto value = [&](Parameter kind, int i = 0) { return parameters[P::index(kind, i)]; };
  Robot<N> robot;
  Transmission<N> transmission{value(Parameter::translation_ratio), value(Parameter::rotation_ratio), {}, {}};
  PoseSensor sensor{{}, sensor_tube};
  Vec3 turn;
  for (int i = 0; i < N; ++i) {
    for (int k = 0; k < int(parameter_kinds.size()); ++k)
      if (const auto field = P::info(Parameter(k)).field) robot.tubes[std::size_t(i)].*field = value(Parameter(k), i);
    transmission.home_translation[i] = value(Parameter::home_translation, i);
    transmission.home_rotation[i] = value(Parameter::home_rotation, i);
  }
  for (int i = 0; i < 3; ++i) {
    robot.gravity[i] = value(Parameter::gravity, i);
    sensor.T_tracker_base.position[i] = value(Parameter::tracker_position, i);
    turn[i] = value(Parameter::tracker_rotation, i);
  }
  sensor.T_tracker_base.rotation = rotation_matrix(turn);
  sensor.roll = value(Parameter::sensor_roll);
  return {transmission, Model<N>(robot), sensor, Settings{.steps = steps}};
}

}  // namespace ctcr::python
