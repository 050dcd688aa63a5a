// Compilers without vectors compute the same robot.
#include <gtest/gtest.h>

#include <algorithm>

#include "scalar.hpp"
#include "support/cases.hpp"
#include "support/random_robots.hpp"
#include "support/solver.hpp"

namespace ctcr {
namespace scalar_lanes_test {

#include "model_to_numbers.hpp"

using test::Random;

TEST(ScalarLanes, EqualVectorLanes) {
  Random random(101);
  const Robot<3> robot = test::paper_robot();
  int compared = 0;
  for (int n = 0; n < test::cases(200); ++n) {
    const Joints<3> q = test::random_joints(robot, random, 0.1);
    const TipLoad tip = test::random_load(random, n % 4 == 0 ? 0 : 0.3, n % 4 == 2 ? 0.01 : 0);
    const Vec3 g = n % 4 == 3 ? Vec3(1, -9, 3) : Vec3(0, 0, 0);
    const double joints[6] = {q.beta[0], q.beta[1], q.beta[2], q.alpha[0], q.alpha[1], q.alpha[2]};
    const double load[6] = {tip.force[0], tip.force[1], tip.force[2], tip.moment[0], tip.moment[1], tip.moment[2]};
    const double gravity[3] = {g[0], g[1], g[2]};
    double vector[ctcr_scalar_build::result_size], scalar[ctcr_scalar_build::result_size];
    const bool with_compliance = n % 2 == 1;
    solve_to_numbers(joints, load, gravity, with_compliance, vector);
    ctcr_scalar_build::solve_paper_robot(joints, load, gravity, with_compliance, scalar);
    EXPECT_EQ(vector[0], scalar[0]);
    // Near a bifurcation rounding decides, and derivatives magnify it.
    if (vector[0] != 0 || vector[ctcr_scalar_build::result_size - 1] < 0.1) continue;
    ++compared;
    double size = 1;
    for (const double x : vector) size = std::max(size, std::abs(x));
    for (int i = 0; i < ctcr_scalar_build::result_size; ++i)
      ASSERT_NEAR(vector[i], scalar[i], (i < 13 ? 1e-9 : 1e-7 * size)) << "case " << n << ", number " << i;
  }
  EXPECT_GT(compared, test::cases(200) / 2);
}

}  // namespace scalar_lanes_test
}  // namespace ctcr
