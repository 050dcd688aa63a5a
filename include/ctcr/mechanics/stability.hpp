#pragma once
// Whether an equilibrium is elastically stable, and how far the robot is from snapping to another one.
//
// The determinant of the shooting Jacobian can be taken with the base placed anywhere: what is beyond that place is
// then the robot. An equilibrium is stable if and only if no such place has a vanishing determinant (a conjugate
// point); it starts at 1 at the tip. Ref: Ha, Park & Dupont 2016, "Elastic stability of concentric tube robots subject
// to external loads"; Riojas, Hendrick & Webster 2018.
#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <numbers>

#include "ctcr/mechanics/solve.hpp"

namespace ctcr {

/// Where the robot comes closest to a conjugate point.
struct WeakestPlace {
  double determinant = 1;  ///< smallest along the robot; > 0: stable (two modes that buckle at once only touch zero)
  double s = 0;            ///< arc length from the front plate [m]; < 0 in the transmission
};

/// The nearest snap that turning the base of one tube causes.
struct SnapMargin {
  double angle = std::numeric_limits<double>::infinity();  ///< turn of that tube, signed [rad]; infinite: never
  int tube = -1;                                           ///< index from 0, >= 1: relative to the innermost tube
};

namespace detail {

/// The shooting problem with its Jacobian written out.
template <Loading L, int N>
class BaseProblem {
  using Col = Columns<N, L, Derivatives::none>;
  using S = Dual<Col::groups>;
  using Pass = Shooting<N, S, double, double, Col::loaded, Col::weight, DirectMagnusRk4, Col>;
  static constexpr int steps_ = 8;

public:
  static constexpr int turns = Col::turns, unknowns = Col::unknowns;
  static_assert(turns == 0 || turns == 3);
  using Jacobian = Eigen::Matrix<double, unknowns, unknowns>;
  using Unknowns = Eigen::Matrix<double, unknowns, 1>;

  BaseProblem(const Model<N>& model, const Joints<N>& q, const TipLoad& load, int steps) noexcept
    : c_(model.coefficients()), q_(q), load_(load), steps_per_segment_(std::max(steps, steps_)) {}

  /// Integrates from `guess`: B_u and residual at the base.
  /// @param watch  watch(s, determinant with the base at s), from the tip to the plate
  template <class Watch = NoRecord>
  void integrate(const TipGuess<N>& guess, const Watch& watch = {}) noexcept {
    Vec3 axis[3];
    turn_axes<L>(load_, axis);
    y_ = tip_state<Col, S>(c_, load_, guess, axis);
    TubeTips<N> tips;
    Frame<S> frame{};
    const auto arc_length = [](int, double s) noexcept { return s; };
    const auto record = [&](double s, const SegmentTubes<N>&, const RobotState<S, N>& y, const Frame<S>& f,
                            const std::array<double, 2>&) noexcept {
      if constexpr (!std::is_same_v<Watch, NoRecord>)
        watch(s, jacobian(y, f, guess.rotation * f.rotation(), VecN<N>::Zero()).determinant());
    };
    Pass::run(c_, sort_events(c_, q_.beta), arc_length, steps_per_segment_, y_, frame, tips, record);
    frame_ = frame;
    VecN<N> angle;
    for (int i = 0; i < N; ++i) angle[i] = y_.psi[std::size_t(i)].v + q_.beta[i] * y_.w[std::size_t(i)].v;
    rotation = rotation_z(q_.alpha[0] - angle[0]) * frame.rotation().transpose();
    if constexpr (turns > 0) residual.template head<turns>() = -rotation_vector(rotation * guess.rotation.transpose());
    for (int i = 1; i < N; ++i) residual[turns + i - 1] = angle[i] - angle[0] - (q_.alpha[i] - q_.alpha[0]);
    B = jacobian_behind_plate(q_.beta[0]);
  }

  /// With the base at s <= 0: every tube is held there, or where it is grasped before that.
  [[nodiscard]] Jacobian jacobian_behind_plate(double s) const noexcept {
    return jacobian(y_, frame_, rotation * frame_.rotation(), q_.beta.cwiseMax(s));
  }

