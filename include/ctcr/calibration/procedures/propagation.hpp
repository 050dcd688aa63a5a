#pragma once
// Propagation of the noise of points to parameters fitted to them by least squares, a linear map near the solution.
#include <cmath>

#include "ctcr/calibration/dense.hpp"
#include "ctcr/calibration/noise.hpp"

namespace ctcr {

/// The map G from errors of the residuals to errors of the parameters, G J = I; empty where the columns of J are
/// dependent, so that the residuals do not determine the parameters. J: (residuals, parameters), any units.
inline Eigen::MatrixXd gain(const Eigen::MatrixXd& J) {
  if (J.rows() < J.cols()) return {};
  const Eigen::VectorXd scale = J.colwise().norm();
  if (!(scale.minCoeff() > 0)) return {};
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(J * scale.cwiseInverse().asDiagonal());
  qr.setThreshold(1e-9);
  if (qr.rank() < J.cols()) return {};
  // (J^T J)^-1 from R alone; the inverse of J itself would be a square of the number of residuals.
  const Eigen::Index n = J.cols();
  Eigen::MatrixXd root =
      qr.matrixQR().topRows(n).template triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(n, n));
  root = scale.cwiseInverse().asDiagonal() * (qr.colsPermutation() * root);
  return product(root, product(J, root).transpose());
}

/// The part of points' covariance that a tracker's field error makes, as factor factor^T over (points), the same for
/// each axis [m^2].
inline Eigen::MatrixXd field_factor(const Eigen::MatrixX3d& positions, const Noise& noise) {
  if (!(noise.position_field > 0)) return Eigen::MatrixXd(positions.rows(), 0);
  return noise.position_field * smooth_field(positions, noise.correlation_length, 1e-9).factor;
}

/// Columns 3 i + axis of G, for the points i that an axis' field moves together.
inline Eigen::MatrixXd axis_columns(const Eigen::MatrixXd& G, int axis) {
  return G(Eigen::all, Eigen::seq(axis, Eigen::last, 3));
}

/// Covariance of parameters with gain G (parameters, 3 points; x, y, z of a point together) when every coordinate has
/// an error of its own with `variance` [m^2], and all share a field.
inline Eigen::MatrixXd propagated(const Eigen::MatrixXd& G, double variance, const Eigen::MatrixXd& field) {
  Eigen::MatrixXd covariance = variance * product(G, G.transpose());
  for (int axis = 0; axis < 3 && field.cols() > 0; ++axis) {
    const Eigen::MatrixXd moved = product(axis_columns(G, axis), field);
    covariance += product(moved, moved.transpose());
  }
  return covariance;
}

/// Contribution of the field error to the sum of squared residuals of a fit with Jacobian J and gain G, on average [m^2].
inline double expected_field_squares(const Eigen::MatrixXd& J, const Eigen::MatrixXd& G, const Eigen::MatrixXd& field) {
  if (field.cols() == 0) return 0;
  double squares = 3 * field.squaredNorm();
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::MatrixXd J_axis = J(Eigen::seq(axis, Eigen::last, 3), Eigen::all);
    squares -= product(axis_columns(G, axis), field).cwiseProduct(transposed_product(J_axis, field)).sum();
  }
  return squares;
}

}  // namespace ctcr
