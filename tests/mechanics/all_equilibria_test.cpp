// Lists of stable equilibria against the closed form for two tubes, and against the solves that they come from.
#include "ctcr/mechanics/all_equilibria.hpp"

#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace all_equilibria_test {

using test::Random, test::uniform;

/// Two tubes, curved from end to end, opposed: theta'' = -c sin theta, theta(0) = 0, theta'(L) = 0 for the difference from
/// the opposed angle, with c = kappa_1 kappa_2 (1 + nu). Beside theta = 0 it has solutions, a pair of mirror images, where
/// sqrt(c) L > pi / 2; theta = 0 is unstable then. Ref: Dupont et al. 2010, "Design and control of concentric-tube robots".
TEST(AllEquilibria, OpposedTubesRestInTwoMirrorImages) {
  Random random(1);
  for (int k = 0; k < test::cases(20); ++k) {
    Robot<2> robot = test::random_robot<2>(random);
    const double length = uniform(random, 0.1, 0.2), ratio = uniform(random, 0.5, 2);
    const bool snaps = k % 2 == 1;
    const double angle = std::numbers::pi / 2 * (snaps ? uniform(random, 1.1, 2.5) : uniform(random, 0.3, 0.9));
    const double kappa = angle / length / std::sqrt(1 + 0.3);
    for (Tube& tube : robot.tubes) {
      tube.poisson_ratio = 0.3;
      tube.length = tube.curved_length = length;
    }
    robot.tubes[0].curvature = kappa * ratio;
    robot.tubes[1].curvature = kappa / ratio;
    const double turn = uniform(random, -3, 3);
    const Joints<2> q{{0, 0}, {turn, turn + std::numbers::pi}};
    const auto found = all_equilibria(Model<2>(robot), q, {});
    ASSERT_EQ(found.size(), snaps ? 2u : 1u) << "case " << k << ", sqrt(c) L " << angle;
    // The plane of the tubes' curvature is a mirror, or holds the only shape.
    const Vec3 normal(std::cos(turn), std::sin(turn), 0);
    EXPECT_NEAR(normal.dot(found.front().solution.position), -normal.dot(found.back().solution.position),
                1e-4 * length);
    EXPECT_EQ(std::abs(normal.dot(found.front().solution.position)) > 1e-3 * length, snaps);
  }
}

template <class T>
struct AllEquilibriaOf : testing::Test {};
TYPED_TEST_SUITE(AllEquilibriaOf, test::TubeCounts);

TYPED_TEST(AllEquilibriaOf, HoldTheColdSolveAndTurnWithTheRobot) {
  constexpr int N = TypeParam::N;
  Random random(20 + N);
  for (int k = 0; k < test::cases(10); ++k) {
    Robot<N> robot = test::random_robot<N>(random);
    for (Tube& tube : robot.tubes) tube.curvature *= 3;
    const Model<N> model(robot);
    Joints<N> q = test::random_joints(robot, random);
    TipLoad load = test::random_load(random, 0.3);
    const auto found = all_equilibria(model, q, load, {}, 20);
    Workspace<N> ws;
    Solution<N> cold;
    if (solve(model, q, load, ws, cold) == Status::ok) {
      ASSERT_FALSE(found.empty());
      EXPECT_EQ(found[0].solution.position, cold.position);
    }
    const double turn = uniform(random, -3, 3);
    q.alpha.array() += turn;
    load.force = rotation_z(turn) * load.force;
    const auto turned = all_equilibria(model, q, load, {}, 20);
    ASSERT_EQ(turned.size(), found.size()) << "case " << k;
    for (const Equilibrium<N>& one : found) {
      EXPECT_EQ(one.solution.status, Status::ok);
      const auto is_turned = [&](const Equilibrium<N>& other) {
        return (rotation_z(turn) * one.solution.position - other.solution.position).norm() < 1e-7;
      };
      EXPECT_EQ(std::ranges::count_if(turned, is_turned), 1) << "case " << k;
    }
  }
}

TEST(AllEquilibria, OfWhatCannotBeSolvedAreNone) {
  Robot<1> robot;
  EXPECT_TRUE(all_equilibria(Model<1>(robot), Joints<1>{}, {}).empty());
}

}  // namespace all_equilibria_test
}  // namespace ctcr
