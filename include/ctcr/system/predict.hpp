#pragma once
// The whole system, from what is commanded to what is measured, and its derivative along the same way:
//
//   motor angles theta --transmission--> joints q --model--> tube tips --T_ref, T_tip_sensor--> reading -->
//   residual
#include "ctcr/derivatives/parameters.hpp"
#include "ctcr/sensing/residual.hpp"
#include "ctcr/system/system.hpp"

namespace ctcr {

/// Every breakpoint of the way.
template <int N>
struct Prediction {
  Joints<N> q;
  Solution<N> solution;
  Pose reading;  ///< T_tracker_sensor
};

/// The predicted reading of the tracker when the motors stand at theta and `load` acts on the robot tip.
/// @return as solve(); invalid_settings: check_sensor(), nothing is computed. Real time: yes.
template <int N>
Status predict(const System<N>& system, const MotorAngles<N>& theta, const TipLoad& load, Workspace<N>& ws,
               Prediction<N>& out) noexcept {
  out.q = joints(system.transmission, theta);
  out.reading = {};
  out.solution.iterations = 0;
  if (check_sensor(system.sensor, N) != Status::ok) return detail::blank(Status::invalid_settings, out.solution);
  const Status status = solve(system.model, out.q, load, ws, out.solution, system.settings);
  out.reading = reading(system.sensor, out.solution.tube_tips);
  return status;
}

/// Derivatives of a reading or a residual. Rows: position [m], rotation [rad], both in tracker axes.
template <int N>
struct PredictionDerivatives {
  Eigen::Matrix<double, 6, 2 * N> by_motors;                          ///< translation 1..N, rotation 1..N [rad]
  Eigen::Matrix<double, 6, ParameterVector<N>::count> by_parameters;  ///< columns as ParameterVector<N>
};

/// Derivative of the reading that predict() just left in `ws` and `prediction`.
/// @return the status of the prediction where that failed, with derivatives of zero; else as differentiate_tip(). Real
/// time: yes.
template <int N>
Status differentiate(const System<N>& system, const MotorAngles<N>& theta, const Workspace<N>& ws,
                     const Prediction<N>& prediction, PredictionDerivatives<N>& out) noexcept {
  using P = ParameterVector<N>;
  const Transmission<N>& transmission = system.transmission;
  const auto columns = [&](Parameter kind) { return out.by_parameters.middleCols(P::index(kind), P::size(kind)); };
  out.by_motors.setZero();
  out.by_parameters.setZero();
  if (!has_equilibrium(prediction.solution.status)) return prediction.solution.status;
  TipDerivatives<N> tip;
  const Status status = differentiate_tip(system.model, ws, system.sensor.tube, tip);
  const Mat6 by_tip = reading_by_tip(system.sensor, prediction.reading),
             by_frame = reading_by_frame(system.sensor, prediction.reading),
             by_mount = reading_by_mount(system.sensor, prediction.reading);
  const Eigen::Matrix<double, 6, N> by_beta = by_tip * tip.by_joints.template leftCols<N>();
  const Eigen::Matrix<double, 6, N> by_alpha = by_tip * tip.by_joints.template rightCols<N>();
  out.by_motors << by_beta * transmission.translation_ratio, by_alpha * transmission.rotation_ratio;
  out.by_parameters.template leftCols<P::robot_count>() = by_tip * tip.by_parameters;
  columns(Parameter::translation_ratio) = by_beta * theta.translation;
  columns(Parameter::rotation_ratio) = by_alpha * theta.rotation;
  columns(Parameter::home_translation) = by_beta;
  columns(Parameter::home_rotation) = by_alpha;
  columns(Parameter::tracker_position) = by_frame.leftCols<3>();
  columns(Parameter::tracker_rotation) = by_frame.rightCols<3>();
  columns(Parameter::sensor_position) = by_mount.leftCols<3>();
  columns(Parameter::sensor_rotation) = by_mount.rightCols<3>();
  return status;
}

/// Residual of a measured reading and, in place, its derivatives from those of the reading. Real time: yes.
template <int N>
Vec6 residual(const Pose& measured, const Prediction<N>& prediction, PredictionDerivatives<N>& derivatives) noexcept {
  const Vec6 e = residual(measured, prediction.reading);
  const Mat6 by_reading = residual_by_prediction(e);
  derivatives.by_motors = (by_reading * derivatives.by_motors).eval();
  derivatives.by_parameters = (by_reading * derivatives.by_parameters).eval();
  return e;
}

}  // namespace ctcr
