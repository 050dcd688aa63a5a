// Tips solved four at a time, against Newton's method on each.
#include "ctcr/mechanics/neighbours.hpp"

#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace neighbours_test {

using test::Random, test::uniform;

template <class T>
struct NeighboursOf : testing::Test {};
TYPED_TEST_SUITE(NeighboursOf, test::TubeCounts);

template <int N>
Robot<N> varied(Robot<N> robot, Random& random) {
  for (Tube& tube : robot.tubes) {
    tube.youngs_modulus *= uniform(random, 0.9, 1.1);
    tube.curvature *= uniform(random, 0.95, 1.05);
    tube.length += uniform(random, -1e-3, 1e-3);
    tube.curved_length = std::min(tube.curved_length + uniform(random, -1e-3, 1e-3), tube.length);
  }
  return robot;
}

template <int N, Loading L>
void expect_newtons_tips(double max_force, const Vec3& gravity) {
  Random random(7);
  int found = 0, all = 0;
  for (int n = 0; n < test::cases(30); ++n) {
    const test::Case<N> c = test::smooth_case<N>(random, max_force, 0, gravity);
    const Model<N> model(c.robot);
    const auto tube = std::size_t(n % N);
    Workspace<N> ws;
    Solution<N> solution;
    ASSERT_EQ(solve(model, c.q, c.load, ws, solution, {.accuracy = test::as_told}), Status::ok);
    const Neighbours<N, L> around({model.coefficients(), c.q}, c.load.force, solution, ws.guess, int(tube), 1);
    std::array<Neighbour<N>, lane_count> robots;
    std::array<NeighbourTip, lane_count> exact;
    std::vector<Model<N>> models;
    models.reserve(lane_count);
    for (std::size_t i = 0; i < lane_count; ++i) {
      models.emplace_back(varied(c.robot, random));
      Joints<N> q = c.q;
      for (int k = 0; k < N; ++k) q.alpha[k] += uniform(random, -0.05, 0.05);
      robots[i] = {models[i].coefficients(), q};
      Workspace<N> own = ws;
      exact[i].solved =
          solve(models[i], q, c.load, own, solution, {.tolerance = 1e-12, .accuracy = test::as_told}) == Status::ok;
      exact[i].position = solution.tube_tips[tube].position;
      if (!exact[i].solved || !robots[i].comparable(robots[0])) robots[i] = robots[0], exact[i] = exact[0];
    }
    if (!exact[0].solved) continue;
    const auto tips = around.solve(robots);
    for (std::size_t i = 0; i < lane_count; ++i) {
      ++all;
      found += tips[i].solved;
      const double off = (exact[i].position - tips[i].position).norm();
      EXPECT_LT(tips[i].solved ? off : 0, 1e-7) << "case " << n;
      EXPECT_LE(tips[i].evaluations, 12);
    }
  }
  EXPECT_GT(all, 60);
  EXPECT_GT(found, 0.95 * all);
}

TYPED_TEST(NeighboursOf, HaveNewtonsTips) {
  constexpr int N = TypeParam::N;
  expect_newtons_tips<N, Loading::none>(0, Vec3::Zero());
  expect_newtons_tips<N, Loading::force>(0.3, Vec3::Zero());
  expect_newtons_tips<N, Loading::weight>(0.3, test::tilted_gravity);
}

TEST(Neighbours, TheSolvedRobotIsFoundAtOnce) {
  const Model<3> model(test::paper_robot());
  const Joints<3> q{{-0.2, -0.15, -0.1}, {0.4, -0.8, 2.0}};
  const TipLoad load{{0.05, -0.1, 0.02}, Vec3::Zero()};
  Workspace<3> ws;
  Solution<3> solution;
  ASSERT_EQ(solve(model, q, load, ws, solution), Status::ok);
  const Neighbour<3> same(model.coefficients(), q);
  const Neighbours<3, Loading::force> around(same, load.force, solution, ws.guess, 0, ws.steps);
  for (const NeighbourTip& tip : around.solve({same, same, same, same})) {
    EXPECT_TRUE(tip.solved);
    EXPECT_EQ(tip.evaluations, 1);
    EXPECT_LT((tip.position - solution.position).norm(), 1e-12);
  }
}

TEST(Neighbours, WhatIsFarAwayIsLeftToNewton) {
  const Model<3> model(test::paper_robot());
  const Joints<3> q{{-0.2, -0.15, -0.1}, {0, 0, 0}};
  Joints<3> other = q;
  other.alpha = {0, 2.9, 0};
  Robot<3> strong = test::paper_robot();
  for (Tube& tube : strong.tubes) tube.curvature = 20, tube.curved_length = 0.15;
  const Model<3> snapping(strong);
  Workspace<3> ws;
  Solution<3> solution;
  ASSERT_EQ(solve(model, q, {}, ws, solution), Status::ok);
  const Neighbours<3, Loading::none> around({model.coefficients(), q}, Vec3::Zero(), solution, ws.guess, 0, 1);
  const Neighbour<3> far(snapping.coefficients(), other);
  for (const NeighbourTip& tip : around.solve({far, far, far, far})) EXPECT_FALSE(tip.solved);
}

}  // namespace neighbours_test
}  // namespace ctcr
