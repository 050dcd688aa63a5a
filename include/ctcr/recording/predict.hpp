#pragma once
// Recorded rows through the whole system with its effects:
//
//   motor angles --transmission--> joints --past, drives--> joints that the tubes have --model--> tip --T_ref,
//   sensor--> reading
#include <span>
#include <vector>

#include "ctcr/math/frame_algebra.hpp"
#include "ctcr/recording/linearised_torsion.hpp"
#include "ctcr/recording/variables.hpp"
#include "ctcr/system/predict.hpp"

namespace ctcr {

/// What the motion before each row left behind in the effects. Rows in the order of recording; between them joints move
/// in a straight line.
/// @param winding  how the rows' twist changes with the parameters; as it stands, if that is not known
/// Real time: no (allocates).
template <int N, class Fx>
std::vector<typename Fx::template On<N>::History> histories(const System<N, Fx>& system,
                                                            std::span<const RecordedRow<N>> rows,
                                                            const Winding<N>& winding = {}) {
  std::vector<typename Fx::template On<N>::History> memory(rows.size());
  if constexpr (Fx::template On<N>::states > 0) {
    auto effects = system.model.effects();
    effects.set_history({});
    detail::RecordedPath<N, double> path(system.transmission, rows, [](double x, int) { return x; });
    winding.unwind(SystemParameters<N, Fx>::values(system), path);
    for (std::size_t row = 0, place = 0; row < rows.size(); ++row) {
      for (; place <= path.end[row]; ++place) effects.update_history(path, place);
      memory[row] = effects.history();
    }
  }
  return memory;
}

/// Every breakpoint of a row's way; q are the joints that the tubes have.
template <int N, class Fx>
struct RecordedPrediction : Prediction<N> {
  TipLoad load;                    ///< with what the surroundings add
  Model<N, Fx> model{Robot<N>{}};  ///< with the past of this row; without effects a row has none, and this is not set
};

namespace detail {

/// Solves with what the tip's surroundings add to the load: Newton's method on that push, whose slope by the tip's
/// position is known, and so is the tip's compliance.
template <int N, class Fx>
Status solve_in_surroundings(Workspace<N>& ws, RecordedPrediction<N, Fx>& out, const Settings& settings) noexcept {
  using S = Dual<1>;
  constexpr int iterations = 30;
  Status status = solve(out.model, out.q, out.load, ws, out.solution, settings);
  const Vec3 known = out.load.force;
  const auto effects = out.model.effects().template seeded<S, typename Fx::OnTip>(Constant<S>{});
  Vec3 push, added = Vec3::Zero(), change = Vec3::Zero();
  Mat3 slope;
  const auto look = [&] {
    std::array<S, 3> at, f{0.0, 0.0, 0.0};
    for (int i = 0; i < 3; ++i) {
      at[std::size_t(i)] = out.solution.position[i];
      at[std::size_t(i)].d[0] = unit_lane(i);
    }
    effects.environment(at, f);
    for (int i = 0; i < 3; ++i) {
      push[i] = f[std::size_t(i)].v;
      for (int j = 0; j < 3; ++j) slope(i, j) = f[std::size_t(i)].d[0][std::size_t(j)];
    }
  };
  look();
  if (push.isZero(0.0)) return status;
  for (int k = 0; k < iterations && has_equilibrium(status); ++k) {
    status = solve<Derivatives::compliance>(out.model, out.q, out.load, ws, out.solution, settings);
    look();
    if (push.isZero(0.0)) {  // pushed out: the solution lies between
      change *= 0.5;
      added -= change;
    } else {
      const Mat3 C = out.solution.compliance.template topLeftCorner<3, 3>();
      change = (Mat3::Identity() - slope * C).partialPivLu().solve(push - added);
      if (change.norm() < settings.tolerance) return status;
      added += change;
    }
    out.load.force = known + added;
  }
  if (has_equilibrium(status)) status = Status::not_converged;
  return out.solution.status = status;
}

}  // namespace detail

/// What the tracker will read in a row.
/// @param memory  of this row, as histories() gives it
/// @return as solve(), not_finite where a parameter of an effect is not a number, not_converged where the tip and its
///         surroundings find no balance. Real time: yes.
template <int N, class Fx>
  requires(!Fx::none)
CTCR_NOINLINE Status predict(const System<N, Fx>& system, const RecordedRow<N>& row,
                             const typename Fx::template On<N>::History& memory, Workspace<N>& ws,
                             RecordedPrediction<N, Fx>& out) noexcept {
  auto effects = system.model.effects();
  effects.set_history(memory);
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
      frame_of<double>(system.sensor.T_tracker_base * out.solution.tube_tips[std::size_t(system.sensor.tube)]);
  effects.sense(row.at, reading);
  out.reading = mounted(system.sensor, pose_of(reading));
  if (!(effects.finite() && out.reading.position.allFinite() && out.reading.rotation.allFinite())) {
    out.solution = Solution<N>{};
    out.solution.status = Status::not_finite;
    out.reading = Pose{};
    ws.reset();
  }
  return out.solution.status;
}

/// As above without effects, by the faster way of predict.hpp.
template <int N, class Fx>
  requires(Fx::none)
Status predict(const System<N, Fx>& system, const RecordedRow<N>& row, const typename Fx::template On<N>::History&,
               Workspace<N>& ws, RecordedPrediction<N, Fx>& out) noexcept {
  out.load = row.load;
  return predict(system, row.theta, row.load, ws, out);
}

}  // namespace ctcr