  Mat3 rotation;      ///< R_base_tip found
  Jacobian B;         ///< by turns of the tip (base axes), psi_2..N
  Unknowns residual;  ///< minus the turn to the found tip frame, angle errors [rad]

private:
  static Jacobian jacobian(const RobotState<S, N>& y, const Frame<S>& f, const Mat3& R_base_here,
                           const VecN<N>& held) noexcept {
    Jacobian M;
    for (int u = 0; u < unknowns; ++u) {
      const int lane = Col::unknown(u);
      const auto part = [lane](const Lanes* d) { return d[lane / lane_count][lane % lane_count]; };
      const auto angle = [&](int i) { return part(y.psi[std::size_t(i)].d) + held[i] * part(y.w[std::size_t(i)].d); };
      if constexpr (turns > 0) {
        const Vec3 twist(part(f.rotation_twist[0]), part(f.rotation_twist[1]), part(f.rotation_twist[2]) + angle(0));
        M.col(u).template head<turns>() = R_base_here * twist;
        if (u < turns) M(u, u) += 1;
      }
      for (int i = 1; i < N; ++i) M(turns + i - 1, u) = angle(i) - angle(0);
    }
    return M;
  }

  const Coefficients<N>& c_;
  const Joints<N>& q_;
  const TipLoad& load_;
  int steps_per_segment_;
  RobotState<S, N> y_;
  Frame<S> frame_{};
};

/// Calls f with the BaseProblem that fits the loads. A tip force alone is treated as any load.
template <class F, int N>
inline auto with_base_problem(const Model<N>& model, const Joints<N>& q, const TipLoad& load, const Settings& settings,
                              const F& f) noexcept {
  if (!model.coefficients().gravity.isZero(0.0) || !load.force.isZero(0.0) || !load.moment.isZero(0.0))
    return f(BaseProblem<Loading::weight, N>(model, q, load, settings.steps));
  if constexpr (N > 1) return f(BaseProblem<Loading::none, N>(model, q, load, settings.steps));
  return decltype(f(BaseProblem<Loading::weight, N>(model, q, load, settings.steps))){};
}

/// The equilibria along which the base of one tube is turned: a curve in the unknowns and the turn.
template <class Problem, int N>
class TurnCurve {
  static constexpr int U = Problem::unknowns;
  using Point = Eigen::Matrix<double, U + 1, 1>;
  using System = Eigen::Matrix<double, U + 1, U + 1>;

public:
  TurnCurve(Problem& problem, const TipGuess<N>& guess, int tube, double direction) noexcept
    : problem_(problem), guess_(guess), row_(Problem::turns + tube - 1) {
    tangent_.setZero();
    tangent_[U] = direction;
  }

  /// First turn at which det B_u vanishes; infinite if it does not within two turns of the base.
  [[nodiscard]] double snap() noexcept {
    constexpr int most_steps = 400;
    const double infinity = std::numeric_limits<double>::infinity();
    if (!correct() || !(determinant_ > 0)) return 0;
    double h = 0.05;
    for (int k = 0; k < most_steps && std::abs(turn_) < 4 * std::numbers::pi; ++k) {
      const TurnCurve before = *this;
      if (!advance(h)) {
        *this = before;
        if (h < 1e-4) return infinity;
        h *= 0.5;
        continue;
      }
      if (determinant_ <= 0) return refined(before, h);
      h = std::min(2 * h, 0.1);
    }
    return infinity;
  }

private:
  TurnCurve& operator=(const TurnCurve& other) noexcept {
    guess_ = other.guess_, turn_ = other.turn_, determinant_ = other.determinant_, tangent_ = other.tangent_;
    return *this;
  }
  TurnCurve(const TurnCurve&) = default;

  [[nodiscard]] double refined(const TurnCurve& before, double h) noexcept {
    double low = 0, high = h;
    for (int k = 0; k < 40; ++k) {
      *this = before;
      const double middle = 0.5 * (low + high);
      if (!advance(middle)) break;
      (determinant_ > 0 ? low : high) = middle;
    }
    return turn_;
  }

