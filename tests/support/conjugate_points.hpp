#pragma once
// An independent judge of solve(): whether an equilibrium is elastically stable.
//
// The determinant of the shooting Jacobian can be taken with the base placed at any arc length; the robot is then what lies
// beyond. An equilibrium is stable if and only if that determinant vanishes nowhere (there is no conjugate point); it
// starts at 1 at the tip. Ref: Ha, Park & Dupont 2016, "Elastic stability of concentric tube robots subject to external
// loads"; Riojas, Hendrick & Webster 2018.
#include <Eigen/LU>
#include <algorithm>

#include "ctcr/mechanics/solve.hpp"

namespace ctcr::test {

/// A matrix of any size: the decomposition compiles once for all.
inline double determinant(const Eigen::MatrixXd& matrix) { return matrix.determinant(); }

/// Where a robot comes closest to a conjugate point.
struct SmallestDeterminant {
  double value = 1;  ///< > 0: stable (two modes that buckle at once only touch zero)
  double s = 0;      ///< arc length from the front plate [m]; < 0 in the transmission
};

/// The shooting problem with its Jacobian B_u, by turns of the tip (base axes) and psi_2..N, written out.
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

  BaseProblem(const Model<N>& model, const Joints<N>& q, const TipLoad& load, int steps) noexcept
    : c_(model.coefficients()), q_(q), load_(load), steps_per_segment_(std::max(steps, steps_)) {}

  /// Integrates from `guess`.
  /// @param watch  watch(s, determinant with the base at s), from the tip to the plate
  template <class Watch = NoRecord>
  void integrate(const TipGuess<N>& guess, const Watch& watch = {}) noexcept {
    Vec3 axis[3];
    detail::turn_axes<L>(load_, axis);
    y_ = detail::tip_state<Col, S>(c_, load_, guess, axis);
    TubeTips<N> tips;
    Frame<S> frame{};
    const auto arc_length = [](int, double s) noexcept { return s; };
    const auto record = [&](double s, const SegmentTubes<N>&, const RobotState<S, N>& y, const Frame<S>& f) noexcept {
      if constexpr (!std::is_same_v<Watch, NoRecord>)
        watch(s, determinant(jacobian(y, f, guess.rotation * f.rotation(), VecN<N>::Zero())));
    };
    Pass::run(c_, sort_events(c_, q_.beta), arc_length, 0.0, steps_per_segment_, y_, frame, tips, record);
    frame_ = frame;
    const double base_angle = y_.psi[0].v + q_.beta[0] * y_.w[0].v;
    rotation = rotation_z(q_.alpha[0] - base_angle) * frame.rotation().transpose();
  }

  /// With the base at s <= 0: every tube is held there, or where it is grasped before that.
  [[nodiscard]] Jacobian jacobian_behind_plate(double s) const noexcept {
    return jacobian(y_, frame_, rotation * frame_.rotation(), q_.beta.cwiseMax(s));
  }

  Mat3 rotation;  ///< R_base_tip found

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

/// The smallest determinant with the base anywhere from the tip back to the grasped ends; Solution::stability is its value
/// at the base itself. One integration with 8 steps per segment (or `steps`, if more).
/// @tparam L  weight, or none where nothing loads the robot
/// @param ws  from solve() for the same joints and load
template <Loading L = Loading::weight, int N>
[[nodiscard]] SmallestDeterminant smallest_determinant(const Model<N>& model, const Joints<N>& q, const TipLoad& load,
                                                       const Workspace<N>& ws, int steps = 1) noexcept {
  BaseProblem<L, N> problem(model, q, load, steps);
  TipGuess<N> guess = ws.guess;
  problem.integrate(guess);
  guess.rotation = problem.rotation;
  SmallestDeterminant smallest{.s = model.robot().tubes[0].length + q.beta[0]};
  const auto watch = [&smallest](double s, double determinant) noexcept {
    if (determinant < smallest.value) smallest = {determinant, s};
  };
  problem.integrate(guess, watch);
  constexpr int samples = 32;
  for (int k = 0; k <= samples; ++k) {
    const double s = q.beta[0] * k / samples;
    watch(s, determinant(problem.jacobian_behind_plate(s)));
  }
  return smallest;
}

}  // namespace ctcr::test
