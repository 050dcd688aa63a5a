// Integration errs by no more than was asked for, whatever the robot and the load.
#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace accuracy_test {

using test::Random, test::uniform;

template <class T>
struct Accuracy : testing::Test {};
TYPED_TEST_SUITE(Accuracy, test::TubeCounts);

template <int N>
test::Case<N> heavily_loaded_case(Random& random) {
  test::Case<N> c{test::random_robot<N>(random), {}, {}};
  if (test::chance(random, 0.3)) c.robot.gravity = test::tilted_gravity;
  c.q = test::random_joints(c.robot, random, 0.1);
  c.load.force = test::random_vector(random, 2);
  return c;
}

/// Of an `ok` tip, against the equilibrium on the same branch in four times as many steps.
TYPED_TEST(Accuracy, IsKept) {
  constexpr int N = TypeParam::N;
  Random random(340 + N);
  int refined = 0;
  for (int n = 0; n < test::cases(300); ++n) {
    const test::Case<N> c = heavily_loaded_case<N>(random);
    const Model<N> model(c.robot);
    Workspace<N> ws, fine;
    Solution<N> found, exact;
    const Settings settings{.accuracy = n % 2 ? 1e-4 : 1e-6};
    if (solve<Derivatives::jacobian>(model, c.q, c.load, ws, found, settings) != Status::ok) continue;
    const double allowed = settings.accuracy * (c.robot.tubes[0].length + c.q.beta[0]);
    EXPECT_LE(found.integration_error, allowed);
    refined += ws.steps.times > 1;
    fine.begin_at(ws.guess);
    (void)solve<Derivatives::none>(
        model, c.q, c.load, fine, exact,
        {.tolerance = 1e-9, .steps = 4 * ws.steps.times * ws.steps.largest_share(), .accuracy = test::as_told});
    EXPECT_LT((exact.position - found.position).norm(), 3 * allowed + 1e-9) << "case " << n;
  }
  EXPECT_GT(refined, 0);
}

/// Where the steps allowed do not reach it, the answer says so, and a control step from there asks for a solve.
TYPED_TEST(Accuracy, IsSaidToBeMissed) {
  constexpr int N = TypeParam::N;
  Random random(350 + N);
  int missed = 0;
  for (int n = 0; n < test::cases(100); ++n) {
    const test::Case<N> c = heavily_loaded_case<N>(random);
    const Model<N> model(c.robot);
    const Settings settings{.accuracy = 1e-6, .max_steps = 1};
    Workspace<N> ws;
    Solution<N> s;
    if (solve<Derivatives::jacobian>(model, c.q, c.load, ws, s, settings) != Status::inaccurate) continue;
    ++missed;
    EXPECT_GT(s.integration_error, 1e-6 * (c.robot.tubes[0].length + c.q.beta[0]));
    EXPECT_LT(s.residual, 1e-9);
    EXPECT_EQ(step<Derivatives::jacobian>(model, c.q, c.load, ws, s, settings), Status::needs_solve);
  }
  EXPECT_GT(missed, 0);
}

}  // namespace accuracy_test
}  // namespace ctcr
