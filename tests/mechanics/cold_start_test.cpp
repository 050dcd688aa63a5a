// Random robots from no knowledge at all: converged or said so, and never farther out than the robot is long.
#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace cold_start_test {

using test::Random;

template <int N>
struct Outcome {
  int ok = 0, singular = 0, others = 0;

  /// @param slack  how much farther than its length a tip may come out, relative: one step per segment errs that much
  ///               where a thin tube is bent strongly
  void add(const Robot<N>& robot, const Joints<N>& q, const TipLoad& load, double slack) {
    Workspace<N> ws;
    Solution<N> s;
    const Status status = solve<Derivatives::none>(Model<N>(robot), q, load, ws, s);
    EXPECT_EQ(s.status, status);
    ok += status == Status::ok;
    singular += status == Status::singular;
    others += status != Status::ok && status != Status::singular;
    if (status == Status::ok) {
      EXPECT_LT(s.residual, 1e-10);
      EXPECT_GT(s.stability, 0) << "an unstable equilibrium is no answer";
    }
    const double deployed = robot.tubes[0].length + q.beta[0];
    EXPECT_LE(s.position.norm(), deployed * (1 + slack) + 1e-12);
    for (std::size_t i = 0; i < N; ++i) {
      EXPECT_LE(s.tube_tips[i].position.norm(), deployed * (1 + slack) + 1e-12);
      EXPECT_LT((s.tube_tips[i].rotation.transpose() * s.tube_tips[i].rotation - Mat3::Identity()).norm(), 1e-12);
    }
    EXPECT_LT((s.rotation.transpose() * s.rotation - Mat3::Identity()).norm(), 1e-12);
    EXPECT_LT((s.tube_tips[0].position - s.position).norm(), 1e-12);
  }
};

TEST(ColdStart, PaperRobotUnderTipForce) {
  Random random(51);
  const Robot<3> robot = test::paper_robot();
  Outcome<3> outcome;
  const int cases = test::cases(2000);
  for (int n = 0; n < cases; ++n)
    outcome.add(robot, test::random_joints(robot, random), test::random_load(random, 0.3), 0);
  EXPECT_EQ(outcome.ok, cases);
}

// From the straight robot Newton's method meets a fold or an unstable equilibrium here, beside stable ones.
TEST(ColdStart, LeavesUnstableEquilibria) {
  Robot<3> robot = test::paper_robot();
  for (Tube& tube : robot.tubes) tube.curvature *= 2;
  Random random(53);
  Outcome<3> outcome;
  const int cases = test::cases(1000);
  for (int n = 0; n < cases; ++n) outcome.add(robot, test::random_joints(robot, random), {}, 0.01);
  EXPECT_EQ(outcome.ok, cases);
}

template <class T>
struct ColdStarts : testing::Test {};
TYPED_TEST_SUITE(ColdStarts, test::TubeCounts);

TYPED_TEST(ColdStarts, RandomRobots) {
  constexpr int N = TypeParam::N;
  Random random(52);
  Outcome<N> outcome;
  const int cases = test::cases(300);
  for (int n = 0; n < cases; ++n) {
    Robot<N> robot = test::random_robot<N>(random);
    if (n % 3 == 1) robot.gravity = test::tilted_gravity;
    const Joints<N> q = test::random_joints(robot, random, 0.1);
    outcome.add(robot, q, n % 3 == 0 ? TipLoad{} : test::random_load(random, 0.2, 0.005), 0.01);
  }
  EXPECT_LE(outcome.others, 1 + cases / 100) << outcome.singular << " singular";
}

}  // namespace cold_start_test
}  // namespace ctcr
