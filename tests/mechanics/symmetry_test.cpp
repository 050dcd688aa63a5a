// What physics does not care about: where x points, how long a metre is; and loads that fade away.
#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace symmetry_test {

using test::Random, test::uniform;
constexpr Derivatives all = Derivatives::compliance;

template <class T>
struct Symmetry : testing::Test {};
TYPED_TEST_SUITE(Symmetry, test::TubeCounts);

template <int N>
test::Case<N> heavy_case(Random& random) {
  return test::smooth_case<N>(random, 0.2, 0.005, test::tilted_gravity);
}

TYPED_TEST(Symmetry, TurningBasesAndLoadsTurnsTheRobot) {
  constexpr int N = TypeParam::N;
  Random random(11);
  for (int n = 0; n < test::cases(30); ++n) {
    test::Case<N> c = heavy_case<N>(random);
    if (n % 3 == 1) c.robot.gravity.setZero();
    const Solution<N> before = test::solved<all>(c.robot, c.q, c.load);
    const double angle = uniform(random, -3, 3);
    const Mat3 Rz = rotation_z(angle);
    c.q.alpha.array() += angle;
    c.robot.gravity = Rz * c.robot.gravity;
    c.load = {Rz * c.load.force, Rz * c.load.moment};
    const Solution<N> after = test::solved<all>(c.robot, c.q, c.load);
    EXPECT_LT((after.position - Rz * before.position).norm(), 1e-10);
    EXPECT_LT((after.rotation - Rz * before.rotation).norm(), 1e-9);
    EXPECT_LT((after.jacobian - test::twice(Rz) * before.jacobian).norm(), 1e-8 * before.jacobian.norm());
    EXPECT_LT((after.compliance - test::twice(Rz) * before.compliance * test::twice(Rz).transpose()).norm(),
              1e-8 * before.compliance.norm());
    EXPECT_NEAR(after.stability, before.stability, 1e-8);
  }
}

TYPED_TEST(Symmetry, WithoutLoadTurningOneMoreTimeAround) {
  constexpr int N = TypeParam::N;
  Random random(12);
  for (int n = 0; n < test::cases(30); ++n) {
    const test::Case<N> c = test::smooth_case<N>(random, 0, 0, Vec3::Zero());
    const Solution<N> before = test::solved<Derivatives::jacobian>(c.robot, c.q, {});
    Joints<N> q = c.q;
    q.alpha.array() += 2 * std::numbers::pi;
    const Solution<N> after = test::solved<Derivatives::jacobian>(c.robot, q, {});
    EXPECT_LT(test::difference(before.pose(), after.pose()).norm(), 1e-11);
    // Turning all bases turns the robot about z.
    const Vec6 turn = before.jacobian.template rightCols<N>().rowwise().sum();
    Vec6 expected;
    expected << Vec3::UnitZ().cross(before.position), Vec3::UnitZ();
    EXPECT_LT((turn - expected).norm(), 1e-10);
  }
}

TYPED_TEST(Symmetry, LengthsAndForcesScale) {
  constexpr int N = TypeParam::N;
  Random random(13);
  for (int n = 0; n < test::cases(30); ++n) {
    const test::Case<N> c = heavy_case<N>(random);
    const double length = uniform(random, 0.5, 2), force = uniform(random, 0.3, 3);
    test::Case<N> scaled = c;
    for (Tube& tube : scaled.robot.tubes) {
      tube.youngs_modulus *= force / (length * length);
      tube.density *= force / (length * length * length);
      tube.inner_diameter *= length;
      tube.outer_diameter *= length;
      tube.length *= length;
      tube.curved_length *= length;
      tube.curvature /= length;
    }
    scaled.q.beta *= length;
    scaled.load = {force * c.load.force, force * length * c.load.moment};
    const Solution<N> a = test::solved<all>(c.robot, c.q, c.load);
    const Solution<N> b = test::solved<all>(scaled.robot, scaled.q, scaled.load);
    EXPECT_LT((b.position - length * a.position).norm(), 1e-10);
    EXPECT_LT((b.rotation - a.rotation).norm(), 1e-9);
    EXPECT_LT(
        (b.compliance.template topLeftCorner<3, 3>() * (force / length) - a.compliance.template topLeftCorner<3, 3>())
            .norm(),
        1e-8 * a.compliance.norm());
    EXPECT_NEAR(b.stability, a.stability, 1e-8);
  }
}

TYPED_TEST(Symmetry, AVanishingLoadLeavesTheUnloadedRobot) {
  constexpr int N = TypeParam::N;
  Random random(14);
  for (int n = 0; n < test::cases(20); ++n) {
    const test::Case<N> c = test::smooth_case<N>(random, 0, 0, Vec3::Zero());
    const TipLoad tiny{{1e-13, 0, 0}, {0, 1e-15, 0}};
    for (const auto& [steps, position, jacobian] : {std::tuple{64, 1e-9, 1e-7}, std::tuple{1, 5e-4, 2e-2}}) {
      const Solution<N> unloaded = test::solved<Derivatives::jacobian>(c.robot, c.q, {}, steps);
      const Solution<N> loaded = test::solved<Derivatives::jacobian>(c.robot, c.q, tiny, steps);
      EXPECT_EQ(loaded.status, Status::ok);
      EXPECT_LT(test::difference(unloaded.pose(), loaded.pose()).template head<3>().norm(), position);
      EXPECT_LT((unloaded.jacobian - loaded.jacobian).norm(), jacobian * unloaded.jacobian.norm());
      EXPECT_NEAR(unloaded.stability, loaded.stability, jacobian * 10);
    }
  }
}

/// The same equations in another form: answers may differ by rounding alone.
template <int N>
void expect_same(const Solution<N>& a, const Solution<N>& b) {
  EXPECT_EQ(a.status, b.status);
  EXPECT_LT(test::difference(a.pose(), b.pose()).norm(), 1e-9);
  EXPECT_LT((a.jacobian - b.jacobian).norm(), 1e-8 * a.jacobian.norm());
  EXPECT_LT((a.compliance - b.compliance).norm(), 1e-8 * a.compliance.norm());
  EXPECT_NEAR(a.stability, b.stability, 1e-8);
}

TYPED_TEST(Symmetry, AVanishingMomentLeavesTheForceAlone) {
  constexpr int N = TypeParam::N;
  Random random(15);
  for (int n = 0; n < test::cases(20); ++n) {
    test::Case<N> c = test::smooth_case<N>(random, 0.2, 0, Vec3::Zero());
    const Solution<N> force = test::solved<all>(c.robot, c.q, c.load);
    c.load.moment = Vec3(0, 1e-15, 0);
    expect_same(force, test::solved<all>(c.robot, c.q, c.load));
  }
}

/// In the limit the robot is the weightless one.
TYPED_TEST(Symmetry, VanishingWeight) {
  constexpr int N = TypeParam::N;
  Random random(16);
  for (int n = 0; n < test::cases(20); ++n) {
    test::Case<N> c = test::smooth_case<N>(random, 0.2, 0.005, Vec3::Zero());
    const Solution<N> weightless = test::solved<all>(c.robot, c.q, c.load);
    c.robot.gravity = Vec3(0, 1e-12, 0);
    expect_same(weightless, test::solved<all>(c.robot, c.q, c.load));
  }
}

}  // namespace symmetry_test
}  // namespace ctcr
