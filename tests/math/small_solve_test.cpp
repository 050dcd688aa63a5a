#include "ctcr/math/small_solve.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>

#include "support/cases.hpp"

namespace ctcr {
namespace small_solve_test {

/// Systems of any condition, rows in any order: the solution is as good as Eigen's.
template <int n, int columns>
void solves_as_eigen_does() {
  for (int k = 0; k < test::cases(200); ++k) {
    Eigen::Matrix<double, n, n> A = Eigen::Matrix<double, n, n>::Random();
    A.row(k % n) *= std::pow(10, -k % 8);
    const Eigen::Matrix<double, n, columns> X = Eigen::Matrix<double, n, columns>::Random(n, 3), B = A * X;
    const Eigen::MatrixXd found = solved(A, B), eigen = Eigen::MatrixXd(A).partialPivLu().solve(B);
    EXPECT_LT((found - X).norm(), 10 * (eigen - X).norm() + 1e-13) << k;
  }
}

TEST(SmallSolve, EqualsEigen) {
  std::srand(1);
  solves_as_eigen_does<1, 3>();
  solves_as_eigen_does<3, 3>();
  solves_as_eigen_does<6, Eigen::Dynamic>();
  solves_as_eigen_does<14, Eigen::Dynamic>();
}

TEST(SmallSolve, SaysThatASystemIsSingular) {
  std::srand(2);
  for (int k = 0; k < test::cases(100); ++k) {
    Eigen::Matrix4d A = Eigen::Matrix4d::Random();
    A.col(k % 4) = 2 * A.col((k + 1) % 4) - A.col((k + 2) % 4);
    Eigen::Vector4d b = Eigen::Vector4d::Random();
    EXPECT_LT(solve_in_place(A, b), 1e-12);
    A(k % 4, 3) = k % 2 ? std::numeric_limits<double>::quiet_NaN() : std::numeric_limits<double>::infinity();
    const double ratio = solve_in_place(A, b);
    EXPECT_TRUE(ratio == 0 || !b.allFinite());
  }
}

}  // namespace small_solve_test
}  // namespace ctcr
