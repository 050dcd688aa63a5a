#pragma once
// The one way in which calibration uses Ceres: small dense problems, solved to rounding, quietly, on one thread.
#include <ceres/ceres.h>

#include <Eigen/Core>
#include <vector>

namespace ctcr {

/// Minimises the problem from where its parameter blocks stand. Residuals should be of order 1: in units of the noise.
inline void minimise(ceres::Problem& problem, int iterations = 100) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = iterations;
  options.function_tolerance = 1e-16;
  options.gradient_tolerance = 1e-16;
  options.parameter_tolerance = 1e-15;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
}

/// Derivative (residuals, parameters) of all residuals, in the order in which they were added, by the tangents of the
/// given blocks, without loss functions.
inline Eigen::MatrixXd jacobian(ceres::Problem& problem, const std::vector<double*>& blocks) {
  ceres::Problem::EvaluateOptions options;
  options.apply_loss_function = false;
  options.parameter_blocks = blocks;
  ceres::CRSMatrix sparse;
  problem.Evaluate(options, nullptr, nullptr, nullptr, &sparse);
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
  for (std::size_t row = 0; row < std::size_t(sparse.num_rows); ++row)
    for (std::size_t k = std::size_t(sparse.rows[row]); k < std::size_t(sparse.rows[row + 1]); ++k)
      dense(Eigen::Index(row), sparse.cols[k]) = sparse.values[k];
  return dense;
}

}  // namespace ctcr
