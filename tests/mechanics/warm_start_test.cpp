// Where a solve starts from must not show in its answer, and one evaluation from a near start is enough.
#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace warm_start_test {

using test::Random, test::uniform;

template <int N>
struct Move {
  Joints<N> q;
  TipLoad load;
};

template <int N>
Move<N> nearby(const test::Case<N>& c, Random& random, double translation, double rotation, double force) {
  Move<N> move{c.q, c.load};
  for (int i = 0; i < N; ++i) {
    move.q.beta[i] += uniform(random, -translation, translation);
    move.q.alpha[i] += uniform(random, -rotation, rotation);
  }
  move.load.force += test::random_vector(random, force);
  return move;
}

template <class T>
struct WarmStart : testing::Test {};
TYPED_TEST_SUITE(WarmStart, test::TubeCounts);

template <Derivatives D, int N>
void expect_warm_equals_cold(double max_force, const Vec3& gravity) {
  Random random(61);
  for (int n = 0; n < test::cases(30); ++n) {
    const test::Case<N> c = test::smooth_case<N>(random, max_force, 0, gravity);
    const Move<N> move = nearby(c, random, 5e-4, 0.05, max_force * 0.1);
    const Model<N> model(c.robot);
    Workspace<N> ws;
    Solution<N> warm;
    const Settings settings{.accuracy = test::as_told};
    ASSERT_EQ(solve<D>(model, c.q, c.load, ws, warm, settings), Status::ok);
    const int cold_evaluations = warm.iterations;
    ASSERT_EQ(solve<D>(model, move.q, move.load, ws, warm, settings), Status::ok);
    const Solution<N> cold = test::solved<D>(c.robot, move.q, move.load);
    EXPECT_LT(test::difference(cold.pose(), warm.pose()).norm(), 1e-9);
    EXPECT_LT((cold.jacobian - warm.jacobian).norm(), 1e-7 * (1 + cold.jacobian.norm()));
    EXPECT_LT((cold.compliance - warm.compliance).norm(), 1e-7 * (1 + cold.compliance.norm()));
    EXPECT_LE(warm.iterations, cold_evaluations + 1);
    for (std::size_t i = 0; i < N; ++i) EXPECT_LT(test::difference(cold.tube_tips[i], warm.tube_tips[i]).norm(), 1e-9);
  }
}

TYPED_TEST(WarmStart, EqualsColdStart) {
  constexpr int N = TypeParam::N;
  expect_warm_equals_cold<Derivatives::none, N>(0, Vec3::Zero());
  expect_warm_equals_cold<Derivatives::jacobian, N>(0, Vec3::Zero());
  expect_warm_equals_cold<Derivatives::jacobian, N>(0.3, Vec3::Zero());
  expect_warm_equals_cold<Derivatives::compliance, N>(0.3, Vec3::Zero());
  expect_warm_equals_cold<Derivatives::compliance, N>(0.3, test::tilted_gravity);
}

TYPED_TEST(WarmStart, SolvingAgainTakesOneEvaluation) {
  constexpr int N = TypeParam::N;
  Random random(62);
  for (int n = 0; n < test::cases(20); ++n) {
    const test::Case<N> c = test::smooth_case<N>(random, 0.3, 0.005, Vec3::Zero());
    const Model<N> model(c.robot);
    Workspace<N> ws;
    Solution<N> s;
    ASSERT_EQ(solve<Derivatives::compliance>(model, c.q, c.load, ws, s), Status::ok);
    const Vec3 position = s.position;
    ASSERT_EQ(solve<Derivatives::compliance>(model, c.q, c.load, ws, s), Status::ok);
    EXPECT_EQ(s.iterations, 1);
    EXPECT_LT((s.position - position).norm(), 1e-12);
  }
}

/// Tip error after one evaluation at the end of a control period [m], mean over random moves.
template <Derivatives D, int N>
double mean_error_of_step(const Robot<N>& robot, double max_force, unsigned seed) {
  Random random(seed);
  double sum = 0;
  const int cases = test::cases(300);
  int counted = 0;
  while (counted < cases) {
    const test::Case<N> c{robot, test::random_joints(robot, random), test::random_load(random, max_force)};
    const Move<N> move = nearby(c, random, 1e-3, 0.0175, 0);
    const Model<N> model(robot);
    Workspace<N> ws;
    Solution<N> s, exact;
    const Settings settings{.accuracy = test::as_told};
    if (solve<D>(model, c.q, c.load, ws, s, settings) != Status::ok || check_joints(robot, move.q) != Status::ok)
      continue;
    Workspace<N> same = ws;
    if (solve<D>(model, move.q, move.load, same, exact, settings) != Status::ok) continue;
    EXPECT_EQ(step<D>(model, move.q, move.load, ws, s, settings), Status::ok);
    sum += (s.position - exact.position).norm();
    ++counted;
  }
  return sum / cases;
}

/// After 1 mm and 1 degree one step is good to 0.1 um.
TEST(Step, IsAccurateAfterASmallMove) {
  EXPECT_LT((mean_error_of_step<Derivatives::jacobian, 3>(test::paper_robot(), 0.3, 63)), 1e-7);
  EXPECT_LT((mean_error_of_step<Derivatives::compliance, 3>(test::paper_robot(), 0.3, 64)), 1e-7);
  EXPECT_LT((mean_error_of_step<Derivatives::jacobian, 3>(test::paper_robot(), 0, 65)), 1e-7);
}

