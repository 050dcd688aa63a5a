#include "ctcr/parallel/split_step.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/cases.hpp"
#include "support/no_alloc.hpp"
#include "support/random_robots.hpp"
#include "support/solver.hpp"

namespace split_step_test {

using namespace ctcr;

void expect_equal(const Solution<3>& a, const Solution<3>& b) {
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.iterations, b.iterations);
  EXPECT_NEAR(a.residual, b.residual, 1e-13);
  EXPECT_NEAR(a.stability, b.stability, 1e-11 * std::abs(a.stability));
  EXPECT_LE((a.position - b.position).norm(), 1e-14);
  EXPECT_LE((a.rotation - b.rotation).norm(), 1e-13);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_LE((a.tube_tips[i].position - b.tube_tips[i].position).norm(), 1e-14);
  EXPECT_LE((a.jacobian - b.jacobian).norm(), 1e-11 * a.jacobian.norm());
  EXPECT_LE((a.compliance - b.compliance).norm(), 1e-11 * a.compliance.norm());
}

// Force, moment and weight each have their own columns; two threads share three groups of them unevenly.
TEST(SplitStep, EqualsTheStepOfOneThread) {
  test::Random random(3);
  ThreadPool one(1), two(2), three(3);
  for (int n = 0; n < test::cases(60); ++n) {
    Robot<3> robot = test::paper_robot();
    if (n % 3 == 2) robot.gravity = Vec3(4, -5, 7);
    const Model<3> model(robot);
    Joints<3> q = test::random_joints(robot, random);
    const TipLoad load = test::random_load(random, 0.2, n % 3 == 1 ? 0.005 : 0.0);
    Workspace<3> start;
    Solution<3> whole, split;
    if (solve<Derivatives::compliance>(model, q, load, start, whole) != Status::ok) continue;
    q.alpha.array() += 0.01;
    q.beta *= 0.999;
    for (ThreadPool* pool : {&one, &two, &three}) {
      Workspace<3> ws = start, ws_split = start;
      (void)step<Derivatives::compliance>(model, q, load, ws, whole);
      const test::HeapGuard guard;
      (void)split_step<Derivatives::compliance>(model, q, load, ws_split, split, *pool);
      EXPECT_EQ(guard.uses(), 0);
      ASSERT_EQ(whole.iterations, 1);
      expect_equal(whole, split);
      EXPECT_LE((ws.guess.psi - ws_split.guess.psi).norm(), 1e-12);
      EXPECT_LE((ws.sensitivity - ws_split.sensitivity).norm(), 1e-11 * ws.sensitivity.norm());
    }
  }
}

TEST(SplitStep, StartsFromNothingLikeStep) {
  test::Random random(4);
  const Model<3> model(test::paper_robot());
  ThreadPool pool(2);
  Workspace<3> ws, ws_split;
  Solution<3> whole, split;
  const Joints<3> q = test::random_joints(model.robot(), random);
  EXPECT_EQ(step<Derivatives::compliance>(model, q, {}, ws, whole), Status::ok);
  EXPECT_EQ(split_step<Derivatives::compliance>(model, q, {}, ws_split, split, pool), Status::ok);
  expect_equal(whole, split);
}

}  // namespace split_step_test
