#pragma once
// Random goals and limits for tests of laws.
#include "ctcr/control/limits.hpp"
#include "support/cases.hpp"
#include "support/random_robots.hpp"

namespace ctcr::test {

/// A goal of the tip and one of the joints, with weights that leave no direction free.
struct RandomGoals {
  LeastSquares<3>::Jacobian J;
  Vec6 v_tip;
  JointVelocity<3> v_joints;
  Weight w_tip, w_joints;

  explicit RandomGoals(Random& random) {
    const auto any = [&] { return uniform(random, -1, 1); };
    J = LeastSquares<3>::Jacobian::NullaryExpr(any);
    v_tip = Vec6::NullaryExpr(any);
    v_joints = JointVelocity<3>::NullaryExpr(any);
    w_tip = {uniform(random, 0.1, 10), chance(random, 0.5) ? 0 : uniform(random, 0.1, 10)};
    w_joints = {uniform(random, 0.01, 1), uniform(random, 0.01, 1)};
  }

  [[nodiscard]] LeastSquares<3> sum() const {
    LeastSquares<3> goals;
    goals.add_tip_goal(J, v_tip, w_tip);
    goals.add_joint_goal(v_joints, w_joints);
    return goals;
  }

  /// F(q').
  [[nodiscard]] double cost(const JointVelocity<3>& v) const {
    const Vec6 e = J * v - v_tip;
    const JointVelocity<3> d = v - v_joints;
    return 0.5 * (w_tip.translation * e.head<3>().squaredNorm() + w_tip.rotation * e.tail<3>().squaredNorm() +
                  w_joints.translation * d.head<3>().squaredNorm() + w_joints.rotation * d.tail<3>().squaredNorm());
  }
};

}  // namespace ctcr::test
