// Laws of the small least-squares problems of the procedures: Cauchy's loss, exact derivatives, the minimum.
#include "ctcr/calibration/procedures/small_problem.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace {

/// A curve of two parameters, with a residual of two components.
struct Curved {
  static constexpr int size = 2;
  double at, x, y;
  template <class T>
  void operator()(const T* p, T* residual) const {
    using std::exp;
    residual[0] = p[0] * exp(p[1] * at) - x;
    residual[1] = p[0] * p[1] + at - y;
  }
};
using Problem = ctcr::SmallProblem<Curved, 3>;  // the third parameter acts on nothing

class SmallProblem : public testing::Test {
protected:
  std::mt19937 random{7};
  double uniform(double low, double high) { return std::uniform_real_distribution(low, high)(random); }
};

TEST_F(SmallProblem, ItsSquaresAreCauchysLoss) {
  for (int k = 0; k < 200; ++k) {
    const double loss = std::pow(10, uniform(-4, 4)), x[] = {uniform(-2, 2), uniform(-1, 1)};
    Problem plain({x[0], x[1], 0}, {0, 1}), robust = plain;
    const Curved block{uniform(0, 1), uniform(-2, 2), uniform(-2, 2)};
    plain.add(block);
    robust.add(block, loss);
    Eigen::Vector2d r, scaled;
    plain(x, r.data(), nullptr);
    robust(x, scaled.data(), nullptr);
    const double cost = loss * loss * std::log1p(r.squaredNorm() / (loss * loss));
    EXPECT_NEAR(scaled.squaredNorm(), cost, 1e-12 * cost);
  }
}

TEST_F(SmallProblem, DerivativesAreExact) {
  for (int k = 0; k < 200; ++k) {
    const double loss = k % 2 ? std::pow(10, uniform(-2, 4)) : 0;
    Eigen::Vector2d x(uniform(-2, 2), uniform(-1, 1));
    Problem problem({x[0], x[1], 0}, {0, 1});
    for (int i = 0; i < 3; ++i) problem.add({uniform(0, 1), uniform(-2, 2), uniform(-2, 2)}, loss);
    Eigen::Matrix<double, 6, 1> r, high, low;
    Eigen::Matrix<double, 6, 2> J;
    problem(x.data(), r.data(), J.data());
    for (int j = 0; j < 2; ++j) {
      const double h = 1e-5;
      Eigen::Vector2d up = x, down = x;
      up[j] += h, down[j] -= h;
      problem(up.data(), high.data(), nullptr);
      problem(down.data(), low.data(), nullptr);
      EXPECT_LT((J.col(j) - (high - low) / (2 * h)).norm(), 1e-8 * (1 + J.col(j).norm()));
    }
    if (loss == 0) {
      EXPECT_LT((problem.jacobian() - J).norm(), 1e-14 * (1 + J.norm()));
    }
  }
}

TEST_F(SmallProblem, FindsTheParametersAndLeavesTheOthers) {
  for (int k = 0; k < 50; ++k) {
    const double a = uniform(0.5, 2), b = uniform(-1, 1), loss = k % 2 ? 0.1 : 0;
    Problem problem({a + uniform(-0.2, 0.2), b + uniform(-0.2, 0.2), 4.5}, {0, 1});
    for (double at = 0; at < 1; at += 0.1) problem.add({at, a * std::exp(b * at), a * b + at}, loss);
    if (loss > 0) problem.add({0.5, 40, -30}, 1e-6);  // an outlier
    problem.minimise(1, 1e-13);
    EXPECT_NEAR(problem.parameters()[0], a, loss > 0 ? 1e-6 : 1e-11);
    EXPECT_NEAR(problem.parameters()[1], b, loss > 0 ? 1e-6 : 1e-11);
    EXPECT_EQ(problem.parameters()[2], 4.5);
  }
}

}  // namespace
