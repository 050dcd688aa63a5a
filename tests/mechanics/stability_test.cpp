// The test for conjugate points against eigenvalues, and against dense samples of the determinant along the robot.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <utility>

#include "support/conjugate_points.hpp"
#include "support/laws.hpp"

namespace ctcr {
namespace stability_test {

using test::Random, test::uniform;

/// (1 - t) I + t T is singular for some t in [0, 1] if and only if T has a real eigenvalue <= 0.
template <int n>
void agrees_with_eigenvalues(Random& random) {
  using Matrix = Eigen::Matrix<double, n, n>;
  int singular = 0;
  for (int k = 0; k < test::cases(1000); ++k) {
    Matrix T;
    const double spread = std::pow(10, uniform(random, -1, 0.5));
    for (double& x : T.reshaped()) x = spread * uniform(random, -1, 1);
    T += Matrix::Identity();
    bool close_call = false, has_negative = false;
    const Eigen::VectorXcd eigenvalues = Eigen::MatrixXd(T).eigenvalues();  // of any size: compiles once
    for (const std::complex<double>& x : eigenvalues) {
      close_call = close_call || (x.real() < 0.1 && std::abs(x.imag()) < 0.1 && x.imag() != 0) || std::abs(x) < 0.01;
      has_negative = has_negative || (x.imag() == 0 && x.real() < 0);
    }
    if (close_call) continue;
    singular += has_negative;
    EXPECT_EQ(detail::is_regular_to<n>(T), !has_negative) << T;
  }
  EXPECT_GT(singular, 0);
}

TEST(ConjugatePoints, AreRealNegativeEigenvalues) {
  Random random(3);
  [&]<int... n>(std::integer_sequence<int, n...>) {
    (agrees_with_eigenvalues<n + 2>(random), ...);
  }(std::make_integer_sequence<int, 6>{});
}

TEST(ConjugatePoints, TwoAtOnceCountToo) {
  EXPECT_FALSE(detail::is_regular_to<2>(Eigen::Matrix2d{{-0.5, 0}, {0, -0.5}}));
  EXPECT_TRUE(detail::is_regular_to<2>(Eigen::Matrix2d{{0, -3}, {3, 0}}));  // a half turn goes round 0
}

template <class T>
struct Stability : testing::Test {};
TYPED_TEST_SUITE(Stability, test::TubeCounts);

/// Every guess is an equilibrium, most of them unstable: of the robot with the base angles that it has, under the load that
/// turns with the tip.
template <int N, Loading L>
void agrees_with_samples(Random& random) {
  int stable = 0, unstable = 0;
  for (int k = 0; k < test::cases(100); ++k) {
    test::Case<N> c{test::random_robot<N>(random), {}, {}};
    for (Tube& tube : c.robot.tubes) tube.curvature *= 1.5;
    if (L == Loading::weight) c.load = test::random_load(random, 1, 0.02);
    c.q = test::random_joints(c.robot, random);
    const Model<N> model(c.robot);
    Workspace<N> ws;
    ws.guess.rotation = rotation_matrix(test::random_vector(random, 3));
    for (int i = 1; i < N; ++i) ws.guess.psi[i] = uniform(random, -3, 3);
    constexpr int steps = 16;
    test::BaseProblem<L, N> problem(model, c.q, c.load, steps);
    problem.integrate(ws.guess);
    const Mat3 turn = problem.rotation * ws.guess.rotation.transpose();
    c.load = {turn * c.load.force, turn * c.load.moment};
    ws.guess.rotation = problem.rotation;
    const auto smallest = test::smallest_determinant<L>(model, c.q, c.load, ws, steps);
    if (std::abs(smallest.value) < 1e-3) continue;
    const bool found = detail::is_stable<MagnusRk4>(model.coefficients(), c.q, c.load, ws.guess, Steps<N>(steps));
    // Two directions that turn over between two samples leave no sign, so a sampled determinant does not prove stability;
    // in this many samples it does not happen.
    EXPECT_EQ(found, smallest.value > 0) << "case " << k << ", determinant " << smallest.value;
    ++(found ? stable : unstable);
  }
  EXPECT_GT(stable, 0);
  if constexpr (N > 1) {
    EXPECT_GT(unstable, 0);
  }
}

TYPED_TEST(Stability, AgreesWithSamplesOfTheDeterminant) {
  constexpr int N = TypeParam::N;
  Random random(50 + N);
  agrees_with_samples<N, Loading::weight>(random);
  if constexpr (N > 1) agrees_with_samples<N, Loading::none>(random);
}

}  // namespace stability_test
}  // namespace ctcr
