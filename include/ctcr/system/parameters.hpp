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

  /// The values of a system; tracker.rotation is the turn since `frame`, which counts as 0.
  [[nodiscard]] static Eigen::VectorXd values(const System<N, Fx>& system) {
    Eigen::VectorXd x(count);
    const auto put = [&](Parameter kind, const auto& v) { x.segment(Robot::index(kind), Robot::size(kind)) = v; };
    const auto& robot = system.model.robot();
    for (int k = 0; k <= int(Parameter::bending_stiffness); ++k)
      for (int i = 0; i < N; ++i)
        x[Robot::index(Parameter(k), i)] = robot.tubes[std::size_t(i)].*Robot::info(Parameter(k)).field;
    put(Parameter::gravity, robot.gravity);
    x[Robot::index(Parameter::translation_ratio)] = system.transmission.translation_ratio;
    x[Robot::index(Parameter::rotation_ratio)] = system.transmission.rotation_ratio;
    put(Parameter::home_translation, system.transmission.home_translation);
    put(Parameter::home_rotation, system.transmission.home_rotation);
    put(Parameter::tracker_position, system.sensor.T_tracker_base.position);
    put(Parameter::tracker_rotation, Vec3::Zero());
    x[Robot::index(Parameter::sensor_roll)] = system.sensor.roll;
    system.model.effects().for_each([&](const auto& effect, int first) {
      for (std::size_t k = 0; k < effect.values.size(); ++k)
        x[Robot::count + first + Eigen::Index(k)] = effect.values[k];
    });
    return x;
  }

  /// The system with the values `x`, as values() gives them; tracker.rotation turns the frame of `nominal` by
  /// exp(x) about the tracker's axes.
  template <class X>
  [[nodiscard]] static System<N, Fx> with_values(const System<N, Fx>& nominal, const X& x) noexcept {
    ctcr::Robot<N> robot = nominal.model.robot();
    Transmission<N> transmission = nominal.transmission;
    PoseSensor sensor = nominal.sensor;
    for (int k = 0; k <= int(Parameter::bending_stiffness); ++k)
      for (int i = 0; i < N; ++i)
        robot.tubes[std::size_t(i)].*Robot::info(Parameter(k)).field = x[Robot::index(Parameter(k), i)];
    const auto three = [&](Parameter kind) {
      const int i = Robot::index(kind);
      return Vec3(x[i], x[i + 1], x[i + 2]);
    };
    robot.gravity = three(Parameter::gravity);
    transmission.translation_ratio = x[Robot::index(Parameter::translation_ratio)];
    transmission.rotation_ratio = x[Robot::index(Parameter::rotation_ratio)];
    for (int i = 0; i < N; ++i) {
      transmission.home_translation[i] = x[Robot::index(Parameter::home_translation, i)];
      transmission.home_rotation[i] = x[Robot::index(Parameter::home_rotation, i)];
    }
    sensor.T_tracker_base.position = three(Parameter::tracker_position);
    sensor.T_tracker_base.rotation =
        rotation_matrix(three(Parameter::tracker_rotation)) * nominal.sensor.T_tracker_base.rotation;
    sensor.roll = x[Robot::index(Parameter::sensor_roll)];
    Effects effects = nominal.model.effects();
    effects.for_each([&](auto& effect, int first) {
      for (std::size_t k = 0; k < effect.values.size(); ++k)
        effect.values[k] = x[Robot::count + first + Eigen::Index(k)];
    });
    return {transmission, Model<N, Fx>(robot, effects), sensor, nominal.settings};
  }
};

}  // namespace ctcr
