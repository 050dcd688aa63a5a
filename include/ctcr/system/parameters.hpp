#pragma once
// All named numbers of a system as one vector: those of ParameterVector<N>, then those of its effects.
#include <string>

#include "ctcr/robot/parameters.hpp"
#include "ctcr/system/system.hpp"

namespace ctcr {

template <int N, class Fx>
struct SystemParameters {
  using Effects = typename Fx::template On<N>;
  using Robot = ParameterVector<N>;
  static constexpr int count = Robot::count + Effects::count;

  /// "tubes.2.length", "effects.softening.gamma.2" (tube 2; no number where the tubes share it).
  [[nodiscard]] static std::string name(int index) {
    if (index < Robot::count) return std::string(std::string_view(Robot::name(index)));
    std::string text;
    Effects{}.for_each([&](const auto& effect, int first) {
      for (int k = 0; k < int(effect.parameters.size()); ++k)
        for (int i = 0; i < effect.size(k); ++i)
          if (Robot::count + first + effect.index(k, i) == index) {
            const EffectParameter& parameter = effect.parameters[std::size_t(k)];
            text.append("effects.").append(effect.info.id).append(".").append(parameter.name);
            if (parameter.per_tube) text.append(".").append(std::to_string(i + 1));
          }
    });
    return text;
  }

  /// The values of a system; turns count from its own frames, so they are 0.
  [[nodiscard]] static Eigen::VectorXd values(const System<N, Fx>& system) {
    Eigen::VectorXd x = Eigen::VectorXd::Zero(count);
    ctcr::Robot<N> robot = system.model.robot();
    Transmission<N> transmission = system.transmission;
    PoseSensor sensor = system.sensor;
    Effects effects = system.model.effects();
    for_each(robot, transmission, sensor, effects, [&](int index, double& value) { x[index] = value; });
    return x;
  }

  /// The system with the values `x`, as values() gives them; turns are those of the frames of `nominal`.
  template <class X>
  [[nodiscard]] static System<N, Fx> with_values(const System<N, Fx>& nominal, const X& x) noexcept {
    ctcr::Robot<N> robot = nominal.model.robot();
    Transmission<N> transmission = nominal.transmission;
    PoseSensor sensor = nominal.sensor;
    Effects effects = nominal.model.effects();
    for_each(robot, transmission, sensor, effects, [&](int index, double& value) { value = x[index]; });
    const auto turn = [&](Parameter kind, Mat3& rotation) {
      const int first = Robot::index(kind);
      rotation = (rotation_matrix({x[first], x[first + 1], x[first + 2]}) * rotation).eval();
    };
    turn(Parameter::tracker_rotation, sensor.T_tracker_base.rotation);
    turn(Parameter::sensor_rotation, sensor.T_tip_sensor.rotation);
    return {transmission, Model<N, Fx>(robot, effects), sensor, nominal.settings};
  }

private:
  /// Calls f(index, value) for every parameter but the turns, with the number that holds it.
  static void for_each(ctcr::Robot<N>& robot, Transmission<N>& transmission, PoseSensor& sensor, Effects& effects,
                       const auto& f) noexcept {
    const auto each = [&](Parameter kind, auto& numbers) {
      for (int i = 0; i < Robot::size(kind); ++i) f(Robot::index(kind, i), numbers[i]);
    };
    for (int k = 0; k <= int(Parameter::bending_stiffness); ++k)
      for (int i = 0; i < N; ++i)
        f(Robot::index(Parameter(k), i), robot.tubes[std::size_t(i)].*Robot::info(Parameter(k)).field);
    each(Parameter::gravity, robot.gravity);
    f(Robot::index(Parameter::translation_ratio), transmission.translation_ratio);
    f(Robot::index(Parameter::rotation_ratio), transmission.rotation_ratio);
    each(Parameter::home_translation, transmission.home_translation);
    each(Parameter::home_rotation, transmission.home_rotation);
    each(Parameter::tracker_position, sensor.T_tracker_base.position);
    each(Parameter::sensor_position, sensor.T_tip_sensor.position);
    effects.for_each([&](auto& effect, int first) {
      for (std::size_t k = 0; k < effect.values.size(); ++k) f(Robot::count + first + int(k), effect.values[k]);
    });
  }
};

}  // namespace ctcr
