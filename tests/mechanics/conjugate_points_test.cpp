// The conjugate-point test against closed forms, and solve() against the conjugate-point test.
#include "support/conjugate_points.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "support/random_robots.hpp"
#include "support/solver.hpp"

namespace ctcr {
namespace conjugate_points_test {

/// Two tubes curved over the same place behind their flush tips: psi'' = c sin psi for their angle psi, w = 0 at the
/// tip, straight before. One turns the other through a shaft of length `transmission` (in one piece of each).
struct Pair {
  Robot<2> robot;
  Joints<2> q;
  double c;  ///< [1/m^2]

  explicit Pair(double transmission, double curved_length = 0.08) {
    for (Tube& tube : robot.tubes) {
      tube = test::paper_robot().tubes[0];
      tube.curvature = 12;
      tube.curved_length = curved_length;
      tube.length = curved_length + transmission;
    }
    robot.tubes[1].inner_diameter = 1.62e-3;
    robot.tubes[1].outer_diameter = 1.80e-3;
    q.beta << -0.6 * transmission, -0.6 * transmission;
    const auto& [t1, t2] = robot.tubes;
    const double a1 = t1.EI() * t1.curvature, a2 = t2.EI() * t2.curvature;
    c = a1 * a2 / (t1.EI() + t2.EI()) * (1 / t1.GJ() + 1 / t2.GJ());
  }

  /// The equilibrium with opposed tubes, stable or not.
  [[nodiscard]] Workspace<2> opposed() const {
    Workspace<2> ws;
    ws.guess.psi << 0, std::numbers::pi;
    ws.q = q;
    return ws;
  }

  /// Determinant there: psi at the base by psi at the tip, cos(x) - x_t sin(x).
  [[nodiscard]] double determinant() const {
    const double root = std::sqrt(c), x = root * robot.tubes[0].curved_length;
    return std::cos(x) - root * (robot.tubes[0].length - robot.tubes[0].curved_length) * std::sin(x);
  }
};

/// At the length of the transmission that the closed form says.
TEST(ConjugatePoints, OpposedTubesLoseStability) {
  const double root = std::sqrt(Pair(0.1).c);
  const double critical = 1 / (root * std::tan(root * 0.08));
  ASSERT_GT(critical, 0.01);
  double low = 0, high = 3 * critical;
  for (int k = 0; k < 40; ++k) {
    Pair pair(0.5 * (low + high));
    pair.q.alpha << 0.4, 0.4 + std::numbers::pi;
    const bool stable =
        test::smallest_determinant<Loading::none>(Model<2>(pair.robot), pair.q, {}, pair.opposed()).value > 0;
    (stable ? low : high) = 0.5 * (low + high);
  }
  EXPECT_NEAR(low / critical, 1, 1e-5);
}

/// Their determinant has a closed form.
TEST(ConjugatePoints, OpposedTubes) {
  for (const double transmission : {0.02, 0.1, 0.3}) {
    Pair pair(transmission);
    pair.q.alpha << -0.3, -0.3 + std::numbers::pi;
    const auto smallest = test::smallest_determinant<Loading::none>(Model<2>(pair.robot), pair.q, {}, pair.opposed());
    EXPECT_NEAR(smallest.value, pair.determinant(), 1e-5);
    EXPECT_NEAR(smallest.s, pair.q.beta[0], 1e-12);
  }
}

/// Equilibria that solve() calls ok have no conjugate point, and its determinant is that at the base.
TEST(Solve, FindsStableEquilibria) {
  test::Random random(5);
  int at_base = 0;
  for (int k = 0; k < 100; ++k) {
    Robot<3> robot = test::random_robot<3>(random);
    if (k % 2 == 1) robot.gravity = test::random_vector(random, 9.81);
    const Joints<3> q = test::random_joints(robot, random);
    const TipLoad load = k % 4 < 2 ? TipLoad{} : test::random_load(random, 0.2, k % 8 < 4 ? 0.005 : 0);
    Workspace<3> ws;
    Solution<3> solution;
    const Model<3> model(robot);
    const Settings settings{.steps = 16, .accuracy = test::as_told};
    if (solve(model, q, load, ws, solution, settings) != Status::ok) continue;
    const bool loaded = k % 4 != 0;
    const auto smallest = loaded ? test::smallest_determinant(model, q, load, ws, settings.steps)
                                 : test::smallest_determinant<Loading::none>(model, q, load, ws, settings.steps);
    EXPECT_GT(smallest.value, 0) << k;
    if (smallest.s != q.beta[0]) continue;
    EXPECT_NEAR(smallest.value, solution.stability, 1e-7) << k;
    ++at_base;
  }
  EXPECT_GT(at_base, 10);
}

/// Clamped at the plate, pushed at the free end: it buckles at F = (pi/2)^2 EI / L^2.
struct Column {
  static constexpr double quarter = std::numbers::pi / 2, length = 0.2;
  Robot<1> robot;
  Joints<1> q;
  double euler;  ///< [N]

  Column() {
    robot.tubes[0] = test::paper_robot().tubes[0];
    robot.tubes[0].curvature = 0;
    q.beta << length - robot.tubes[0].length;
    euler = quarter * quarter * robot.tubes[0].EI() / (length * length);
  }
  [[nodiscard]] TipLoad push(double part) const { return {.force = Vec3(0, 0, -part * euler), .moment = Vec3::Zero()}; }
};

TEST(ConjugatePoints, ColumnBucklesAtEulersLoad) {
  // Each of two bending directions has cos(sqrt(F/EI) L). Both at once only touch zero.
  const Column column;
  for (const double part : {0.1, 0.5, 0.9, 0.98, 1.0, 1.3}) {
    const auto smallest =
        test::smallest_determinant(Model<1>(column.robot), column.q, column.push(part), Workspace<1>{}, 64);
    const double cosine = part < 1 ? std::cos(std::sqrt(part) * Column::quarter) : 0;
    EXPECT_NEAR(smallest.value, cosine * cosine, 2e-4) << part;
  }
}

/// Pushed in steps that are too small for a solve to look for conjugate points in each.
TEST(Solve, ColumnIsNotOkBeyondEulersLoad) {
  const Column column;
  const Model<1> model(column.robot);
  for (const bool in_control_steps : {false, true}) {
    Workspace<1> ws;
    Solution<1> solution;
    for (double part = 0; part < 1.5; part += 1e-3) {
      Status status = Status::needs_solve;
      if (in_control_steps) status = step(model, column.q, column.push(part), ws, solution);
      if (status == Status::needs_solve) status = solve(model, column.q, column.push(part), ws, solution);
      if (part < 0.8) {
        ASSERT_EQ(status, Status::ok) << part;
      } else if (part > 1) {
        ASSERT_NE(status, Status::ok) << part;
      }
    }
  }
}

}  // namespace conjugate_points_test
}  // namespace ctcr
