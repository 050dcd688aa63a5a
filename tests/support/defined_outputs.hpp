#pragma once
// What outputs are whatever the status: poses that can be, finite derivatives.
#include <algorithm>
#include <cmath>

#include "support/laws.hpp"

namespace ctcr::test {

/// Length of the robot [m].
template <int N>
double length_of(const Case<N>& c) {
  return std::max(0.0, c.robot.tubes[0].length + c.q.beta[0]);
}

/// @param longer  how much farther out than the robot is long a tip may be: effects may displace it [m]
template <int N>
bool is_defined(const Solution<N>& s, const Case<N>& c, double longer = 0) {
  const double length = length_of(c), reach = (std::isfinite(length) ? length : 0) * (1 + 1e-12) + N * 1e-6 + longer;
  const auto is_pose = [&](const Mat3& R, const Vec3& p) {
    return R.allFinite() && p.allFinite() && (R.transpose() * R - Mat3::Identity()).cwiseAbs().maxCoeff() < 1e-12 &&
           R.determinant() > 0 && p.stableNorm() <= reach;
  };
  bool all = is_pose(s.rotation, s.position) && s.iterations >= 0;
  for (const Pose& tip : s.tube_tips) all = all && is_pose(tip.rotation, tip.position);
  return all && s.jacobian.allFinite() && s.compliance.allFinite() && std::isfinite(s.stability) && s.residual >= 0 &&
         (std::isfinite(s.residual) || !has_equilibrium(s.status));
}

}  // namespace ctcr::test
