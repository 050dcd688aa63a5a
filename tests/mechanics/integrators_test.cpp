// The textbook schemes have the order they are named after, and solve to the same robot as the default.
#include "ctcr/mechanics/integrators.hpp"

#include <gtest/gtest.h>

#include "support/random_robots.hpp"
#include "support/solver.hpp"

namespace ctcr {
namespace integrators_test {

template <class Tableau>
double node(std::size_t i) {
  double c = 0;
  for (const double a : Tableau::a[i]) c += a;
  return c;
}

template <class Tableau>
class ButcherTableau : public testing::Test {};
using Tableaux = testing::Types<SspRk3Tableau, ClassicalRk4Tableau, PrinceDormandTableau>;
TYPED_TEST_SUITE(ButcherTableau, Tableaux);

TYPED_TEST(ButcherTableau, WeightsIntegratePolynomials) {
  for (int power = 0; power < TypeParam::order; ++power) {
    double sum = 0;
    for (std::size_t i = 0; i < TypeParam::stages; ++i) sum += TypeParam::b[i] * std::pow(node<TypeParam>(i), power);
    EXPECT_NEAR(sum, 1.0 / (power + 1), 1e-14);
  }
}

TYPED_TEST(ButcherTableau, IntegratesLinearEquations) {
  // b^T A^k 1 = 1/(k+1)!
  std::array<double, TypeParam::stages> power, next;
  power.fill(1);
  double factorial = 1;
  for (int k = 0; k < TypeParam::order; ++k) {
    factorial *= k + 1;
    double sum = 0;
    for (std::size_t i = 0; i < TypeParam::stages; ++i) {
      sum += TypeParam::b[i] * power[i];
      next[i] = 0;
      for (std::size_t j = 0; j < i; ++j) next[i] += TypeParam::a[i][j] * power[j];
    }
    EXPECT_NEAR(sum * factorial, 1, 1e-13);
    power = next;
  }
}

TEST(PrinceDormand, StagesAreConsistentToThirdOrder) {
  using T = PrinceDormandTableau;
  for (std::size_t i = 3; i < T::stages; ++i) {
    double first = 0, second = 0;
    for (std::size_t j = 0; j < i; ++j) {
      first += T::a[i][j] * node<T>(j);
      second += T::a[i][j] * node<T>(j) * node<T>(j);
    }
    const double c = node<T>(i);
    EXPECT_NEAR(first, c * c / 2, 1e-14) << i;
    EXPECT_NEAR(second, c * c * c / 3, 1e-14) << i;
  }
}

/// End of a heavy, loaded rod of two curved tubes, as one vector.
template <class Stepper, bool Loaded>
Eigen::VectorXd rod_end(int steps) {
  const RodSection<double, double, 2> section{.a = {0.09, 0.07},
                                              .rho = {8.0, 5.0},
                                              .kz = {0.011, 0.014},
                                              .compliance = 1 / 0.03,
                                              .weight = 0.02,
                                              .straight_mz = 0.002};
  RodState<double, 2> y{
      .psi = {0.3, 2.1}, .w = {1.5, -0.8}, .m = {0.02, -0.01}, .n = {0.1, 0.05, -0.2}, .g = {3, -5, 7.8}};
  Frame<double> frame;
  const double k = -0.3 / steps;
  for (int i = 0; i < steps; ++i) {
    if constexpr (Loaded)
      Stepper::template loaded<true>(section, y, frame, k);
    else
      Stepper::unloaded(section, y, frame, k);
  }
  Eigen::VectorXd end(24);
  end << y.psi[0], y.psi[1], y.w[0], y.w[1], y.m[0], y.m[1], y.n[0], y.n[1], y.n[2], y.g[0], y.g[1], y.g[2],
      frame.rotation().reshaped(), frame.position();
  return end;
}

template <class Stepper, bool Loaded>
double measured_order(int steps, const Eigen::VectorXd& exact) {
  const double coarse = (rod_end<Stepper, Loaded>(steps) - exact).norm();
  const double fine = (rod_end<Stepper, Loaded>(2 * steps) - exact).norm();
  return std::log2(coarse / fine);
}

TEST(Integrators, ConvergeWithTheirOrder) {
  const Eigen::VectorXd loaded = rod_end<PrinceDormand8, true>(200), unloaded = rod_end<PrinceDormand8, false>(200);
  EXPECT_LT((rod_end<MagnusRk4, true>(4000) - loaded).norm(), 1e-11);
  EXPECT_LT((rod_end<MagnusRk4, false>(4000) - unloaded).norm(), 1e-11);
  EXPECT_NEAR((measured_order<SspRk3, true>(100, loaded)), 3, 0.1);
  EXPECT_NEAR((measured_order<SspRk3, false>(100, unloaded)), 3, 0.1);
  EXPECT_NEAR((measured_order<ClassicalRk4, true>(100, loaded)), 4, 0.1);
  EXPECT_NEAR((measured_order<ClassicalRk4, false>(100, unloaded)), 4, 0.1);
  EXPECT_GT((measured_order<PrinceDormand8, true>(5, loaded)), 7.5);
  EXPECT_GT((measured_order<PrinceDormand8, false>(5, unloaded)), 7.5);
}

template <class Stepper>
void solves_to_the_same_robot(int steps, double pose_error, double jacobian_error) {
  test::Random random(7);
  for (int k = 0; k < 12; ++k) {
    Robot<2> robot = test::random_robot<2>(random);
    if (k % 3 == 0) robot.gravity << 0, 6, -7;
    const Model<2> model(robot);
    const Joints<2> q = test::random_joints(robot, random, 0.1);
    const TipLoad load = k % 2 == 0 ? TipLoad{} : test::random_load(random, 0.2, k % 4 == 1 ? 0.005 : 0);
    Workspace<2> ws_wanted, ws;
    Solution<2> wanted, found;
    const Status status =
        solve<Derivatives::jacobian>(model, q, load, ws_wanted, wanted, {.steps = 64, .accuracy = test::as_told});
    ASSERT_EQ((solve<Derivatives::jacobian, Stepper>(model, q, load, ws, found, {.steps = steps})), status) << k;
    EXPECT_LT((found.position - wanted.position).norm(), pose_error) << k;
    EXPECT_LT((found.rotation - wanted.rotation).norm(), 10 * pose_error) << k;
    EXPECT_LT((found.jacobian - wanted.jacobian).norm(), jacobian_error * wanted.jacobian.norm()) << k;
  }
}

TEST(Integrators, SolveToTheSameRobot) {
  solves_to_the_same_robot<SspRk3>(400, 1e-7, 1e-5);
  solves_to_the_same_robot<ClassicalRk4>(64, 1e-8, 1e-6);
  solves_to_the_same_robot<PrinceDormand8>(4, 1e-8, 1e-6);
}

}  // namespace integrators_test
}  // namespace ctcr
