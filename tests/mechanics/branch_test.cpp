// Whether a solve says truly that it kept the branch of its warm start, against a walk in small steps.
#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace branch_test {

using test::Random, test::uniform;

constexpr Settings settings{.steps = 2, .accuracy = test::as_told};

template <class T>
struct Branch : testing::Test {};
TYPED_TEST_SUITE(Branch, test::TubeCounts);

/// A robot that moves from `ws` to q and load in small steps.
/// @return whether it gets there without a snap
template <int N>
bool walk(const Model<N>& model, const Joints<N>& q, const TipLoad& load, Workspace<N>& ws, Solution<N>& out) {
  const Joints<N> start = ws.q;
  const TipLoad unmoved = ws.load;
  constexpr int parts = 400;
  for (int k = 1; k <= parts; ++k) {
    const double t = double(k) / parts;
    const Joints<N> here{(1 - t) * start.beta + t * q.beta, (1 - t) * start.alpha + t * q.alpha};
    const TipLoad part{(1 - t) * unmoved.force + t * load.force, (1 - t) * unmoved.moment + t * load.moment};
    const TipGuess<N> predicted = detail::predicted_guess(ws, here, part);
    if (solve<Derivatives::compliance>(model, here, part, ws, out, settings) != Status::ok) return false;
    if (detail::distance(predicted, ws.guess) > 0.3 * std::min(out.stability, 1.0)) return false;
  }
  return true;
}

/// Strongly curved tubes, moves up to a radian: of those that say that they kept the branch, all did.
TYPED_TEST(Branch, IsThatOfAWalkInSmallSteps) {
  constexpr int N = TypeParam::N;
  Random random(40 + N);
  int kept = 0, all = 0;
  for (int k = 0; k < test::cases(60); ++k) {
    Robot<N> robot = test::random_robot<N>(random);
    for (Tube& tube : robot.tubes) tube.curvature *= uniform(random, 2, 6);
    const Model<N> model(robot);
    const Joints<N> q = test::random_joints(robot, random);
    const TipLoad load = test::random_load(random, 0.3);
    Workspace<N> ws;
    Solution<N> out;
    if (solve<Derivatives::compliance>(model, q, load, ws, out, settings) != Status::ok) continue;
    EXPECT_FALSE(out.kept_branch) << "a cold start has none";
    Joints<N> next = q;
    for (int i = 0; i < N; ++i) next.alpha[i] += uniform(random, -1, 1);
    const TipLoad next_load{uniform(random, 0.5, 1.5) * load.force, load.moment};
    Workspace<N> far = ws;
    Solution<N> direct;
    if (solve<Derivatives::compliance>(model, next, next_load, far, direct, settings) != Status::ok) continue;
    ++all;
    if (!direct.kept_branch) continue;
    ++kept;
    EXPECT_TRUE(walk(model, next, next_load, ws, out)) << "case " << k;
    EXPECT_LT((out.position - direct.position).norm(), 1e-7) << "case " << k;
  }
  EXPECT_GT(kept, all / 4);
}

/// Opposed tubes that may rest in two shapes: a robot that is turned on and on snaps, and says so then and only then.
TEST(Branch, IsLeftByASnap) {
  Random random(1);
  Robot<2> robot = test::random_robot<2>(random);
  for (Tube& tube : robot.tubes) {
    tube.length = tube.curved_length = 0.15;
    tube.curvature = 20;
  }
  const Model<2> model(robot);
  Workspace<2> ws;
  Solution<2> out;
  Joints<2> q{{0, 0}, {0, 0}};
  ASSERT_EQ(solve<Derivatives::jacobian>(model, q, {}, ws, out, settings), Status::ok);
  int snaps = 0;
  constexpr double turn = 0.01;
  while (q.alpha[1] < 12) {
    q.alpha[1] += turn;
    const Vec3 before = out.position;
    const Status status = solve<Derivatives::jacobian>(model, q, {}, ws, out, settings);
    if (status == Status::singular) continue;
    ASSERT_EQ(status, Status::ok);
    const bool jumped = (out.position - before).norm() > 0.02;
    EXPECT_NE(out.kept_branch, jumped) << "at " << q.alpha[1];
    snaps += jumped;
  }
  EXPECT_GT(snaps, 0);
}

}  // namespace branch_test
}  // namespace ctcr