/// One evaluation is usual, two are the budget, and the residual bounds the error.
TYPED_TEST(WarmStart, StepKeepsItsBudget) {
  constexpr int N = TypeParam::N;
  Random random(66);
  int ones = 0;
  for (int n = 0; n < test::cases(50); ++n) {
    const test::Case<N> c = test::smooth_case<N>(random, 0.3, 0, Vec3::Zero());
    const Move<N> move = nearby(c, random, 5e-4, 0.02, 0.01);
    const Model<N> model(c.robot);
    Workspace<N> ws;
    Solution<N> s;
    const Settings settings{.accuracy = test::as_told};
    ASSERT_EQ(solve<Derivatives::compliance>(model, c.q, c.load, ws, s, settings), Status::ok);
    ASSERT_EQ(step<Derivatives::compliance>(model, move.q, move.load, ws, s, settings), Status::ok);
    EXPECT_LE(s.iterations, 2);
    ones += s.iterations == 1;
    const Vec6 error = test::difference(test::solved<Derivatives::none>(c.robot, move.q, move.load).pose(), s.pose());
    EXPECT_LT(error.norm(), 10 * s.residual * s.residual + 1e-9);
    EXPECT_TRUE(s.tube_tips[0].position == s.position && s.tube_tips[0].rotation == s.rotation);
  }
  EXPECT_GT(ones, test::cases(50) * 3 / 4);
}

TYPED_TEST(WarmStart, StepsAlongAPathStayOnIt) {
  constexpr int N = TypeParam::N;
  Random random(67);
  const test::Case<N> c = test::smooth_case<N>(random, 0.2, 0, Vec3::Zero());
  const Model<N> model(c.robot);
  Workspace<N> ws;
  Solution<N> s;
  Joints<N> q = c.q;
  ASSERT_EQ(solve<Derivatives::jacobian>(model, q, c.load, ws, s), Status::ok);
  for (int k = 0; k < 200; ++k) {
    q.alpha[0] += 0.005;
    ASSERT_EQ(step<Derivatives::jacobian>(model, q, c.load, ws, s), Status::ok);
    Workspace<N> same = ws;
    Solution<N> exact;
    ASSERT_EQ(solve<Derivatives::none>(model, q, c.load, same, exact), Status::ok);
    ASSERT_LT((s.position - exact.position).norm(), 1e-6) << "step " << k;
  }
}

/// Without a start, or too far from it, it keeps its budget, says so, and leaves the start as it was.
TEST(Step, AsksForASolve) {
  Random random(68);
  const test::Case<3> c = test::smooth_case<3>(random, 0.2, 0, Vec3::Zero());
  const Model<3> model(c.robot);
  Workspace<3> ws;
  Solution<3> s;
  EXPECT_EQ(step<Derivatives::jacobian>(model, c.q, c.load, ws, s), Status::needs_solve);
  EXPECT_EQ(s.iterations, 0);
  EXPECT_FALSE(ws.warm);
  ASSERT_EQ(solve<Derivatives::jacobian>(model, c.q, c.load, ws, s), Status::ok);
  const TipGuess<3> before = ws.guess;
  Joints<3> far = c.q;
  far.alpha += Eigen::Vector3d(1.5, -1.0, 0.7);
  for (const int budget : {1, 2, 3}) {
    EXPECT_EQ(step<Derivatives::jacobian>(model, far, c.load, ws, s, {.evaluations = budget}), Status::needs_solve);
    EXPECT_EQ(s.iterations, budget);
    EXPECT_TRUE(ws.guess.psi == before.psi && ws.guess.rotation == before.rotation && ws.q.alpha == c.q.alpha);
  }
}

/// Walks until the robot snaps: a step that says ok is on the branch that a walk of small solves stays on.
TEST(Step, DoesNotMissASnap) {
  constexpr auto D = Derivatives::compliance;
  Random random(77);
  int walked = 0, ends = 0;
  for (int n = 0; n < test::cases(150); ++n) {
    Robot<2> robot = test::random_robot<2>(random);
    for (Tube& tube : robot.tubes) tube.curvature = uniform(random, 5, 25);
    Joints<2> q = test::random_joints(robot, random);
    q.alpha << 0, uniform(random, 2, 4.2);
    const TipLoad load{test::random_vector(random, n % 2 ? 0.1 : 0), Vec3::Zero()};
    const Model<2> model(robot);
    Workspace<2> ws;
    Solution<2> s, exact;
    if (solve<D>(model, q, load, ws, s) != Status::ok) continue;
    const double turn = uniform(random, -0.03, 0.03), length = robot.tubes[0].length + q.beta[0];
    for (int k = 0; k < 60; ++k) {
      Workspace<2> small = ws;
      const Joints<2> from = q;
      q.alpha[1] += turn;
      if (step<D>(model, q, load, ws, s) != Status::ok) {
        ++ends;
        break;
      }
      Status status = Status::ok;
      Joints<2> at = from;
      for (int j = 1; j <= 20; ++j) {
        at.alpha[1] = from.alpha[1] + turn * j / 20;
        status = solve<D>(model, at, load, small, exact);
      }
      if (!has_equilibrium(status)) break;
      ASSERT_LT((s.position - exact.position).norm(), 1e-3 * length) << "walk " << n << ", step " << k;
      ++walked;
    }
  }
  EXPECT_GT(walked, test::cases(150) * 10);
  EXPECT_GT(ends, 0);
}

}  // namespace warm_start_test
}  // namespace ctcr
