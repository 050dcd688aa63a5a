// J and C are derivatives of the pose that solve() returns: held against differences of that pose.
#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace derivatives_test {

using test::Random;
constexpr int fine = 16;

template <class T>
struct TipDerivative : testing::Test {};
TYPED_TEST_SUITE(TipDerivative, test::TubeCounts);

/// Solves near a solution, from its warm start, more tightly than any difference can feel.
template <int N, Derivatives D = Derivatives::none>
class Nearby {
public:
  explicit Nearby(const test::Case<N>& c, int steps = fine) : model_(c.robot), c_(c), steps_(steps) {
    pose(c.q, c.load);
  }

  Pose pose(const Joints<N>& q, const TipLoad& load) {
    Workspace<N> ws = ws_;
    Solution<N> solution;
    (void)solve<D>(model_, q, load, ws, solution, {.tolerance = 1e-13, .steps = steps_, .accuracy = test::as_told});
    EXPECT_LT(solution.residual, 1e-11);
    if (!ws_.warm) ws_ = ws;
    return solution.pose();
  }
  /// d pose / d joint `column`, columns as in J; `expected` sets the size of the differences.
  Vec6 by_joint(int column, const Vec6& expected) {
    return test::slope(
        [&](double t) {
          Joints<N> q = c_.q;
          (column < N ? q.beta[column] : q.alpha[column - N]) += t;
          return pose(q, c_.load);
        },
        std::min(column < N ? 1e-4 : 1e-3, step(expected)));
  }
  /// d pose / d load `column`, columns as in C.
  Vec6 by_load(int column, const Vec6& expected) {
    return test::slope(
        [&](double t) {
          TipLoad load = c_.load;
          (column < 3 ? load.force[column] : load.moment[column - 3]) += t;
          return pose(c_.q, load);
        },
        std::min(column < 3 ? 1e-3 : 1e-4, step(expected)));
  }

private:
  /// Moves the tip by about 1e-3 (m, rad): rounding then is 1e-9 of it, and so is what fourth order leaves out.
  static double step(const Vec6& slope) { return 1e-3 / (slope.norm() + 1e-9); }

  Model<N> model_;
  test::Case<N> c_;
  int steps_;
  Workspace<N> ws_;
};

template <int N>
void expect_jacobian(const test::Case<N>& c, const Solution<N>& solution) {
  Nearby<N> near(c);
  Eigen::Matrix<double, 6, 2 * N> J;
  for (int j = 0; j < 2 * N; ++j) J.col(j) = near.by_joint(j, solution.jacobian.col(j));
  EXPECT_LT((solution.jacobian - J).cwiseAbs().maxCoeff(), 1e-6 * J.cwiseAbs().maxCoeff());
}

template <int N>
void expect_compliance(const test::Case<N>& c, const Solution<N>& solution) {
  Nearby<N> near(c);
  Mat6 C;
  for (int j = 0; j < 6; ++j) C.col(j) = near.by_load(j, solution.compliance.col(j));
  // Moments move the tip far more per unit than forces: each column against its own size.
  for (int j = 0; j < 6; ++j)
    EXPECT_LT((solution.compliance - C).col(j).cwiseAbs().maxCoeff(), 1e-6 * C.col(j).cwiseAbs().maxCoeff() + 1e-12);
}

template <int N>
void expect_derivatives(double max_force, double max_moment, const Vec3& gravity, unsigned seed) {
  Random random(seed);
  for (int n = 0; n < test::cases(8); ++n) {
    const test::Case<N> c = test::smooth_case<N>(random, max_force, max_moment, gravity);
    const Solution<N> with_J = test::solved<Derivatives::jacobian>(c.robot, c.q, c.load, fine);
    const Solution<N> with_C = test::solved<Derivatives::compliance>(c.robot, c.q, c.load, fine);
    expect_jacobian(c, with_J);
    EXPECT_LT((with_J.jacobian - with_C.jacobian).norm(), 1e-7 * with_J.jacobian.norm());
    if (max_force > 0 || !gravity.isZero()) expect_compliance(c, with_C);
  }
}

