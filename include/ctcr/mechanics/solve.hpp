#pragma once
// Newton's method on the shooting problem, and its real-time form: one evaluation per control period.
#include <algorithm>

#include "ctcr/mechanics/defined_outputs.hpp"
#include "ctcr/mechanics/effect_evaluation.hpp"
#include "ctcr/mechanics/solution.hpp"

namespace ctcr {
namespace detail {

/// The largest step that Newton's method may take at once [rad].
inline constexpr double step_limit = 1.0;
/// det B_u below which an equilibrium counts as about to snap.
inline constexpr double singular_det = 1e-2;
/// Starts from anywhere before a solve is given up.
inline constexpr int scattered_starts = 16;
/// ||b|| up to which the pose after one evaluation is good to about ||b||^2 [rad].
inline constexpr double one_step_residual = 0.05;
/// Newton step up to which that holds: a longer one from so small a residual comes near a fold [rad].
inline constexpr double one_step_change = 0.1;

template <int N>
inline TipGuess<N> straight_guess(const Joints<N>& q) noexcept {
  TipGuess<N> guess;
  guess.rotation = rotation_z(q.alpha[0]);
  for (int i = 1; i < N; ++i) guess.psi[i] = q.alpha[i] - q.alpha[0];
  return guess;
}

/// Start number k >= 1 of a sequence that fills the angles at the tubes' tips evenly.
template <int N>
inline TipGuess<N> scattered_guess(const Joints<N>& q, int k) noexcept {
  constexpr double turn = 6.28318530717958647692;
  TipGuess<N> guess = straight_guess(q);
  for (int i = 1; i < N; ++i) guess.psi[i] += turn * std::remainder(k * std::sqrt(i * i + 1.0), 1.0);
  return guess;
}

/// guess + scale * dx.
template <int N, class Change>
inline TipGuess<N> moved(const TipGuess<N>& guess, const Change& dx, double scale) noexcept {
  TipGuess<N> r;
  const Vec3 turn = scale * Vec3(dx[0], dx[1], dx[2]);
  r.rotation = rotation_matrix(turn) * guess.rotation;
  r.psi = guess.psi;
  for (int i = 1; i < N; ++i) r.psi[i] += scale * dx[2 + i];
  return r;
}

/// Newton step of an evaluation, as turn of the tip and change of psi_2..N.
template <class Ev, int N>
inline VecN<N + 2> newton_step(const Ev& ev) noexcept {
  VecN<N + 2> dx = VecN<N + 2>::Zero();
  using Col = typename Ev::Col;
  for (int j = 0; j < Col::turns; ++j) dx.template head<3>() += ev.unknown(j, Col::newton) * ev.axis[j];
  for (int j = 1; j < N; ++j) dx[2 + j] = ev.unknown(Col::turns + j - 1, Col::newton);
  return dx;
}

/// Damped Newton iteration from `guess`. On return `ev` belongs to `guess`.
/// @return evaluations used; ev.residual tells whether it converged
template <Derivatives D, Loading L, class Stepper, int N, class C>
inline int newton(const C& c, const Joints<N>& q, const TipLoad& load, const Settings& settings, TipGuess<N>& guess,
                  Evaluation<N, L, D>& ev) noexcept {
  int used = 1;
  evaluate<D, L, Stepper>(c, q, load, guess, settings.steps, ev);
  if constexpr (L == Loading::none) guess.rotation = ev.rotation;
  while (!(ev.residual < settings.tolerance) && used < settings.max_iterations) {
    const double before = ev.residual;
    const VecN<N + 2> dx = newton_step<Evaluation<N, L, D>, N>(ev);
    if (!dx.allFinite()) break;
    const double size = dx.norm();
    double scale = size > step_limit ? step_limit / size : 1.0;
    TipGuess<N> next;
    bool accepted = false;
    for (int halving = 0; halving < 6 && used < settings.max_iterations && !accepted; ++halving, scale *= 0.5) {
      next = moved<N>(guess, dx, scale);
      evaluate<D, L, Stepper>(c, q, load, next, settings.steps, ev);
      ++used;
      accepted = ev.residual < (1.0 - 0.1 * scale) * before || ev.residual < settings.tolerance;
    }
    if (!(ev.residual < before)) {
      // Stay at the best iterate; rounding can stop the descent just above the tolerance.
      evaluate<D, L, Stepper>(c, q, load, guess, settings.steps, ev);
      return used + 1;
    }
    guess = next;
    if constexpr (L == Loading::none) guess.rotation = ev.rotation;
  }
  return used;
}

/// Coefficients of the same robot with a part of its weight and of its precurvature.
template <int N>
inline Coefficients<N> scaled(Coefficients<N> c, double weight, double curvature) noexcept {
  c.gravity *= weight;
  for (std::size_t i = 0; i < N; ++i) c.a[i] *= curvature, c.rho[i] *= curvature;
  return c;
}
template <int N, class Fx>
inline EffectCoefficients<N, Fx> scaled(EffectCoefficients<N, Fx> c, double weight, double curvature) noexcept {
  c.plain = scaled(c.plain, weight, curvature);
  c.gravity *= weight;
  for (auto& tube : c.tubes) tube.kappa *= curvature;
  return c;
}

/// Unloaded equilibrium from the angles of `guess`; the tip frame follows without iteration.
template <class Stepper, int N, class C>
inline int unloaded_guess(const C& c, const Joints<N>& q, const Settings& settings, TipGuess<N>& guess) noexcept {
  if constexpr (has_effects<C>) {
    Evaluation<N, Loading::weight, Derivatives::none> ev;
    return newton<Derivatives::none, Loading::weight, Stepper>(scaled(c, 0, 1), q, TipLoad{}, settings, guess, ev);
  } else {
    Evaluation<N, Loading::none, Derivatives::none> ev;
    return newton<Derivatives::none, Loading::none, Stepper>(c, q, TipLoad{}, settings, guess, ev);
  }
}

/// Brings the load, or if that fails the precurvature, from nothing to its full size in small steps.
template <Loading L, class Stepper, int N, class C>
inline int ramped_guess(const C& c, const Joints<N>& q, const TipLoad& load, const Settings& settings,
                        bool ramp_curvature, TipGuess<N>& guess) noexcept {
  constexpr int ramp_steps = 16;
  Evaluation<N, L, Derivatives::none> ev;
  int used = 0;
  guess = straight_guess(q);
  if (!ramp_curvature) used += unloaded_guess<Stepper>(c, q, settings, guess);
  for (int k = 1; k <= ramp_steps; ++k) {
    const double part = double(k) / ramp_steps;
    used += newton<Derivatives::none, L, Stepper>(scaled(c, part, ramp_curvature ? part : 1), q,
                                                  TipLoad{load.force * part, load.moment * part}, settings, guess, ev);
  }
  return used;
}

/// Copies an evaluation into the solution and the warm start.
/// @param previous  the guess that was evaluated   @param guess  the guess to go on from
template <class Ev, int N>
inline void publish(const Ev& ev, const Joints<N>& q, const TipLoad& load, const TipGuess<N>& previous,
                    const TipGuess<N>& guess, Workspace<N>& ws, Solution<N>& out) noexcept {
  using Col = typename Ev::Col;
  out.residual = ev.residual;
  out.stability = ev.det;
  out.position = ev.position;
  out.rotation = ev.rotation;
  out.tube_tips[0] = {ev.rotation, ev.position};
  std::array<double, N - 1> sines, cosines;
  sincos(ev.tips.psi, sines, cosines);
  for (std::size_t i = 1; i < N; ++i) {
    const Frame<double>& f = ev.tips.frame[i - 1];
    const double sine = sines[i - 1], cosine = cosines[i - 1];
    const Vec3 x(f.x[0], f.x[1], f.x[2]), y(f.y[0], f.y[1], f.y[2]), z(f.z[0], f.z[1], f.z[2]);
    Pose& tip = out.tube_tips[i];
    tip.position = ev.rotation * f.position() + ev.position;
    tip.rotation.col(0) = ev.rotation * (cosine * x + sine * y);
    tip.rotation.col(1) = ev.rotation * (cosine * y - sine * x);
    tip.rotation.col(2) = ev.rotation * z;
  }
  ws.guess = guess;
  ws.q = q;
  ws.load = load;
  ws.warm = true;
  ws.knows_joints = Col::jacobian;
  ws.knows_load = Col::compliance;
  if constexpr (Col::jacobian) {
    const auto by_joints = [](auto&& entry) {
      Eigen::Matrix<double, 1, 2 * N> row;
      for (int j = 0; j < N; ++j) row[N + j] = entry(Col::alpha + j);
      double first = entry(Col::common);
      for (int j = 1; j < N; ++j) {
        row[j] = entry(Col::beta + j - 1);
        first -= row[j];
      }
      row[0] = first;
      return row;
    };
    for (int k = 0; k < 6; ++k) {
      const auto entry = [&](int lane) { return ev.pose(k, lane); };
      const auto row = by_joints(entry);
      out.jacobian.row(k) = row;
      if (k >= 3) ws.sensitivity.row(k - 3).template head<2 * N>() = row;
      if constexpr (Col::compliance)
        for (int j = 0; j < 6; ++j) {
          out.compliance(k, j) = entry(Col::force + j);
          if (k >= 3) ws.sensitivity(k - 3, 2 * N + j) = out.compliance(k, j);
        }
    }
    for (int i = 3; i < N + 2; ++i) {
      const auto entry = [&](int lane) { return ev.unknown(Col::turns + i - 3, lane); };
      ws.sensitivity.row(i).template head<2 * N>() = by_joints(entry);
      if constexpr (Col::compliance)
        for (int j = 0; j < 6; ++j) ws.sensitivity(i, 2 * N + j) = entry(Col::force + j);
    }
    if constexpr (Col::compliance && Col::turns == 2) {
      // Loads were varied along the base axes as the guessed tip frame sees them; it may be turned about the force.
      const Mat3 found_axes = (ev.rotation * previous.rotation.transpose()).transpose();
      for (const int first : {0, 3}) {
        auto block = out.compliance.template middleCols<3>(first);
        block = (block * found_axes).eval();
        auto change = ws.sensitivity.template middleCols<3>(2 * N + first);
        change = (change * found_axes).eval();
      }
    }
  }
}

/// The last solution moved to the new joints and load along its tangent.
template <int N>
inline TipGuess<N> predicted_guess(const Workspace<N>& ws, const Joints<N>& q, const TipLoad& load) noexcept {
  if (!ws.knows_joints && !ws.knows_load) return ws.guess;
  VecN<N + 2> dx = VecN<N + 2>::Zero();
  if (ws.knows_joints)
    dx += ws.sensitivity.template leftCols<N>() * (q.beta - ws.q.beta) +
          ws.sensitivity.template middleCols<N>(N) * (q.alpha - ws.q.alpha);
  if (ws.knows_load)
    dx += ws.sensitivity.template middleCols<3>(2 * N) * (load.force - ws.load.force) +
          ws.sensitivity.template rightCols<3>() * (load.moment - ws.load.moment);
  const double size = dx.norm();
  return size < step_limit ? moved<N>(ws.guess, dx, 1.0) : ws.guess;
}

template <Derivatives D, Loading L, class Stepper, int N, class Fx>
inline Status solve_as(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws,
                       Solution<N>& out, const Settings& settings) noexcept {
  const auto& c = model.coefficients();
  Evaluation<N, L, D> ev;
  TipGuess<N> guess;
  const auto converged = [&] { return ev.residual < settings.tolerance && ev.det > 0; };
  const auto attempt = [&] { out.iterations += newton<D, L, Stepper>(c, q, load, settings, guess, ev); };
  const auto attempt_from = [&](const TipGuess<N>& start) {
    guess = start;
    if constexpr (L != Loading::none) out.iterations += unloaded_guess<Stepper>(c, q, settings, guess);
    attempt();
  };
  const bool warm = ws.warm;
  if (warm) {
    guess = predicted_guess(ws, q, load);
    attempt();
  }
  if (!warm || !converged()) attempt_from(straight_guess(q));
  for (const bool ramp_curvature : {false, true}) {
    if (converged() || (L == Loading::none && !ramp_curvature)) continue;
    out.iterations += ramped_guess<L, Stepper>(c, q, load, settings, ramp_curvature, guess);
    attempt();
  }
  if (N > 1 && !converged()) {
    // A fold, or an unstable equilibrium: those that are stable lie to its sides.
    const TipGuess<N> found = guess;
    for (int k = 1; k <= scattered_starts && !converged(); ++k) attempt_from(scattered_guess(q, k));
    if (!converged()) {
      guess = found;
      attempt();
    }
  }
  publish(ev, q, load, guess, guess, ws, out);
  const bool finite = std::isfinite(ev.residual) && std::isfinite(ev.det) && ev.position.allFinite() &&
                      out.jacobian.allFinite() && out.compliance.allFinite();
  if (!finite) {
    const int iterations = out.iterations;
    out = Solution<N>{};
    out.iterations = iterations;
    ws.reset();
    return Status::not_finite;
  }
  if (!(ev.residual < settings.tolerance)) {
    ws.reset();
    return std::abs(ev.det) < singular_det ? Status::singular : Status::not_converged;
  }
  return ev.det < singular_det ? Status::singular : Status::ok;
}

template <Derivatives D, Loading L, class Stepper, int N, class Fx>
inline Status step_as(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws,
                      Solution<N>& out, const Settings& settings) noexcept {
  if (!ws.warm) return solve_as<D, L, Stepper>(model, q, load, ws, out, settings);
  using Ev = Evaluation<N, L, D>;
  Ev ev;
  const TipGuess<N> guess = predicted_guess(ws, q, load);
  evaluate<D, L, Stepper>(model.coefficients(), q, load, guess, settings.steps, ev);
  out.iterations = 1;
  const VecN<N + 2> dx = newton_step<Ev, N>(ev);
  if (!(ev.residual < one_step_residual && dx.squaredNorm() < one_step_change * one_step_change))
    return solve_as<D, L, Stepper>(model, q, load, ws, out, settings);
  TipGuess<N> next = moved<N>(guess, dx, 1.0);
  if constexpr (L == Loading::none) next.rotation = ev.rotation;
  publish(ev, q, load, guess, next, ws, out);
  // The pose at the end of the Newton step: the tangent is known, so it costs nothing.
  if constexpr (Ev::Col::turns == 3) {
    out.rotation = next.rotation;
  } else if constexpr (Ev::Col::jacobian) {
    const Vec3 turn(ev.pose(3, Ev::Col::newton), ev.pose(4, Ev::Col::newton), ev.pose(5, Ev::Col::newton));
    out.rotation = rotation_matrix(turn) * ev.rotation;
  }
  if constexpr (Ev::Col::jacobian)
    for (int k = 0; k < 3; ++k) out.position[k] += ev.pose(k, Ev::Col::newton);
  out.tube_tips[0] = {out.rotation, out.position};
  return ev.det < singular_det ? Status::singular : Status::ok;
}

/// Chooses the cheapest equations that hold, answers invalid input and sees to it that all outputs are defined.
/// @param run  run(std::integral_constant<Loading, ..>) -> Status
template <Derivatives D, class Stepper, int N, class Fx, class Run>
inline Status dispatch(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws,
                       Solution<N>& out, const Run& run) noexcept {
  out.iterations = 0;
  out.status = model.check();
  if (out.status == Status::ok) out.status = check_joints(model.robot(), q);
  if (out.status == Status::ok && !all_finite(load.force, load.moment)) out.status = Status::not_finite;
  if (out.status != Status::ok) return blank(out.status, out);
  using enum Loading;
  if constexpr (!Fx::none || requires { Stepper::general_equations; })
    out.status = run(std::integral_constant<Loading, weight>{});
  else if (!model.coefficients().gravity.isZero(0.0) || !load.moment.isZero(0.0) ||
           (D == Derivatives::compliance && load.force.isZero(0.0)))
    out.status = run(std::integral_constant<Loading, weight>{});
  else if (D == Derivatives::compliance || !load.force.isZero(0.0))
    out.status = run(std::integral_constant<Loading, force>{});
  else if constexpr (D != Derivatives::compliance)
    out.status = run(std::integral_constant<Loading, none>{});
  const double reach = Fx::none ? reach_of(model.robot(), q) : std::numeric_limits<double>::infinity();
  if (!are_defined<D>(out, reach)) [[unlikely]]
    out.status = define(out, reach, ws);
  return out.status;
}

}  // namespace detail

/// Solves the kinetostatic model.
/// @param q     joints: beta [m], alpha [rad]
/// @param load  tip wrench in the base frame [N], [N m]
/// @param ws    warm start of this thread; updated
/// @param out   pose, and with D the Jacobian J (6 x 2N) and the compliance C (6 x 6); always defined
/// @return ok; invalid_robot, joints_out_of_order, tip_behind_plate: input refused, nothing computed; not_finite: the same,
///         or a result that is no number; not_converged: best iterate; singular: solved, but at a bifurcation or an
///         unstable equilibrium
/// Real time: yes; at most about 70 * max_iterations evaluations, 1 to 3 from a warm start.
/// Ref: Boyer et al., eqs. (1)-(3); Rucker & Webster 2011 for J and C.
template <Derivatives D = Derivatives::none, class Stepper = MagnusRk4, int N, class Fx>
CTCR_NOINLINE Status solve(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws,
                           Solution<N>& out, const Settings& settings = {}) noexcept {
  return detail::dispatch<D, Stepper>(model, q, load, ws, out, [&](auto loading) noexcept {
    return detail::solve_as<D, decltype(loading)::value, Stepper>(model, q, load, ws, out, settings);
  });
}

/// One evaluation from the warm start predicted to the new joints: the control step. Falls back to solve() when there is
/// no warm start, the joints moved too far (||b|| > 0.05 rad) or the robot is about to snap (Newton step > 0.1 rad).
/// out.residual is that before the final correction, whose square bounds the error. Ask for the Jacobian to have the
/// prediction and the corrected pose; tips of the outer tubes are those before the correction.
/// Real time: yes, one evaluation.
template <Derivatives D = Derivatives::jacobian, class Stepper = MagnusRk4, int N, class Fx>
CTCR_NOINLINE Status step(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws,
                          Solution<N>& out, const Settings& settings = {}) noexcept {
  return detail::dispatch<D, Stepper>(model, q, load, ws, out, [&](auto loading) noexcept {
    return detail::step_as<D, decltype(loading)::value, Stepper>(model, q, load, ws, out, settings);
  });
}

}  // namespace ctcr
