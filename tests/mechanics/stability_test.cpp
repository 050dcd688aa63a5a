// Stability against the closed form for two tubes, and against the solver.
#include "ctcr/mechanics/stability.hpp"

#include <gtest/gtest.h>

#include "support/random_robots.hpp"
#include "support/solver.hpp"

namespace ctcr {
namespace stability_test {

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

TEST(WeakestPlace, OpposedTubesLoseStabilityAtTheClosedForm) {
  const double root = std::sqrt(Pair(0.1).c);
  const double critical = 1 / (root * std::tan(root * 0.08));
  ASSERT_GT(critical, 0.01);
  double low = 0, high = 3 * critical;
  for (int k = 0; k < 40; ++k) {
    Pair pair(0.5 * (low + high));
    pair.q.alpha << 0.4, 0.4 + std::numbers::pi;
    const bool stable = weakest_place(Model<2>(pair.robot), pair.q, {}, pair.opposed()).determinant > 0;
    (stable ? low : high) = 0.5 * (low + high);
  }
  EXPECT_NEAR(low / critical, 1, 1e-5);
}

TEST(WeakestPlace, DeterminantOfOpposedTubesIsTheClosedForm) {
  for (const double transmission : {0.02, 0.1, 0.3}) {
    Pair pair(transmission);
    pair.q.alpha << -0.3, -0.3 + std::numbers::pi;
    const WeakestPlace weakest = weakest_place(Model<2>(pair.robot), pair.q, {}, pair.opposed());
    EXPECT_NEAR(weakest.determinant, pair.determinant(), 1e-5);
    EXPECT_NEAR(weakest.s, pair.q.beta[0], 1e-12);
  }
}

TEST(WeakestPlace, IsTheSolversDeterminantAtTheBase) {
  test::Random random(5);
  int compared = 0;
  for (int k = 0; k < 40; ++k) {
    Robot<3> robot = test::random_robot<3>(random);
    if (k % 2 == 1) robot.gravity = test::random_vector(random, 9.81);
    const Joints<3> q = test::random_joints(robot, random);
    const TipLoad load = k % 4 < 2 ? TipLoad{} : test::random_load(random, 0.2, k % 8 < 4 ? 0.005 : 0);
    Workspace<3> ws;
    Solution<3> solution;
    const Model<3> model(robot);
    const Settings settings{.steps = 16};
    if (solve(model, q, load, ws, solution, settings) != Status::ok) continue;
    const WeakestPlace weakest = weakest_place(model, q, load, ws, settings);
    EXPECT_LE(weakest.determinant, solution.stability + 1e-7) << k;
    if (weakest.s == q.beta[0]) {
      EXPECT_NEAR(weakest.determinant, solution.stability, 1e-7) << k;
      ++compared;
    }
  }
  EXPECT_GT(compared, 10);
}

TEST(WeakestPlace, ColumnBucklesAtEulersLoad) {
  // Clamped at the plate, pushed at the free end: each of two bending directions has cos(sqrt(F/EI) L), which vanishes
  // at F = (pi/2)^2 EI / L^2. Both at once only touch zero.
  Robot<1> robot;
  robot.tubes[0] = test::paper_robot().tubes[0];
  robot.tubes[0].curvature = 0;
  constexpr double length = 0.2;
  Joints<1> q;
  q.beta << length - robot.tubes[0].length;
  const double quarter = std::numbers::pi / 2, EI = robot.tubes[0].EI();
  const double euler = quarter * quarter * EI / (length * length);
  for (const double part : {0.1, 0.5, 0.9, 0.98, 1.0, 1.3}) {
    const TipLoad push{.force = Vec3(0, 0, -part * euler), .moment = Vec3::Zero()};
    const WeakestPlace weakest = weakest_place(Model<1>(robot), q, push, Workspace<1>{}, {.steps = 64});
    const double cosine = part < 1 ? std::cos(std::sqrt(part) * quarter) : 0;
    EXPECT_NEAR(weakest.determinant, cosine * cosine, 2e-4) << part;
  }
}

/// Angle at the base by that at the tip, by fine integration of psi'' = c sin psi.
double base_angle(const Pair& pair, double tip) {
  constexpr int steps = 2000;
  const double h = pair.robot.tubes[0].curved_length / steps;
  double psi = tip, rate = 0;
  for (int k = 0; k < steps; ++k) {  // Stormer-Verlet
    rate += 0.5 * h * pair.c * std::sin(psi);
    psi += h * rate;
    rate += 0.5 * h * pair.c * std::sin(psi);
  }
  return psi + rate * (pair.robot.tubes[0].length - pair.robot.tubes[0].curved_length);
}

TEST(SnapMargin, OfTwoTubesIsThatOfTheTorsionEquation) {
  for (const double transmission : {0.15, 0.3, 0.5}) {
    Pair pair(transmission);
    ASSERT_LT(pair.determinant(), -0.1);
    double fold = 0;
    for (double tip = 0; tip < std::numbers::pi; tip += 1e-3) fold = std::max(fold, base_angle(pair, tip));
    for (const double relative : {0.0, 1.0, -2.5}) {
      pair.q.alpha << 0.2, 0.2 + relative;
      Workspace<2> ws;
      Solution<2> solution;
      const Model<2> model(pair.robot);
      ASSERT_EQ(solve(model, pair.q, {}, ws, solution), Status::ok);
      const SnapMargin margin = snap_margin(model, pair.q, {}, ws);
      EXPECT_EQ(margin.tube, 1);
      EXPECT_NEAR(margin.angle / ((relative < 0 ? -fold : fold) - relative), 1, 1e-3);
    }
  }
}

TEST(SnapMargin, IsInfiniteWhereNoRotationSnaps) {
  Pair pair(0.02);
  ASSERT_GT(pair.determinant(), 0);
  pair.q.alpha << 0.2, 2.9;
  Workspace<2> ws;
  Solution<2> solution;
  const Model<2> model(pair.robot);
  ASSERT_EQ(solve(model, pair.q, {}, ws, solution), Status::ok);
  EXPECT_TRUE(std::isinf(snap_margin(model, pair.q, {}, ws).angle));
}

TEST(SnapMargin, MarksWhereTheSolutionTurnsSingular) {
  test::Random random(3);
  int snapped = 0;
  for (int k = 0; k < 200 && snapped < 6; ++k) {
    Robot<2> robot = test::random_robot<2>(random);
    for (Tube& tube : robot.tubes) tube.curvature *= 2;
    const Joints<2> q = test::random_joints(robot, random);
    const TipLoad load = k % 2 == 0 ? TipLoad{} : test::random_load(random, 0.1);
    Workspace<2> ws;
    Solution<2> solution;
    const Model<2> model(robot);
    const Settings settings{.steps = 8};
    if (solve(model, q, load, ws, solution, settings) != Status::ok) continue;
    const SnapMargin margin = snap_margin(model, q, load, ws, settings);
    if (!std::isfinite(margin.angle)) continue;
    ++snapped;
    // Walk there: the determinant falls like the square root of what is left.
    Joints<2> near = q;
    for (int j = 1; j <= 200; ++j) {
      near.alpha[1] = q.alpha[1] + margin.angle * (1 - 1e-4) * j / 200;
      (void)solve<Derivatives::jacobian>(model, near, load, ws, solution, settings);
    }
    const double close = solution.stability;
    near.alpha[1] = q.alpha[1] + margin.angle * (1 - 1e-6);
    (void)solve<Derivatives::jacobian>(model, near, load, ws, solution, settings);
    EXPECT_NEAR(solution.stability / close, 0.1, 0.02) << k;
  }
  EXPECT_GE(snapped, 3);
}

}  // namespace stability_test
}  // namespace ctcr