TYPED_TEST(TipDerivative, Unloaded) { expect_derivatives<TypeParam::N>(0, 0, Vec3::Zero(), 21); }
TYPED_TEST(TipDerivative, UnderForce) { expect_derivatives<TypeParam::N>(0.3, 0, Vec3::Zero(), 22); }
TYPED_TEST(TipDerivative, UnderForceAndMoment) { expect_derivatives<TypeParam::N>(0.3, 0.01, Vec3::Zero(), 23); }
TYPED_TEST(TipDerivative, UnderWeight) { expect_derivatives<TypeParam::N>(0, 0, test::tilted_gravity, 24); }
TYPED_TEST(TipDerivative, UnderWeightForceAndMoment) {
  expect_derivatives<TypeParam::N>(0.3, 0.01, test::tilted_gravity, 25);
}

TYPED_TEST(TipDerivative, ComplianceOfAnUnloadedRobot) {
  constexpr int N = TypeParam::N;
  Random random(26);
  for (int n = 0; n < test::cases(8); ++n) {
    const test::Case<N> c = test::smooth_case<N>(random, 0, 0, Vec3::Zero());
    Nearby<N> near(c);
    const Solution<N> solution = test::solved<Derivatives::compliance>(c.robot, c.q, {}, fine);
    // Differences cross from force to force through the unloaded path, which integrates more exactly.
    for (int j = 0; j < 6; ++j) {
      const Vec6 slope = near.by_load(j, solution.compliance.col(j));
      EXPECT_LT((solution.compliance.col(j) - slope).norm(), 1e-4 * slope.norm() + 1e-12);
    }
  }
}

/// Where the loads have a potential.
TYPED_TEST(TipDerivative, ComplianceIsSymmetric) {
  constexpr int N = TypeParam::N;
  Random random(27);
  for (int n = 0; n < test::cases(20); ++n) {
    const bool weight = n % 2 == 1;
    const test::Case<N> c = test::smooth_case<N>(random, 0.3, 0, weight ? test::tilted_gravity : Vec3(0, 0, 0));
    const Mat6 C = test::solved<Derivatives::compliance>(c.robot, c.q, c.load, 64).compliance;
    const auto asymmetry = [](const auto& M) { return (M - M.transpose()).norm() / M.norm(); };
    EXPECT_LT(asymmetry(C.topLeftCorner<3, 3>()), 1e-6);
    // A moment of constant direction has no potential, but at zero moment its work is symmetric, too.
    EXPECT_LT(asymmetry(C), 1e-6);
  }
}

template <class T>
struct CoarseJacobian : testing::Test {};
TYPED_TEST_SUITE(CoarseJacobian, test::OneToFiveTubes);

/// However coarse the integration is: J belongs to the map that is solved, not to the finer one it stands for. Held
/// against 1 for beta and against the robot's length for alpha; turns of the tip count at the robot's length.
TYPED_TEST(CoarseJacobian, IsThatOfTheDiscreteMap) {
  constexpr int N = TypeParam::N;
  constexpr auto D = Derivatives::jacobian;  // all solves, so that five tubes are compiled once
  Random random(28 + N);
  int compared = 0;
  for (int n = 0; n < test::cases(60); ++n) {
    const int steps = 1 + n % 3, kind = n % 4;  // unloaded, force, force and moment, all with weight
    test::Case<N> c{test::random_robot<N>(random), {}, {}};
    if (kind > 0) c.load = test::random_load(random, 0.3, kind > 1 ? 0.01 : 0);
    if (kind > 2) c.robot.gravity = test::tilted_gravity;
    c.q = test::random_joints(c.robot, random);
    if (test::smallest_gap(c.robot, c.q) < 5e-4) continue;
    const Solution<N> solution = test::solved<D>(c.robot, c.q, c.load, steps);
    if (solution.status != Status::ok || solution.stability < 0.1) continue;
    ++compared;
    Nearby<N, D> near(c, steps);
    const double length = c.robot.tubes[0].length;
    for (int j = 0; j < 2 * N; ++j) {
      Vec6 error = solution.jacobian.col(j) - near.by_joint(j, solution.jacobian.col(j));
      error.template tail<3>() *= length;
      EXPECT_LT(error.norm(), 1e-6 * (j < N ? 1 : length)) << "case " << n << ", column " << j;
    }
  }
  EXPECT_GT(compared, test::cases(60) / 3);
}

}  // namespace derivatives_test
}  // namespace ctcr
