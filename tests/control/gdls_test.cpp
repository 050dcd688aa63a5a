#include <gtest/gtest.h>

#include <Eigen/SVD>

#include "random_control.hpp"

namespace ctcr {
namespace gdls_test {

using test::Random, test::uniform;

TEST(LeastSquares, NoOtherVelocityCostsLess) {
  Random random(1);
  for (int n = 0; n < test::cases(200); ++n) {
    const test::RandomGoals goals(random);
    JointVelocity<3> v;
    ASSERT_EQ(goals.sum().minimum(v), Status::ok);
    const double least = goals.cost(v);
    for (const double size : {1e-6, 1e-3, 1.0}) {
      const JointVelocity<3> other = v + size * JointVelocity<3>::NullaryExpr([&] { return uniform(random, -1, 1); });
      EXPECT_GE(goals.cost(other), least * (1 - 1e-12));
    }
  }
}

/// Solved by singular values.
TEST(LeastSquares, AgreesWithTheStackedGoals) {
  Random random(2);
  for (int n = 0; n < test::cases(100); ++n) {
    const test::RandomGoals g(random);
    Vec6 tip, joints;
    tip << Vec3::Constant(std::sqrt(g.w_tip.translation)), Vec3::Constant(std::sqrt(g.w_tip.rotation));
    joints << Vec3::Constant(std::sqrt(g.w_joints.translation)), Vec3::Constant(std::sqrt(g.w_joints.rotation));
    Eigen::Matrix<double, 12, 6> A;
    A << tip.asDiagonal() * g.J, Mat6(joints.asDiagonal());
    Eigen::Matrix<double, 12, 1> b;
    b << tip.cwiseProduct(g.v_tip), joints.cwiseProduct(g.v_joints);
    JointVelocity<3> v;
    ASSERT_EQ(g.sum().minimum(v), Status::ok);
    const JointVelocity<3> expected = Eigen::MatrixXd(A).jacobiSvd(Eigen::ComputeThinU | Eigen::ComputeThinV).solve(b);
    EXPECT_LT((v - expected).norm(), 1e-9 * (1 + expected.norm()));
  }
}

TEST(LeastSquares, AScalarGoalOfGreatWeightIsMet) {
  Random random(3);
  for (int n = 0; n < test::cases(50); ++n) {
    LeastSquares<3> goals = test::RandomGoals(random).sum();
    const JointVelocity<3> direction = JointVelocity<3>::NullaryExpr([&] { return uniform(random, -1, 1); });
    goals.add_scalar_goal(direction, 0.5, 1e9 * goals.largest_weight());
    JointVelocity<3> v;
    ASSERT_EQ(goals.minimum(v), Status::ok);
    EXPECT_NEAR(direction.dot(v), 0.5, 1e-6);
  }
}

TEST(LeastSquares, WhatIsLeftFreeIsSingularAndStandsStill) {
  Random random(4);
  const test::RandomGoals g(random);
  LeastSquares<3> goals;
  goals.add_tip_goal(g.J, g.v_tip, {1, 0});
  JointVelocity<3> v = JointVelocity<3>::Ones();
  EXPECT_EQ(goals.minimum(v), Status::singular);
  EXPECT_EQ(v.norm(), 0);
  goals.add_joint_goal(JointVelocity<3>::Constant(std::nan("")), {1, 1});
  EXPECT_EQ(goals.minimum(v), Status::not_finite);
  EXPECT_EQ(v.norm(), 0);
}

TEST(LeastSquares, WeightsThatLeaveNoMinimumAreInvalid) {
  Random random(5);
  const test::RandomGoals g(random);
  for (const double bad : {-1.0, -1e-9})
    for (const Weight w : {Weight{bad, 1}, Weight{1, bad}}) {
      LeastSquares<3> of_tip = g.sum(), of_joints = g.sum(), of_number = g.sum();
      of_tip.add_tip_goal(g.J, g.v_tip, w);
      of_joints.add_joint_goal(g.v_joints, w);
      of_number.add_scalar_goal(g.v_joints, 1, bad);
      for (const LeastSquares<3>& goals : {of_tip, of_joints, of_number}) {
        JointVelocity<3> v = JointVelocity<3>::Ones();
        EXPECT_EQ(goals.minimum(v), Status::invalid_settings);
        EXPECT_EQ(v.norm(), 0);
      }
    }
}

}  // namespace gdls_test
}  // namespace ctcr
