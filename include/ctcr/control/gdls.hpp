#pragma once
// Generalised damped least squares: competing goals as one sum of weighted squares, quadratic in q'.
#include <algorithm>

#include "ctcr/core/status.hpp"
#include "ctcr/core/types.hpp"
#include "ctcr/math/small_solve.hpp"

namespace ctcr {

/// q' = (beta', alpha'): velocities of the joints [m/s], [rad/s], as the columns of J.
template <int N>
using JointVelocity = VecN<2 * N>;

/// Diagonal of W: of what moves and of what turns. SI units: (m/s)^-2 and (rad/s)^-2, up to a common factor.
struct Weight {
  double translation = 0;
  double rotation = 0;

  friend Weight operator*(double factor, const Weight& w) noexcept {
    return {factor * w.translation, factor * w.rotation};
  }
};

/// F(q') = 1/2 sum (J q' - v_X)^T W (J q' - v_X) + 1/2 sum (q' - v_q)^T W (q' - v_q), held as its normal equations.
/// Ref: Boyer et al., eq. (4). Real time: yes.
template <int N>
class LeastSquares {
public:
  using Jacobian = Eigen::Matrix<double, 6, 2 * N>;

  /// Adds a goal of the tip: v [m/s], [rad/s], base frame.
  void add_tip_goal(const Jacobian& J, const Vec6& v, Weight w) noexcept {
    least_weight_ = std::min({least_weight_, w.translation, w.rotation});
    Vec6 diagonal;
    diagonal << Vec3::Constant(w.translation), Vec3::Constant(w.rotation);
    const Eigen::Matrix<double, 2 * N, 6> JtW = J.transpose() * diagonal.asDiagonal();
    A_.noalias() += JtW * J;
    b_.noalias() += JtW * v;
  }

  /// Adds a goal of the joints: velocities v [m/s], [rad/s].
  void add_joint_goal(const JointVelocity<N>& v, Weight w) noexcept {
    least_weight_ = std::min({least_weight_, w.translation, w.rotation});
    JointVelocity<N> diagonal;
    diagonal << VecN<N>::Constant(w.translation), VecN<N>::Constant(w.rotation);
    A_.diagonal() += diagonal;
    b_ += diagonal.cwiseProduct(v);
  }

  /// Adds a goal of one number: direction . q' = v.
  void add_scalar_goal(const JointVelocity<N>& direction, double v, double w) noexcept {
    least_weight_ = std::min(least_weight_, w);
    A_.noalias() += w * direction * direction.transpose();
    b_ += w * v * direction;
  }

  /// The largest weight that a joint has so far.
  [[nodiscard]] double largest_weight() const noexcept { return A_.diagonal().maxCoeff(); }

  /// The minimum: dF/dq' = 0.
  /// @return ok; singular: goals leave a direction free (add damping); not_finite: a goal or a weight is not finite or too
  ///         large; invalid_settings: a weight is negative, so there may be no minimum. Unless ok, q' = 0.
  Status minimum(JointVelocity<N>& velocity) const noexcept {
    velocity = b_;
    if (least_weight_ >= 0 && solve_in_place(A_, velocity) > 1e-14 && velocity.allFinite()) return Status::ok;
    velocity.setZero();
    if (least_weight_ < 0) return Status::invalid_settings;
    return all_finite(A_, b_) ? Status::singular : Status::not_finite;
  }

private:
  using Matrix = Eigen::Matrix<double, 2 * N, 2 * N>;
  Matrix A_ = Matrix::Zero();
  JointVelocity<N> b_ = JointVelocity<N>::Zero();
  double least_weight_ = 0;
};

}  // namespace ctcr
