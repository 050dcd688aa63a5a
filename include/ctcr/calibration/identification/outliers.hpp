#pragma once
// Weights that reduce the influence of outliers, as a likelihood with Student-t tails does.
#include <algorithm>
#include <cmath>
#include <vector>

#include "ctcr/calibration/identification/whitening.hpp"
#include "ctcr/calibration/statistics.hpp"

namespace ctcr {

/// Inlier fraction of a row with three residuals of squared length `square`, in sd: 1 within 97.5 % of a normal
/// distribution, falling with the square beyond. Its square is the weight, so that outliers add next to nothing to
/// chi-square, while normal data keep theirs, and with it honest standard deviations.
inline double inlier_fraction(double square) noexcept {
  constexpr double freedom = 5, bulk = 9.348;  // 97.5 % of chi-square of three; the tail is that of Student's t
  return square <= bulk ? 1.0 : (freedom + bulk) / (freedom + square);
}

/// Weights for the next fit of residuals (6 rows) that were fitted with `whitening`.
///
/// A row is judged by how far it lies from what the field error at the other rows predicts for it, in units of the
/// median distance of these rows: an error of the model everywhere makes no row an outlier.
/// @param inflation  factor on the jitter of positions and of rotations that `whitening` has in it
/// @param use  weights before outliers are found; 0 stays 0
inline RowWeights outlier_weights(const Noise& noise, const Eigen::Array2d& inflation, const Whitening& whitening,
                                  const Eigen::VectorXd& residual, const RowWeights& use) {
  RowWeights weights = use;
  const Eigen::VectorXd left = residual - whitening.field(residual);
  for (int kind = 0; kind < 2; ++kind) {
    const double jitter = inflation[kind] * (kind == 0 ? noise.position_jitter : noise.rotation_jitter);
    const Eigen::ArrayXd variance = whitening.axes(kind).field_variance();
    // Leaving the row out: both its residual and the field's variance grow by 1 / (1 - leverage).
    const Eigen::ArrayXd leverage = variance * whitening.axes(kind).scale().array().square();
    const Eigen::ArrayXd apart = (1 - leverage).max(1e-6);
    const Eigen::ArrayXd square = Whitening::gathered(left, kind).rowwise().squaredNorm().array() /
                                  (apart.square() * (jitter * jitter + variance / apart));
    std::vector<double> used;
    for (Eigen::Index i = 0; i < square.size(); ++i)
      if (use(i, kind) > 0) used.push_back(square[i]);
    if (used.empty()) continue;
    const double usual = std::max(1.0, median(used) / (median_length_3 * median_length_3));
    for (Eigen::Index i = 0; i < square.size(); ++i)
      if (use(i, kind) > 0) weights(i, kind) = use(i, kind) * std::pow(inlier_fraction(square[i] / usual), 2);
  }
  return weights;
}

}  // namespace ctcr
