#pragma once
// Linear algebra of matrices of any size behind plain functions. To Eigen every kind of expression in a product is a
// kernel of its own, which takes a compiler a second or more in each file that sees it: here a handful serves all.
#include <Eigen/QR>

namespace ctcr {

/// A B
inline Eigen::MatrixXd product(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) { return A * B; }

/// A^T B, without a copy of A.
inline Eigen::MatrixXd transposed_product(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  return A.transpose() * B;
}

/// The X, column by column, for which A X is nearest to B.
inline Eigen::MatrixXd least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  return A.colPivHouseholderQr().solve(B);
}

}  // namespace ctcr
