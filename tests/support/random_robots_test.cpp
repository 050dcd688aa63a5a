#include "random_robots.hpp"

#include <gtest/gtest.h>

namespace random_robots_test {

using namespace ctcr;

template <int N>
void expect_valid_cases() {
  test::Random random(N);
  for (int i = 0; i < 1000; ++i) {
    const Robot<N> robot = test::random_robot<N>(random);
    for (std::size_t t = 0; t < N; ++t) {
      const Tube& tube = robot.tubes[t];
      EXPECT_GT(tube.outer_diameter, tube.inner_diameter);
      EXPECT_GE(tube.length, tube.curved_length);
      if (t == 0) continue;
      EXPECT_GT(tube.inner_diameter, robot.tubes[t - 1].outer_diameter);
      EXPECT_LT(tube.length, robot.tubes[t - 1].length);
    }
    EXPECT_EQ(check_joints(robot, test::random_joints(robot, random), 1e-15), Status::ok);
    EXPECT_EQ(check_joints(robot, test::random_joints(robot, random, 0.5), 1e-15), Status::ok);
  }
}

TEST(RandomRobots, AreValid) {
  expect_valid_cases<1>();
  expect_valid_cases<2>();
  expect_valid_cases<3>();
  expect_valid_cases<4>();
}

TEST(RandomRobots, JointsCanBeFlush) {
  test::Random random(1);
  const Robot<3> robot = test::paper_robot();
  int flush_bases = 0, flush_tips = 0;
  for (int i = 0; i < 100; ++i) {
    const Joints<3> q = test::random_joints(robot, random, 1);
    flush_bases += q.beta[0] == q.beta[1];
    flush_tips += robot.tubes[0].length + q.beta[0] == robot.tubes[1].length + q.beta[1];
  }
  EXPECT_GT(flush_bases, 20);
  EXPECT_GT(flush_tips, 5);
}

TEST(RandomRobots, LoadsAreBounded) {
  test::Random random(1);
  for (int i = 0; i < 100; ++i) {
    const TipLoad load = test::random_load(random, 0.2, 0.01);
    EXPECT_LE(load.force.norm(), 0.2);
    EXPECT_LE(load.moment.norm(), 0.01);
  }
}

}  // namespace random_robots_test
