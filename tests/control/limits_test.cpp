// Limits hold whatever the goals ask for, and the report says where a step was held.
#include <gtest/gtest.h>

#include "random_control.hpp"

namespace ctcr {
namespace limits_test {

using test::Random, test::uniform;

constexpr double period = 0.025;

Limits<3> random_limits(const Robot<3>& robot, Random& random) {
  Limits<3> limits{uniform(random, 0, 5e-3), uniform(random, 0, 5e-3), uniform(random, 0.01, 0.2),
                   uniform(random, 1, 10)};
  for (int i = 0; i < 3; ++i)
    if (test::chance(random, 0.3)) limits.beta_low[i] = -uniform(random, 0.3, 0.9) * robot.tubes[std::size_t(i)].length;
  return limits;
}

bool same_side(double gap, double least) { return gap >= least - 1e-9; }

TEST(Limits, HoldWhateverIsAsked) {
  Random random(11);
  int held = 0;
  for (int n = 0; n < test::cases(2000); ++n) {
    const auto robot = test::random_robot<3>(random);
    const Limits<3> limits = random_limits(robot, random);
    const AllowedPositions<3> allowed(robot, limits);
    if (!allowed.exist()) continue;
    const Vec3 beta = allowed.clamped(test::random_joints(robot, random).beta);
    ASSERT_TRUE(allowed.contain(beta));
    const LeastSquares<3> goals = test::RandomGoals(random).sum();
    for (const auto at_limits : {AtLimits::hold, AtLimits::redistribute}) {
      JointVelocity<3> v;
      LimitReport report;
      ASSERT_EQ(limited_minimum(goals, allowed, limits, beta, period, at_limits, v, report), Status::ok);
      const Vec3 next = beta + period * v.head<3>();
      const Gaps<3> g = gaps(robot, next);
      for (int i = 0; i < 3; ++i) {
        EXPECT_TRUE(same_side(g.bases[i], limits.base_gap) && same_side(g.tips[i], limits.tip_gap));
        EXPECT_GE(next[i], limits.beta_low[i] - 1e-9);
      }
      EXPECT_LE(v.head<3>().cwiseAbs().maxCoeff(), limits.translation_speed * (1 + 1e-9));
      EXPECT_LE(v.tail<3>().cwiseAbs().maxCoeff(), limits.rotation_speed * (1 + 1e-9));
      held += report.any();
    }
  }
  EXPECT_GT(held, test::cases(2000) / 10);
}

TEST(Limits, AStepInsideIsTheMinimumItself) {
  Random random(12);
  const Robot<3> robot = test::paper_robot();
  const Limits<3> limits;
  const AllowedPositions<3> allowed(robot, limits);
  for (int n = 0; n < test::cases(100); ++n) {
    const LeastSquares<3> goals = test::RandomGoals(random).sum();
    JointVelocity<3> v, free;
    LimitReport report;
    ASSERT_EQ(goals.minimum(free), Status::ok);
    Limits<3> wide = limits;
    wide.translation_speed = wide.rotation_speed = 1e3;
    (void)limited_minimum(goals, allowed, wide, {-0.3, -0.2, -0.1}, 1e-4, AtLimits::hold, v, report);
    EXPECT_FALSE(report.any());
    EXPECT_LT((v - free).norm(), 1e-9 * (1 + free.norm()));
  }
}

TEST(Limits, TheWayBackKeepsToTheSpeed) {
  const Robot<3> robot = test::paper_robot();
  const Limits<3> limits{.base_gap = 20e-3};
  const AllowedPositions<3> allowed(robot, limits);
  LeastSquares<3> goals;  // tubes turn, and stay where they are
  JointVelocity<3> wanted = JointVelocity<3>::Zero();
  wanted.tail<3>().setConstant(1);
  goals.add_joint_goal(wanted, {1, 1});
  Vec3 beta(-0.205, -0.202, -0.1);
  double missing = (allowed.clamped(beta) - beta).norm();
  for (int k = 0; k < 20; ++k) {
    JointVelocity<3> v;
    LimitReport report;
    ASSERT_EQ(limited_minimum(goals, allowed, limits, beta, period, AtLimits::hold, v, report), Status::ok);
    EXPECT_LE(v.head<3>().cwiseAbs().maxCoeff(), limits.translation_speed * (1 + 1e-9));
    EXPECT_NEAR(v[3], 1, 1e-12);
    EXPECT_EQ(report.base_gaps, allowed.contain(beta) ? 0 : 1);
    beta += period * v.head<3>();
    const double left = (allowed.clamped(beta) - beta).norm();
    EXPECT_TRUE(left < missing || left < 1e-12);
    missing = left;
  }
  EXPECT_TRUE(allowed.contain(beta));
}

TEST(Limits, TheReportNamesTheGap) {
  const Robot<3> robot = test::paper_robot();
  const Limits<3> limits{.base_gap = 5e-3, .tip_gap = 4e-3};
  const AllowedPositions<3> allowed(robot, limits);
  LimitReport report;
  const Vec3 bases = allowed.clamped({-0.201, -0.2, -0.1}, &report);  // tube 1 runs into the base of tube 2
  EXPECT_EQ(report.base_gaps, 1);
  EXPECT_EQ(report.tip_gaps | report.travel, 0);
  EXPECT_NEAR(bases[0], -0.205, 1e-12);
  report = {};
  const Vec3 tips = allowed.clamped({-0.3, -0.17, -0.1}, &report);  // its tip would be inside that of tube 2
  EXPECT_EQ(report.tip_gaps, 1);
  EXPECT_NEAR(robot.tubes[0].length + tips[0] - robot.tubes[1].length - tips[1], 4e-3, 1e-12);
  report = {};
  (void)allowed.clamped({-0.3, -0.2, 0.1}, &report);
  EXPECT_EQ(report.base_gaps & 4, 4);
}

TEST(Limits, WhatExcludesEverythingIsFound) {
  EXPECT_TRUE(AllowedPositions<3>(test::paper_robot(), {}).exist());
  EXPECT_FALSE(AllowedPositions<3>(test::paper_robot(), {.base_gap = 0.1, .tip_gap = 0.1}).exist());
  EXPECT_FALSE(AllowedPositions<3>(test::paper_robot(), {.beta_low = Vec3(0.1, 0.1, 0.1)}).exist());
}

TEST(Limits, NumbersThatAreNoLimitsAreFound) {
  EXPECT_EQ(check_limits(Limits<3>{}), Status::ok);
  constexpr double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(check_limits(Limits<3>{.translation_speed = infinity, .rotation_speed = 0}), Status::ok);
  for (double Limits<3>::* field :
       {&Limits<3>::base_gap, &Limits<3>::tip_gap, &Limits<3>::translation_speed, &Limits<3>::rotation_speed})
    for (const double bad : {-1e-3, -infinity, std::nan("")}) {
      Limits<3> limits;
      limits.*field = bad;
      EXPECT_EQ(check_limits(limits), Status::invalid_settings);
    }
  for (VecN<3> Limits<3>::* field : {&Limits<3>::beta_low, &Limits<3>::beta_high})
    for (int i = 0; i < 3; ++i) {
      Limits<3> limits;
      (limits.*field)[i] = std::nan("");
      EXPECT_EQ(check_limits(limits), Status::invalid_settings);
    }
}

TEST(Limits, WithoutSpeedTheRobotStands) {
  Random random(14);
  const Robot<3> robot = test::paper_robot();
  for (const auto& [turns, nothing] : {std::pair{false, 0.0}, {false, -0.0}, {true, 0.0}, {true, -0.0}}) {
    Limits<3> limits{.base_gap = 20e-3};
    (turns ? limits.rotation_speed : limits.translation_speed) = nothing;
    for (const Vec3& beta : {Vec3(-0.3, -0.2, -0.1), Vec3(-0.205, -0.202, -0.1)}) {
      JointVelocity<3> v;
      LimitReport report;
      ASSERT_EQ(limited_minimum(test::RandomGoals(random).sum(), AllowedPositions<3>(robot, limits), limits, beta,
                                period, AtLimits::hold, v, report),
                Status::ok);
      EXPECT_EQ((turns ? v.tail<3>() : v.head<3>()).norm(), 0);
      EXPECT_TRUE(report.speed && v.allFinite());
    }
  }
}

TEST(Limits, TheReportHoldsAllTubes) {
  Robot<9> robot;
  for (std::size_t i = 0; i < 9; ++i) robot.tubes[i].length = 1 - 0.1 * double(i);
  LimitReport report;
  VecN<9> beta;
  for (int i = 0; i < 9; ++i) beta[i] = -0.05 * (9 - i);
  beta[8] = 0.1;
  (void)AllowedPositions<9>(robot, {}).clamped(beta, &report);
  EXPECT_EQ(report.base_gaps, 1 << 8);
}

TEST(Limits, TheOtherJointsTakeOver) {
  Random random(13);
  const Robot<3> robot = test::paper_robot();
  Limits<3> limits;
  limits.translation_speed = limits.rotation_speed = 1e3;
  const AllowedPositions<3> allowed(robot, limits);
  int better = 0;
  for (int n = 0; n < test::cases(300); ++n) {
    const Vec3 beta = allowed.clamped(test::random_joints(robot, random, 0.5).beta);
    const test::RandomGoals goals(random);
    JointVelocity<3> held, shared;
    LimitReport report;
    (void)limited_minimum(goals.sum(), allowed, limits, beta, period, AtLimits::hold, held, report);
    if (!report.any()) continue;
    (void)limited_minimum(goals.sum(), allowed, limits, beta, period, AtLimits::redistribute, shared, report);
    better += goals.cost(shared) < goals.cost(held) * (1 - 1e-9);
    if (std::popcount(unsigned(report.base_gaps | report.tip_gaps)) == 1) {
      EXPECT_LE(goals.cost(shared), goals.cost(held) * (1 + 1e-5));
    }
  }
  EXPECT_GT(better, 20);
}

}  // namespace limits_test
}  // namespace ctcr
