#pragma once
#include <cmath>

#include "ctcr/core/status.hpp"
#include "ctcr/core/types.hpp"
#include "ctcr/robot/robot.hpp"

namespace ctcr {

/// Actuation variables q = [beta, alpha], innermost tube first.
template <int N>
struct Joints {
  VecN<N> beta = VecN<N>::Zero();   ///< positions of the grasped points [m]: <= 0, 0 is the front plate
  VecN<N> alpha = VecN<N>::Zero();  ///< base angles about z [rad]
};

/// Largest angle [rad]: double precision resolves it to 1e-10 rad, as far as an equilibrium is solved.
inline constexpr double largest_angle = 1e6;

/// Checks order and range: beta_1 <= ... <= beta_N <= 0 and l_1 + beta_1 >= ... >= l_N + beta_N >= 0 (equality is a
/// flush tip); |alpha_i| <= largest_angle. `slack` [m] forgives rounding of recorded joints.
/// @return ok; joints_out_of_order; tip_behind_plate; not_finite: also for an angle too large. Real time: yes.
template <int N>
[[nodiscard]] Status check_joints(const Robot<N>& robot, const Joints<N>& q, double slack = 1e-6) noexcept {
  if (!all_finite(q.beta, q.alpha) || q.alpha.cwiseAbs().maxCoeff() > largest_angle) return Status::not_finite;
  bool ordered = q.beta[N - 1] <= slack;
  bool deployed = robot.tubes[N - 1].length + q.beta[N - 1] >= -slack;
  for (std::size_t i = 0; i + 1 < N; ++i) {
    const double tip = robot.tubes[i].length + q.beta[Eigen::Index(i)];
    const double next_tip = robot.tubes[i + 1].length + q.beta[Eigen::Index(i) + 1];
    ordered = ordered && q.beta[Eigen::Index(i)] <= q.beta[Eigen::Index(i) + 1] + slack && tip >= next_tip - slack;
    deployed = deployed && tip >= -slack;
  }
  if (!deployed) return Status::tip_behind_plate;
  return ordered ? Status::ok : Status::joints_out_of_order;
}

}  // namespace ctcr
