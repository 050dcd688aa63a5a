// Flush tips, shared breakpoints, curved starts behind the plate: no special places for the model.
#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace coincident_breakpoints_test {

using test::Random, test::uniform;

template <class T>
struct Coincident : testing::Test {};
TYPED_TEST_SUITE(Coincident, test::TubeCounts);

/// The pose is continuous there and all outputs are finite; derivatives are those of one side.
template <int N>
void expect_continuous(const Robot<N>& robot, const Joints<N>& q, const TipLoad& load, Random& random) {
  const Solution<N> at = test::solved<Derivatives::compliance>(robot, q, load);
  EXPECT_TRUE(at.position.allFinite() && at.jacobian.allFinite() && at.compliance.allFinite());
  if (at.status != Status::ok || at.stability < 0.2) return;
  Joints<N> beside = q;
  // Order-preserving: stretched away from the coincidence by picometres.
  for (int i = 0; i < N; ++i) beside.beta[i] += 1e-12 * (N - i) * uniform(random, 0, 1);
  const Solution<N> next = test::solved<Derivatives::compliance>(robot, beside, load);
  EXPECT_LT(test::difference(at.pose(), next.pose()).norm(), 1e-8);
  EXPECT_LT((at.compliance - next.compliance).norm(), 1e-6 * at.compliance.norm());
  const auto by_alpha = [](const Solution<N>& s) { return s.jacobian.template rightCols<N>().eval(); };
  EXPECT_LT((by_alpha(at) - by_alpha(next)).norm(), 1e-6 * by_alpha(at).norm());
}

TYPED_TEST(Coincident, FlushTipsAndGrasps) {
  constexpr int N = TypeParam::N;
  Random random(81);
  for (int n = 0; n < test::cases(100); ++n) {
    const Robot<N> robot = test::random_robot<N>(random);
    const Joints<N> q = test::random_joints(robot, random, 0.7);
    expect_continuous(robot, q, test::random_load(random, 0.1), random);
  }
}

TYPED_TEST(Coincident, SharedBreakpoints) {
  constexpr int N = TypeParam::N;
  Random random(82);
  for (int n = 0; n < test::cases(50); ++n) {
    Robot<N> robot = test::random_robot<N>(random);
    // Flush tips and equal curved lengths, powers of two so that sums are exact.
    Joints<N> q;
    for (int i = 0; i < N; ++i) {
      robot.tubes[std::size_t(i)].length = 0.5 - 0.0625 * i;
      robot.tubes[std::size_t(i)].curved_length = 0.03125;
      q.beta[i] = 0.125 - robot.tubes[std::size_t(i)].length;
      q.alpha[i] = uniform(random, -1, 1);
    }
    expect_continuous(robot, q, test::random_load(random, 0.1), random);
  }
}

TYPED_TEST(Coincident, ACurvedStartAtOrBehindThePlate) {
  constexpr int N = TypeParam::N;
  Random random(83);
  for (int n = 0; n < test::cases(50); ++n) {
    Robot<N> robot = test::random_robot<N>(random);
    const Joints<N> q = test::random_joints(robot, random);
    for (int i = 0; i < N; ++i) {
      Tube& tube = robot.tubes[std::size_t(i)];
      const double deployed = tube.length + q.beta[i];
      tube.curved_length = n % 2 == 0 ? deployed : std::min(tube.length, deployed + 0.02);
      tube.curvature = 2;
    }
    expect_continuous(robot, q, test::random_load(random, 0.1), random);
  }
}

/// Do not matter.
TYPED_TEST(Coincident, CurvesBehindThePlate) {
  constexpr int N = TypeParam::N;
  Random random(84);
  for (int n = 0; n < test::cases(50); ++n) {
    Robot<N> robot = test::random_robot<N>(random);
    const Joints<N> q = test::random_joints(robot, random);
    for (int i = 0; i < N; ++i) {
      Tube& tube = robot.tubes[std::size_t(i)];
      tube.curved_length = tube.length + q.beta[i];
      tube.curvature = 2;
    }
    const TipLoad load = test::random_load(random, 0.1);
    const Solution<N> before = test::solved<Derivatives::compliance>(robot, q, load);
    for (Tube& tube : robot.tubes) tube.curved_length = tube.length;
    const Solution<N> after = test::solved<Derivatives::compliance>(robot, q, load);
    EXPECT_LT(test::difference(before.pose(), after.pose()).norm(), 1e-9);
    EXPECT_LT((before.jacobian.template rightCols<N>() - after.jacobian.template rightCols<N>()).norm(), 1e-7);
  }
}

TEST(Retracted, EndsAtThePlate) {
  const Robot<3> robot = test::paper_robot();
  const Joints<3> q{{-0.463, -0.3305, -0.199}, {0.5, 1.0, -2.0}};
  const Solution<3> s = test::solved<Derivatives::compliance>(robot, q, {.force = {0, -0.1, 0}});
  EXPECT_EQ(s.status, Status::ok);
  EXPECT_LT(test::difference({rotation_z(0.5), Vec3::Zero()}, s.pose()).norm(), 1e-12);
  EXPECT_TRUE(s.jacobian.allFinite() && s.compliance.allFinite());
}

}  // namespace coincident_breakpoints_test
}  // namespace ctcr
