#pragma once
// Readings of recorded rows, by the whole system with its effects:
//
//   motor angles --transmission--> joints --history, drives--> joints that the tubes have --model--> tip --T_ref,
//   sensor--> reading
#include "ctcr/math/frame_algebra.hpp"
#include "ctcr/math/small_solve.hpp"
#include "ctcr/recording/history.hpp"
#include "ctcr/system/predict.hpp"

namespace ctcr {

/// Every step on the way to the reading of a row; q are the joints that the tubes have.
template <int N, class Fx>
struct RecordedPrediction : Prediction<N> {
  TipLoad load;                    ///< with the force of the surroundings
  Model<N, Fx> model{Robot<N>{}};  ///< with the history of this row; without effects it is not set
};

namespace detail {

/// Force of the surroundings on the robot tip at a position, and its derivative by that position; base frame.
struct SurroundingForce {
  Vec3 force;
  Mat3 by_position;
};
/// @param effects  those of the tip's surroundings, with the scalar Dual<1>
SurroundingForce surrounding_force(const auto& effects, const Vec3& position) noexcept {
  std::array<Dual<1>, 3> at, f{0.0, 0.0, 0.0};
  for (int i = 0; i < 3; ++i) {
    at[std::size_t(i)] = position[i];
    at[std::size_t(i)].d[0] = unit_lane(i);
  }
  effects.environment(at, f);
  SurroundingForce out;
  for (int i = 0; i < 3; ++i) {
    out.force[i] = f[std::size_t(i)].v;
    for (int j = 0; j < 3; ++j) out.by_position(i, j) = f[std::size_t(i)].d[0][std::size_t(j)];
  }
  return out;
}

/// Solves with the force of the surroundings added to the load: Newton's method on that force, whose derivative by the tip's
/// position is known, and so is the tip's compliance.
template <int N, class Fx>
Status solve_in_surroundings(Workspace<N>& ws, RecordedPrediction<N, Fx>& out, const Settings& settings) noexcept {
  using S = Dual<1>;
  constexpr int iterations = 30;
  Status status = solve(out.model, out.q, out.load, ws, out.solution, settings);
  bool kept_branch = out.solution.kept_branch;
  const Vec3 known = out.load.force;
  const auto effects = out.model.effects().template seeded<S, typename Fx::OnTip>(Constant<S>{});
  Vec3 added = Vec3::Zero(), change = Vec3::Zero();
  SurroundingForce push = surrounding_force(effects, out.solution.position);
  if (push.force.isZero(0.0)) return status;
  for (int k = 0; k < iterations && has_equilibrium(status); ++k) {
    status = solve<Derivatives::compliance>(out.model, out.q, out.load, ws, out.solution, settings);
    kept_branch = out.solution.kept_branch = kept_branch && out.solution.kept_branch;
    push = surrounding_force(effects, out.solution.position);
    if (push.force.isZero(0.0)) {  // pushed out: the solution lies between
      change *= 0.5;
      added -= change;
    } else {
      const Mat3 C = out.solution.compliance.template topLeftCorner<3, 3>();
      change = solved<3>(Mat3::Identity() - push.by_position * C, Vec3(push.force - added));
      if (change.norm() < settings.tolerance) return status;
      added += change;
    }
    out.load.force = known + added;
  }
  if (has_equilibrium(status)) status = Status::not_converged;
  return out.solution.status = status;
}

}  // namespace detail

/// Reading of the tracker in a row.
/// @param history  of this row, as histories() gives it
/// @return as solve(), invalid_settings: check_sensor(), nothing is computed; not_finite where a parameter of an effect is
///         not a number, not_converged where the tip and its surroundings find no balance. Real time: yes.
template <int N, class Fx>
  requires(!Fx::none)
CTCR_NOINLINE Status predict(const System<N, Fx>& system, const RecordedRow<N>& row,
                             const typename Fx::template On<N>::History& history, Workspace<N>& ws,
                             RecordedPrediction<N, Fx>& out) noexcept {
  out.reading = {};
  out.solution.iterations = 0;
  if (check_sensor(system.sensor, N) != Status::ok) return detail::blank(Status::invalid_settings, out.solution);
  auto effects = system.model.effects();
  effects.set_history(history);
  std::array<double, N> beta, alpha;
  detail::joints_of<N, double>(system.transmission, row.theta, [](double x, int) { return x; }, beta, alpha);
  effects.actuate(row.at, beta, alpha);
  for (int i = 0; i < N; ++i) out.q.beta[i] = beta[std::size_t(i)], out.q.alpha[i] = alpha[std::size_t(i)];
  out.load = row.load;
  out.model = Model<N, Fx>(system.model.robot(), effects);
  if constexpr (Fx::template On<N>::has_environment)
    (void)detail::solve_in_surroundings(ws, out, system.settings);
  else
    (void)solve(out.model, out.q, out.load, ws, out.solution, system.settings);
  Frame<double> reading =
      frame_of<double>(seat(system.sensor, out.solution.tube_tips[std::size_t(system.sensor.tube)]));
  effects.sense(row.at, reading);
  out.reading = seated(system.sensor, pose_of(reading));
  if (!(effects.finite() && out.reading.position.allFinite() && out.reading.rotation.allFinite())) {
    out.solution = Solution<N>{};
    out.solution.status = Status::not_finite;
    out.reading = Pose{};
    ws.reset();
  }
  return out.solution.status;
}

/// As above without effects, by the faster path of system/predict.hpp.
template <int N, class Fx>
  requires(Fx::none)
Status predict(const System<N, Fx>& system, const RecordedRow<N>& row, const typename Fx::template On<N>::History&,
               Workspace<N>& ws, RecordedPrediction<N, Fx>& out) noexcept {
  out.load = row.load;
  return predict(system, row.theta, row.load, ws, out);
}

}  // namespace ctcr
