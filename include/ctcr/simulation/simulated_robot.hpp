#pragma once
// A robot that is not there: its own model, effects and noise behind the interface of a device.
#include <random>

#include "ctcr/control/device.hpp"
#include "ctcr/control/live_effects.hpp"
#include "ctcr/math/frame_algebra.hpp"
#include "ctcr/system/predict.hpp"

namespace ctcr {

/// Standard deviations of the noise of the tracker, along and about each axis.
struct TrackerNoise {
  double position = 0;  ///< [m]
  double rotation = 0;  ///< [rad]
};

/// Moves as its motors are told and settles in the equilibrium of its own system. Real time: its calls are, but for a
/// solve's bounded number of evaluations.
template <int N, class Fx = Standard>
class SimulatedRobot {
public:
  /// @param load  at the robot tip   @param seed  of the noise
  SimulatedRobot(const System<N, Fx>& system, const MotorAngles<N>& start, const TipLoad& load,
                 const TrackerNoise& noise = {}, std::uint64_t seed = 1) noexcept
    : system_(system),
      theta_(start),
      load_(load),
      noise_(noise),
      random_(seed),
      live_(system.model),
      model_(system.model),
      sensor_(check_sensor(system.sensor, N)) {
    if (sensor_ != Status::ok) system_.sensor = {};
    settle();
  }

  Status move(const MotorAngles<N>& velocity, double period) noexcept {
    theta_.translation += period * velocity.translation;
    theta_.rotation += period * velocity.rotation;
    time_ += period;
    settle();
    return solution_.status == Status::singular ? Status::ok : solution_.status;
  }

  /// @return invalid_settings: check_sensor(), it reads the tip instead; else as solve(), singular is ok
  Status measure(Measurement<N>& out) noexcept {
    out.theta = theta_;
    const Pose exact = exact_reading();
    const auto three = [this](double sigma) {
      return Vec3(sigma * normal_(random_), sigma * normal_(random_), sigma * normal_(random_));
    };
    out.reading.position = exact.position + three(noise_.position);
    out.reading.rotation = rotation_matrix(three(noise_.rotation)) * exact.rotation;
    if (sensor_ != Status::ok) return sensor_;
    return solution_.status == Status::singular ? Status::ok : solution_.status;
  }

  /// Without noise: T_tracker_sensor.
  [[nodiscard]] Pose exact_reading() const noexcept {
    Frame<double> frame = frame_of<double>(seat(system_.sensor, tip()));
    if constexpr (!Fx::none) live_.effects().sense(live_.occasion(), frame);
    return seated(system_.sensor, pose_of(frame));
  }
  /// In its true base frame, in the tip that carries the sensor.
  [[nodiscard]] const Pose& tip() const noexcept { return solution_.tube_tips[std::size_t(system_.sensor.tube)]; }
  [[nodiscard]] const MotorAngles<N>& motor_angles() const noexcept { return theta_; }
  [[nodiscard]] const Solution<N>& solution() const noexcept { return solution_; }

private:
  void settle() noexcept {
    Joints<N> q = joints(system_.transmission, theta_);
    if constexpr (!Fx::none) {
      const auto equilibrium = [this](const auto& effects, const Joints<N>& tubes) {
        model_ = Model<N, Fx>(system_.model.robot(), effects);
        return has_equilibrium(solve(model_, tubes, load_, ws_, solution_, system_.settings)) ? &model_ : nullptr;
      };
      q = live_.advance(q, time_, ws_, equilibrium);
      model_ = Model<N, Fx>(system_.model.robot(), live_.effects());
    }
    (void)solve<Derivatives::jacobian>(model_, q, load_, ws_, solution_, system_.settings);
  }

  System<N, Fx> system_;
  MotorAngles<N> theta_;
  TipLoad load_;
  TrackerNoise noise_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  LiveEffects<N, Fx> live_;
  Model<N, Fx> model_;
  Status sensor_;
  double time_ = 0;
  Workspace<N> ws_;
  Solution<N> solution_;
};

}  // namespace ctcr
