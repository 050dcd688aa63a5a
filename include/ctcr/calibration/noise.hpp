#pragma once
// The noise of a tracker: jitter of each reading, and a field error that changes smoothly with the position and is the
// same for all readings at one position. The accuracy that a maker states is mostly the latter.
#include <algorithm>
#include <cmath>
#include <utility>

#include "ctcr/core/types.hpp"

namespace ctcr {

/// Standard deviations per axis. A field of 0: jitter alone.
struct Noise {
  double position_jitter = 0;       ///< [m]
  double rotation_jitter = 0;       ///< [rad]
  double position_field = 0;        ///< [m]
  double rotation_field = 0;        ///< [rad]
  double correlation_length = 0.1;  ///< over which the field error changes [m]
};

/// 95 % of the lengths of a vector with three independent normal components lie below this many of their sd.
inline constexpr double norm_95 = 2.7955;

/// Sd per axis of the field error that a 95 % accuracy leaves beside the jitter, in their unit; 0 where jitter explains all.
inline double field_of_accuracy(double accuracy_95, double jitter) noexcept {
  const double axis = accuracy_95 / norm_95;
  return std::sqrt(std::max(0.0, axis * axis - jitter * jitter));
}

/// A smooth random function of position with unit variance and covariance exp(-d^2 / (2 length^2)), at given positions,
/// as a sum of few independent ones: covariance = factor factor^T + diag(rest).
struct SmoothField {
  Eigen::MatrixXd factor;  ///< (positions, rank)
  Eigen::VectorXd rest;    ///< (positions), variance that the factor leaves out
};

/// Pivoted Cholesky factor of the covariance: always takes the position that is explained worst, so that the rank
/// depends on how many correlation lengths they span, not on their number. Cost O(positions rank^2).
/// @param positions     (positions, 3) [m]; one that is not finite gets an independent error
/// @param tolerance  largest variance that may be left out
/// @throws std::bad_alloc. Real time: no.
/// Ref: Harbrecht, Peters, Schneider, "On the low-rank approximation by the pivoted Cholesky decomposition", 2012.
inline SmoothField smooth_field(const Eigen::MatrixX3d& positions, double length, double tolerance,
                                int max_rank = 400) {
  const Eigen::Index count = positions.rows();
  const Eigen::ArrayX<bool> known = positions.array().isFinite().rowwise().all();
  tolerance = std::max(tolerance, 1e-12);  // less is rounding
  Eigen::VectorXd left = known.cast<double>().matrix();
  Eigen::MatrixXd factor(count, 0);
  Eigen::Index rank = 0;
  for (; rank < std::min<Eigen::Index>(max_rank, count); ++rank) {
    Eigen::Index pivot;
    if (!(left.maxCoeff(&pivot) > tolerance)) break;
    if (rank == factor.cols()) factor.conservativeResize(count, std::max<Eigen::Index>(16, 2 * rank));
    const Eigen::ArrayXd square = (positions.rowwise() - positions.row(pivot)).rowwise().squaredNorm();
    Eigen::VectorXd column = known.select((-square / (2 * length * length)).exp(), 0.0);
    column -= factor.leftCols(rank) * factor.row(pivot).head(rank).transpose();
    column /= std::sqrt(left[pivot]);
    left = (left - column.cwiseAbs2()).cwiseMax(0.0);
    left[pivot] = 0;
    factor.col(rank) = column;
  }
  factor.conservativeResize(count, rank);
  return {std::move(factor), known.select(left.array(), 1.0)};
}

}  // namespace ctcr
