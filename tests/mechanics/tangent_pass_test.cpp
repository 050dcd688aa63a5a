// The separate tangents (tangent_pass.hpp) and values and tangents carried together (steppers.hpp with duals) are one map.
#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace tangent_pass_test {

using test::Random, test::uniform;

template <class T>
struct TangentPass : testing::Test {};
TYPED_TEST_SUITE(TangentPass, test::TwoAndThreeTubes);

/// Values of all entries in comparable rows, each row with its own scale.
template <class Ev>
void expect_equal(const Ev& a, const Ev& b) {
  using Col = typename Ev::Col;
  constexpr double relative = 1e-12;
  EXPECT_LT((a.position - b.position).norm(), relative);
  EXPECT_LT((a.rotation - b.rotation).norm(), relative);
  EXPECT_LT((a.angle_error - b.angle_error).norm(), relative * (1 + a.angle_error.norm()));
  EXPECT_NEAR(a.det, b.det, relative * (1 + std::abs(a.det)) * 100);
  // Elimination divides by pivots and so multiplies rounding.
  const double ill = 1 + 1 / std::max(std::abs(a.det), 1e-3);
  for (int r = 0; r < Ev::rows; ++r) {
    double size = 0;
    for (int lane = 0; lane < 4 * Col::system_groups; ++lane) size = std::max(size, std::abs(a.row[r][lane]));
    for (int lane = 0; lane < 4 * Col::system_groups; ++lane)
      EXPECT_NEAR(a.row[r][lane], b.row[r][lane], relative * ill * (1 + size)) << "row " << r << " lane " << lane;
  }
}

template <Derivatives D, Loading L, int N>
void expect_pass_equals_direct(unsigned seed) {
  Random random(seed);
  for (int n = 0; n < test::cases(60); ++n) {
    Robot<N> robot = test::random_robot<N>(random);
    if (L == Loading::weight && n % 2 == 0) robot.gravity = test::random_vector(random, 10);
    const Joints<N> q = test::random_joints(robot, random, 0.1);
    const TipLoad load = test::random_load(random, 0.3, L == Loading::force ? 0 : 0.01);
    TipGuess<N> guess;
    guess.rotation = rotation_matrix(test::random_vector(random, 3));
    for (int i = 1; i < N; ++i) guess.psi[i] = uniform(random, -3, 3);
    const int steps = 1 + n % 3;
    Evaluation<N, L, D> separate, direct;
    evaluate<D, L, MagnusRk4>(make_coefficients(robot), q, load, guess, Steps<N>(steps), separate);
    evaluate<D, L, DirectMagnusRk4>(make_coefficients(robot), q, load, guess, Steps<N>(steps), direct);
    expect_equal(direct, separate);
    if (testing::Test::HasFailure()) FAIL() << "case " << n << " seed " << seed;
  }
}

TYPED_TEST(TangentPass, Unloaded) {
  expect_pass_equals_direct<Derivatives::none, Loading::none, TypeParam::N>(41);
  expect_pass_equals_direct<Derivatives::jacobian, Loading::none, TypeParam::N>(42);
}

template <Loading L, int N>
void expect_all_derivatives(unsigned seed) {
  expect_pass_equals_direct<Derivatives::none, L, N>(seed);
  expect_pass_equals_direct<Derivatives::jacobian, L, N>(seed + 1);
  expect_pass_equals_direct<Derivatives::compliance, L, N>(seed + 2);
}

TYPED_TEST(TangentPass, UnderForce) { expect_all_derivatives<Loading::force, TypeParam::N>(43); }
TYPED_TEST(TangentPass, UnderAnyLoad) { expect_all_derivatives<Loading::weight, TypeParam::N>(49); }

}  // namespace tangent_pass_test
}  // namespace ctcr
