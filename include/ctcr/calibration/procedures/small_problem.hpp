#pragma once
// The one way in which calibration uses Ceres: small dense problems, solved to rounding, quietly, on one thread.
#include <ceres/autodiff_cost_function.h>
#include <ceres/crs_matrix.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <Eigen/Core>
#include <vector>

namespace ctcr {

/// Minimises the problem from where its parameter blocks stand, until they are right to `precision` (in units of the
/// residuals' numerators) or, where `gain` > 0, a step gains less than this part of the cost.
/// @param scale  what residuals are divided by, so that they are of order 1
inline void minimise(ceres::Problem& problem, double scale, double precision, double gain = 0) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 100;
  options.function_tolerance = gain;
  // The curvature of the cost is about the number of residuals over scale^2.
  options.gradient_tolerance = problem.NumResiduals() * precision / (scale * scale);
  options.parameter_tolerance = 0;
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
