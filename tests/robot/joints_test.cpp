#include "ctcr/robot/joints.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "support/random_robots.hpp"

namespace ctcr {
namespace joints_test {

const Robot<3> robot = test::paper_robot();
/// Deployed by 0.163, 0.1305 and 0.099 m.
const Joints<3> good{{-0.3, -0.2, -0.1}, {0.1, 0.2, 0.3}};

Joints<3> with_beta(int tube, double beta) {
  Joints<3> q = good;
  q.beta[tube] = beta;
  return q;
}

TEST(CheckJoints, AcceptsOrderedJoints) { EXPECT_EQ(check_joints(robot, good), Status::ok); }

TEST(CheckJoints, AcceptsFlushTipsGraspsAndPlate) {
  EXPECT_EQ(check_joints(robot, with_beta(0, good.beta[1])), Status::ok);
  EXPECT_EQ(check_joints(robot, with_beta(0, 0.3305 - 0.2 - 0.463)), Status::ok);
  EXPECT_EQ(check_joints(robot, Joints<3>{.beta = {-0.463, -0.3305, -0.199}}), Status::ok);
  EXPECT_EQ(check_joints(robot, Joints<3>{}), Status::ok);
}

TEST(CheckJoints, RefusesWrongOrder) {
  EXPECT_EQ(check_joints(robot, with_beta(0, -0.19)), Status::joints_out_of_order) << "grasped before the next tube";
  EXPECT_EQ(check_joints(robot, with_beta(0, -0.34)), Status::joints_out_of_order) << "tip behind the next tube's";
  EXPECT_EQ(check_joints(robot, Joints<3>{.beta = {0, 0, 0.001}}), Status::joints_out_of_order) << "before the plate";
}

TEST(CheckJoints, RefusesATipBehindThePlate) {
  EXPECT_EQ(check_joints(robot, with_beta(2, -0.1995)), Status::tip_behind_plate);
  EXPECT_EQ(check_joints(robot, with_beta(0, -0.47)), Status::tip_behind_plate);
}

TEST(CheckJoints, RefusesWhatIsNotFinite) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    for (int tube = 0; tube < 3; ++tube) {
      EXPECT_EQ(check_joints(robot, with_beta(tube, bad)), Status::not_finite);
      Joints<3> q = good;
      q.alpha[tube] = bad;
      EXPECT_EQ(check_joints(robot, q), Status::not_finite);
    }
}

TEST(CheckJoints, SlackForgivesRounding) {
  const Joints<3> q{.beta = {0, 0, 2e-6}};
  EXPECT_EQ(check_joints(robot, q), Status::joints_out_of_order);
  EXPECT_EQ(check_joints(robot, q, 3e-6), Status::ok);
}

}  // namespace joints_test
}  // namespace ctcr