  void move(const Point& d) noexcept {
    Eigen::Matrix<double, N + 2, 1> dx = Eigen::Matrix<double, N + 2, 1>::Zero();
    for (int u = 0; u < U; ++u) dx[u + 3 - Problem::turns] = d[u];
    guess_ = moved<N>(guess_, dx, 1.0);
    turn_ += d[U];
  }

  [[nodiscard]] System system() const noexcept {
    System A;
    A.template topLeftCorner<U, U>() = problem_.B;
    A.col(U).setZero();
    A(row_, U) = -1;
    A.row(U) = tangent_.transpose();
    return A;
  }

  /// Back to the curve, at right angles to the tangent.
  [[nodiscard]] bool correct() noexcept {
    for (int k = 0; k < 8; ++k) {
      problem_.integrate(guess_);
      if constexpr (Problem::turns == 0) guess_.rotation = problem_.rotation;
      Point r;
      r << -problem_.residual, 0;
      r[row_] += turn_;
      determinant_ = problem_.B.determinant();
      if (r.norm() < 1e-9) return true;
      const Point d = system().partialPivLu().solve(r);
      if (!d.allFinite() || d.norm() > 0.5) return false;
      move(d);
    }
    return false;
  }

  [[nodiscard]] bool advance(double h) noexcept {
    problem_.integrate(guess_);
    const Point ahead = system().partialPivLu().solve(Point::Unit(U));
    if (!ahead.allFinite()) return false;
    tangent_ = ahead.normalized();
    move(h * tangent_);
    return correct();
  }

  Problem& problem_;
  TipGuess<N> guess_;
  int row_;
  double turn_ = 0, determinant_ = 0;
  Point tangent_;
};

}  // namespace detail

/// The conjugate-point test: the smallest determinant with the base placed anywhere from the tip back to the grasped
/// ends. Solution::stability is its value at the base itself; a robot that was brought there by a jump can be unstable
/// although that is positive.
/// @param ws  from solve() for the same joints and load
/// Real time: yes, one integration with 8 steps per segment (or settings.steps, if more).
template <int N, class Fx>
[[nodiscard]] WeakestPlace weakest_place(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load,
                                         const Workspace<N>& ws, const Settings& settings = {}) noexcept {
  static_assert(Fx::none, "conjugate points are known for the standard model; with effects, see Solution::stability");
  return detail::with_base_problem(model, q, load, settings, [&](auto problem) noexcept {
    TipGuess<N> guess = ws.guess;
    problem.integrate(guess);
    guess.rotation = problem.rotation;
    WeakestPlace weakest;
    weakest.s = model.robot().tubes[0].length + q.beta[0];
    const auto watch = [&weakest](double s, double determinant) noexcept {
      if (determinant < weakest.determinant) weakest = {determinant, s};
    };
    problem.integrate(guess, watch);
    constexpr int samples = 32;
    for (int k = 0; k <= samples; ++k) {
      const double s = q.beta[0] * k / samples;
      watch(s, problem.jacobian_behind_plate(s).determinant());
    }
    return weakest;
  });
}

/// How far the base of any one tube can be turned, the others held, before the robot snaps. Follows the equilibria by
/// arc length, so it passes close to other branches without leaving its own.
/// @param ws  from solve() for the same joints and load
/// @return infinite angle: no snap within two turns; angle 0: unstable already
/// Real time: no; bounded, some milliseconds.
template <int N, class Fx>
[[nodiscard]] SnapMargin snap_margin(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load,
                                     const Workspace<N>& ws, const Settings& settings = {}) noexcept {
  static_assert(Fx::none, "snaps are followed for the standard model; with effects, see Solution::stability");
  return detail::with_base_problem(model, q, load, settings, [&](auto problem) noexcept {
    TipGuess<N> guess = ws.guess;
    problem.integrate(guess);
    guess.rotation = problem.rotation;
    SnapMargin margin;
    for (int tube = 1; tube < N; ++tube)
      for (const double direction : {1.0, -1.0}) {
        detail::TurnCurve<decltype(problem), N> curve(problem, guess, tube, direction);
        const double angle = curve.snap();
        if (std::abs(angle) < std::abs(margin.angle)) margin = {angle, tube};
      }
    return margin;
  });
}

}  // namespace ctcr
