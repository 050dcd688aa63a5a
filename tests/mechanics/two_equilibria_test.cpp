// A robot with two stable equilibria: which of them is found is up to the start, not to the fineness of integration.
#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace two_equilibria_test {

/// Of 10^6 random designs and configurations the one whose answers in one and in several steps lie furthest apart: 6.5
/// mm, or 4.8 % of the length.
Robot<3> bistable_robot() {
  Robot<3> robot = test::paper_robot();
  const double modulus[] = {53.0851e9, 74.1628e9, 63.4132e9};
  const double curved[] = {45.234e-3, 26.754e-3, 17.620e-3};
  const double curvature[] = {9.7002, 8.4469, 1.2283};
  for (std::size_t i = 0; i < 3; ++i) {
    robot.tubes[i].youngs_modulus = modulus[i];
    robot.tubes[i].curved_length = curved[i];
    robot.tubes[i].curvature = curvature[i];
  }
  return robot;
}

TEST(TwoEquilibria, TheStartDecidesNotTheStep) {
  const Model<3> model(bistable_robot());
  const Joints<3> q{{-0.32828, -0.21003, -0.17104}, {-1.1702, 2.0700, 1.2387}};
  const TipLoad load{{0.2436, -0.1563, 0.0513}, Vec3::Zero()};
  const TipGuess<3> starts[] = {{rotation_matrix({0.200, 0.192, -0.449}), {0, 2.253, 1.676}},
                                {rotation_matrix({-0.047, -0.089, -1.776}), {0, 4.056, 3.026}}};
  Vec3 fine[2];
  for (const int k : {0, 1}) {
    Solution<3> solution;
    Vec3 tip[2];
    for (const int steps : {1, 20}) {
      Workspace<3> ws;
      ws.begin_at(starts[k]);
      ASSERT_EQ(solve(model, q, load, ws, solution, {.steps = steps, .accuracy = test::as_told}), Status::ok);
      EXPECT_LE(solution.iterations, 5);
      EXPECT_GT(solution.stability, 0.2);
      tip[steps > 1] = solution.position;
    }
    fine[k] = tip[1];
    EXPECT_LT((tip[0] - tip[1]).norm(), 2e-5) << "equilibrium " << k;
  }
  EXPECT_GT((fine[0] - fine[1]).norm(), 6e-3);
}

}  // namespace two_equilibria_test
}  // namespace ctcr
