#pragma once
// Newton's method on the shooting problem, and its real-time form within a budget of evaluations.
#include <algorithm>

#include "ctcr/mechanics/defined_outputs.hpp"
#include "ctcr/mechanics/integration_error.hpp"
#include "ctcr/mechanics/solution.hpp"
#include "ctcr/mechanics/stability.hpp"

namespace ctcr {
namespace detail {

/// The largest step that Newton's method may take at once [rad].
inline constexpr double step_limit = 1.0;
/// det B_u below which an equilibrium counts as about to snap. What comes after it has its stability examined anew: where
/// a robot buckles to all sides alike, two conjugate points come at once, and det B_u only touches 0.
inline constexpr double singular_det = 1e-2;
/// Evaluations after which an attempt is given up: where Newton's method converges at all, it does so within them. More
/// patience finds no more equilibria of random robots, but leaves less to other starts.
inline constexpr int patience = 25, patience_in_ramp = 8, patience_of_ramp = 100, patience_if_scattered = 12;
/// Starts from anywhere before a solve is given up.
inline constexpr int scattered_starts = 30;
/// Evaluations kept for the end of a solve: the best guess once more, and the checks of what was found.
inline constexpr int reserve = 6;
/// Lever at which turns count as errors of the tip position, as a part of the robot's length.
inline constexpr double lever = 0.3;
/// Part of det B_u up to which a Newton step may be the last of a control step [rad]. Ref: Kantorovich's theorem: Newton's
/// method converges where that ratio is small against the curvature of the residual, which is of the order of 1.
inline constexpr double last_step = 0.01;
/// Part of det B_u up to which an equilibrium may lie beside its prediction and still be on the same branch [rad].
inline constexpr double same_branch = 0.1;
/// Way of the robot up to which it keeps the estimated error of integration, and in one solve its stability [rad].
inline constexpr double checked_range = 0.05;

template <int N>
inline TipGuess<N> straight_guess(const Joints<N>& q) noexcept {
  TipGuess<N> guess;
  guess.rotation = rotation_z(q.alpha[0]);
  for (int i = 1; i < N; ++i) guess.psi[i] = q.alpha[i] - q.alpha[0];
  return guess;
}

/// Start number k >= 1 of a sequence that fills the turns of the tip and the angles at the tubes' tips evenly.
template <int N>
inline TipGuess<N> scattered_guess(const Joints<N>& q, int k) noexcept {
  constexpr double turn = 6.28318530717958647692;
  const auto part = [k](int prime) { return std::remainder(k * std::sqrt(prime), 1.0); };  // from -0.5 to 0.5
  TipGuess<N> guess = straight_guess(q);
  guess.rotation = rotation_matrix(Vec3(part(3), part(7), part(11)) * 5.0) * guess.rotation;
  for (int i = 1; i < N; ++i) guess.psi[i] += turn * part(i * i + 1);
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
/// @param most  evaluations allowed; 1 is taken in any case, and 1 more to return to the best guess
/// @return evaluations used; ev.residual tells whether it converged
template <Derivatives D, Loading L, class Stepper, int N, class C>
inline int newton(const C& c, const Joints<N>& q, const TipLoad& load, const Settings& settings, int most,
                  const Steps<N>& steps, TipGuess<N>& guess, Evaluation<N, L, D>& ev) noexcept {
  int used = 1;
  evaluate<D, L, Stepper>(c, q, load, guess, steps, ev);
  if constexpr (L == Loading::none) guess.rotation = ev.rotation;
  while (!(ev.residual < settings.tolerance) && used < most) {
    const double before = ev.residual;
    const VecN<N + 2> dx = newton_step<Evaluation<N, L, D>, N>(ev);
    if (!dx.allFinite()) break;
    const double size = dx.norm();
    double scale = size > step_limit ? step_limit / size : 1.0;
    TipGuess<N> next;
    bool accepted = false;
    for (int halving = 0; halving < 6 && used < most && !accepted; ++halving, scale *= 0.5) {
      next = moved<N>(guess, dx, scale);
      evaluate<D, L, Stepper>(c, q, load, next, steps, ev);
      ++used;
      accepted = ev.residual < (1.0 - 0.1 * scale) * before || ev.residual < settings.tolerance;
    }
    if (!(ev.residual < before)) {
      // Stay at the best iterate; rounding can stop the descent just above the tolerance.
      evaluate<D, L, Stepper>(c, q, load, guess, steps, ev);
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
inline int unloaded_guess(const C& c, const Joints<N>& q, const Settings& settings, int most, const Steps<N>& steps,
                          TipGuess<N>& guess) noexcept {
  if constexpr (has_effects<C>) {
    Evaluation<N, Loading::weight, Derivatives::none> ev;
    return newton<Derivatives::none, Loading::weight, Stepper>(scaled(c, 0, 1), q, TipLoad{}, settings, most, steps,
                                                               guess, ev);
  } else {
    Evaluation<N, Loading::none, Derivatives::none> ev;
    return newton<Derivatives::none, Loading::none, Stepper>(c, q, TipLoad{}, settings, most, steps, guess, ev);
  }
}

/// Brings the load, or that and the precurvature, from nothing to its full size: in steps that double where Newton's method
/// follows and shrink where it does not.
/// @param most  evaluations after which no further step is begun
template <Loading L, class Stepper, int N, class C>
inline int ramped_guess(const C& c, const Joints<N>& q, const TipLoad& load, const Settings& settings, int most,
                        const Steps<N>& steps, bool ramp_curvature, TipGuess<N>& guess) noexcept {
  Evaluation<N, L, Derivatives::none> ev;
  int used = 0;
  guess = straight_guess(q);
  if (!ramp_curvature) used += unloaded_guess<Stepper>(c, q, settings, std::min(most, patience), steps, guess);
  for (double reached = 0, step = 0.125; reached < 1 && step > 1e-3 && used < most;) {
    const double part = std::min(reached + step, 1.0);
    TipGuess<N> next = guess;
    used += newton<Derivatives::none, L, Stepper>(scaled(c, part, ramp_curvature ? part : 1), q,
                                                  TipLoad{load.force * part, load.moment * part}, settings,
                                                  std::min(most - used, patience_in_ramp), steps, next, ev);
    if (ev.residual < settings.tolerance) {
      reached = part;
      guess = next;
      step *= 2;
    } else {
      step *= 0.25;
    }
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

/// Way between two guesses: turn of the tip and of the tubes [rad].
template <int N>
inline double distance(const TipGuess<N>& a, const TipGuess<N>& b) noexcept {
  // Two frames that differ by a turn t differ by 2 sqrt(2) sin(t / 2) in the norm of their entries.
  return std::sqrt(0.5 * (a.rotation - b.rotation).squaredNorm() + (a.psi - b.psi).squaredNorm());
}

/// Whether an equilibrium lies on the branch along which it was predicted. Ref: Kantorovich's theorem: a prediction that is
/// nearer to it than a part of det B_u is in the basin of no other, as the curvature of the residual is of the order of 1.
template <int N>
inline bool lies_on_branch(const TipGuess<N>& predicted, const TipGuess<N>& found, double det) noexcept {
  return distance(predicted, found) <= same_branch * std::min(det, 1.0);
}

/// Way from the last solution to `guess` [rad]: turns of the tip and of the tubes, travel over length, and the turn that the
/// change of the load would give to tube 1 alone, as inside the robot much can bend while the tip does not turn.
template <int N, class Fx>
inline double way_of(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, const TipGuess<N>& guess,
                     const Workspace<N>& ws) noexcept {
  const double length = reach_of(model.robot(), q);
  const double bent = 5 * (load.force - ws.load.force).norm() * length + 10 * (load.moment - ws.load.moment).norm();
  return distance(ws.guess, guess) + (q.beta - ws.q.beta).norm() / length + bent * length / model.robot().tubes[0].EI();
}

/// Estimate of the error that Newton's method leaves after a correction [rad]. A correction is of second order in the change
/// before it, be that a correction too or a prediction along the tangent, so their ratio measures the curvature.
/// @param correction  norm of the change of the guess or of the residual, the larger: a load along the robot sets them apart
inline double newton_remainder(double before, double correction) noexcept {
  const double ratio = correction < before ? correction / before : 1.0;
  return correction * ratio * ratio;
}

/// Whether a scheme serves to compare (integrators.hpp): its errors are shown as they are, in the steps that it is told.
template <class Stepper>
inline constexpr bool is_for_comparison = requires { Stepper::general_equations; };

/// Whether the error of integration is estimated and kept.
template <class Stepper>
inline bool takes_more_steps(const Settings& settings) noexcept {
  return !is_for_comparison<Stepper> &&
         settings.accuracy != std::numeric_limits<double>::infinity();  // NaN is met by none
}

/// Steps in which a solve begins, or a control step integrates.
template <Loading L, class Stepper, int N, class C>
inline Steps<N> steps_of(const C& c, const VecN<N>& beta, const TipLoad& load, const Workspace<N>& ws,
                         const Settings& settings) noexcept {
  if (!takes_more_steps<Stepper>(settings)) return settings.steps;
  const int times = std::max(settings.steps, ws.steps.times), most = std::max(settings.max_steps, 1);
  if constexpr (has_effects<C>)
    return steps_for<true>(c.plain, beta, load, times, most);
  else
    return steps_for < L != Loading::none > (c, beta, load, times, most);
}

template <Derivatives D, Loading L, class Stepper, int N, class Fx>
inline Status solve_as(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws,
                       Solution<N>& out, const Settings& settings) noexcept {
  const auto& c = model.coefficients();
  const double length = reach_of(model.robot(), q), allowed = settings.accuracy * length;
  const bool refines = takes_more_steps<Stepper>(settings);
  Steps<N> steps = steps_of<L, Stepper>(c, q.beta, load, ws, settings);
  Evaluation<N, L, D> ev;
  TipGuess<N> guess;
  const auto solved = [&] { return ev.residual < settings.tolerance; };
  const auto way = [&] { return way_of(model, q, load, guess, ws); };
  // What begins with some left goes beyond it by less than the reserve; without any, a cold solve takes 4.
  const auto left = [&] { return std::max(settings.max_iterations, 0) - reserve - out.iterations; };
  bool stable = false;
  const auto attempt = [&](int most) {
    out.iterations += newton<D, L, Stepper>(c, q, load, settings, std::min(most, left()), steps, guess, ev);
    stable = solved() && ev.det > 0;
    // On its branch an equilibrium stays stable while det B_u does not vanish.
    if (!stable || is_for_comparison<Stepper> || (ws.stable && way() < checked_range)) return;
    stable = is_stable<Stepper>(c, q, load, guess, steps.doubled());
    ++out.iterations;
  };
  const auto unload = [&] {
    if constexpr (L != Loading::none)
      out.iterations += unloaded_guess<Stepper>(c, q, settings, std::min(patience, left()), steps, guess);
  };
  const auto goes_on = [&] { return !stable && left() > 0; };
  const auto search = [&](bool from_guess) {
    if (from_guess) attempt(patience);
    if (!from_guess || goes_on()) {
      guess = straight_guess(q);
      unload();
      attempt(patience);
    }
    for (const bool ramp_curvature : {false, true}) {
      if (!goes_on() || (L == Loading::none && !ramp_curvature)) continue;
      out.iterations += ramped_guess<L, Stepper>(c, q, load, settings, std::min(patience_of_ramp, left()), steps,
                                                 ramp_curvature, guess);
      attempt(patience);
    }
    if (!goes_on()) return;
    // A fold, or an unstable equilibrium: those that are stable lie to its sides.
    const TipGuess<N> found = guess;
    for (int k = 1; k <= scattered_starts && goes_on(); ++k) {
      guess = scattered_guess(q, k);
      if (N > 1 && k % 2 == 1) unload();
      attempt(patience_if_scattered);
    }
    if (!stable) {
      guess = found;
      attempt(1);
    }
  };
  if (ws.warm) guess = predicted_guess(ws, q, load);
  const TipGuess<N> predicted = guess;
  search(ws.warm);
  double error = std::numeric_limits<double>::infinity(), moved = 0;
  if (refines && stable) {
    const int most = settings.max_steps / steps.largest_share();
    moved = ws.moved + way();
    if (steps == ws.steps && ws.integration_error <= allowed && moved < checked_range)
      error = ws.integration_error;
    else
      moved = 0;
    while (!(error <= allowed) && stable) {
      error = integration_error<L, Stepper>(c, q, load, guess, steps, {ev.rotation, ev.position}, lever * length);
      ++out.iterations;
      if (error <= allowed || steps.times >= most || left() <= 0) break;
      steps.times = refined(steps.times, error, allowed, most);
      search(true);
    }
  }
  publish(ev, q, load, guess, guess, ws, out);
  out.kept_branch = ws.stable && stable && lies_on_branch(predicted, guess, ev.det);
  ws.steps = steps;
  ws.moved = moved;
  ws.stable = stable && ev.det >= singular_det;
  out.integration_error = ws.integration_error = error;
  if (!solved()) {
    ws.reset();
    return Status::not_converged;
  }
  if (!stable) return Status::unstable;
  if (ev.det < singular_det) return Status::singular;
  return refines && !(error <= allowed) ? Status::inaccurate : Status::ok;
}

template <Derivatives D, Loading L, class Stepper, int N, class Fx>
inline Status step_as(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws,
                      Solution<N>& out, const Settings& settings) noexcept {
  using Ev = Evaluation<N, L, D>;
  constexpr bool jacobian = Ev::Col::jacobian;
  if (!ws.warm || !ws.stable) return Status::needs_solve;
  const auto& c = model.coefficients();
  const Steps<N> steps = steps_of<L, Stepper>(c, q.beta, load, ws, settings);
  Ev ev;
  const TipGuess<N> predicted = predicted_guess(ws, q, load);
  TipGuess<N> guess, next = predicted;
  double before = ws.knows_joints ? distance(ws.guess, predicted) : 0;
  for (bool last = false; !last;) {
    if (out.iterations >= settings.evaluations) return Status::needs_solve;
    guess = next;
    evaluate<D, L, Stepper>(c, q, load, guess, steps, ev);
    ++out.iterations;
    const VecN<N + 2> dx = newton_step<Ev, N>(ev);
    next = moved<N>(guess, dx, 1.0);
    if constexpr (L == Loading::none) next.rotation = ev.rotation;
    const double size = dx.norm();
    last = size < (jacobian ? last_step : last_step * last_step) * std::min(ev.det, 1.0) &&
           newton_remainder(before, std::max(size, ev.residual)) <= settings.accuracy;
    before = size;
  }
  // The pose at the end of the Newton step: the tangent is known, so it costs nothing.
  Pose tip{ev.rotation, ev.position};
  if constexpr (Ev::Col::turns == 3) {
    tip.rotation = next.rotation;
  } else if constexpr (jacobian) {
    const Vec3 turn(ev.pose(3, Ev::Col::newton), ev.pose(4, Ev::Col::newton), ev.pose(5, Ev::Col::newton));
    tip.rotation = rotation_matrix(turn) * ev.rotation;
  }
  if constexpr (jacobian)
    for (int k = 0; k < 3; ++k) tip.position[k] += ev.pose(k, Ev::Col::newton);

  double error = ws.integration_error, way = 0;
  if (takes_more_steps<Stepper>(settings)) {
    const double length = reach_of(model.robot(), q), allowed = settings.accuracy * length;
    way = ws.moved + way_of(model, q, load, next, ws);
    if (!(error <= allowed && way < checked_range && steps == ws.steps)) {
      if (!jacobian || out.iterations >= settings.evaluations) return Status::needs_solve;
      error = integration_error<L, Stepper>(c, q, load, next, steps, tip, lever * length);
      ++out.iterations;
      if (!(error <= allowed)) return Status::needs_solve;
      way = 0;
    }
  }
  publish(ev, q, load, guess, next, ws, out);
  out.position = tip.position;
  out.rotation = tip.rotation;
  out.tube_tips[0] = tip;
  out.kept_branch = lies_on_branch(predicted, next, ev.det);
  out.integration_error = ws.integration_error = error;
  ws.steps = steps;
  ws.moved = way;
  ws.stable = ev.det >= singular_det;
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
  // The equations of a force alone need its direction, which one has whose square does not underflow.
  const bool pulls = !load.force.isZero(0.0),
             has_direction = load.force.squaredNorm() >= std::numeric_limits<double>::min();
  if constexpr (!Fx::none || is_for_comparison<Stepper>)
    out.status = run(std::integral_constant<Loading, weight>{});
  else if (!model.coefficients().gravity.isZero(0.0) || !load.moment.isZero(0.0) ||
           ((D == Derivatives::compliance || pulls) && !has_direction))
    out.status = run(std::integral_constant<Loading, weight>{});
  else if (D == Derivatives::compliance || pulls)
    out.status = run(std::integral_constant<Loading, force>{});
  else if constexpr (D != Derivatives::compliance)
    out.status = run(std::integral_constant<Loading, none>{});
  if (out.status == Status::needs_solve) return blank(out.status, out);
  constexpr double any = std::numeric_limits<double>::infinity();
  // Effects may displace a robot in equilibrium, as a compliant front plate does.
  const bool bounded = !is_for_comparison<Stepper> && (Fx::none || !has_equilibrium(out.status));
  const double reach = bounded ? reach_of(model.robot(), q) : any;
  if (!are_defined<D>(out, reach)) [[unlikely]]
    out.status = define(out, reach, is_for_comparison<Stepper> ? any : no_rotation, ws);
  return out.status;
}

}  // namespace detail

/// Solves the kinetostatic model.
/// @param q     joints: beta [m], alpha [rad]
/// @param load  tip wrench in the base frame [N], [N m]
/// @param ws    warm start of this thread; updated
/// @param out   pose, and with D the Jacobian J (6 x 2N) and the compliance C (6 x 6); always defined
/// @return ok: an equilibrium, stable, to the asked accuracy; invalid_robot, joints_out_of_order, tip_behind_plate: input
///         refused, nothing computed; not_finite: the same, or a result that is no number; not_converged: best iterate;
///         singular: solved, but about to snap; unstable: only an unstable equilibrium was found; inaccurate: solved, but
///         max_steps or max_iterations leave a larger error of integration than `settings.accuracy` asks for
/// Real time: yes; at most settings.max_iterations evaluations (4 where that is less), 1 to 3 from a warm start, and one
/// more where the robot has moved by more than 0.05 rad since its integration error was last estimated.
/// Ref: Boyer et al., eqs. (1)-(3); Rucker & Webster 2011 for J and C.
template <Derivatives D = Derivatives::none, class Stepper = MagnusRk4, int N, class Fx>
CTCR_NOINLINE Status solve(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws,
                           Solution<N>& out, const Settings& settings = {}) noexcept {
  return detail::dispatch<D, Stepper>(model, q, load, ws, out, [&](auto loading) noexcept {
    return detail::solve_as<D, decltype(loading)::value, Stepper>(model, q, load, ws, out, settings);
  });
}

/// The control step: Newton's method from the warm start predicted to the new joints, in at most `settings.evaluations`
/// evaluations; one is usual. The last Newton step is at most 0.01 det B_u [rad], so the residual is of the order of its
/// square. Ask for the Jacobian to have the prediction and the corrected pose (without it, the last Newton step is at most
/// 1e-4 det B_u); J, C and the tips of the outer tubes are those before that step. Where the robot has moved by more than
/// 0.05 rad since the integration error was last estimated, one of the evaluations, in twice as many steps, estimates it.
/// out.residual is that before the last Newton step.
/// @return as solve(); needs_solve: no warm start, joints or load moved too far, the robot snaps within this step, or it
///         needs more integration steps; `ws` is as before and `out` is blank: ask solve()
/// Real time: yes, settings.evaluations evaluations at most.
template <Derivatives D = Derivatives::jacobian, class Stepper = MagnusRk4, int N, class Fx>
CTCR_NOINLINE Status step(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws,
                          Solution<N>& out, const Settings& settings = {}) noexcept {
  return detail::dispatch<D, Stepper>(model, q, load, ws, out, [&](auto loading) noexcept {
    return detail::step_as<D, decltype(loading)::value, Stepper>(model, q, load, ws, out, settings);
  });
}

}  // namespace ctcr

#if defined(CTCR_SOLVER_1) || defined(CTCR_SOLVER_2) || defined(CTCR_SOLVER_3) || defined(CTCR_SOLVER_4)
#include "ctcr/mechanics/solver_instances.hpp"
#endif
