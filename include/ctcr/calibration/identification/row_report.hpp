#pragma once
// A fit held against its rows, and against rows that it has not seen.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "ctcr/calibration/identification/identification.hpp"

namespace ctcr {
/// Actual and expected residuals of all rows that a predictor gives, whether they were fitted or not.
struct RowReport {
  Eigen::VectorXd residual;  ///< (6 rows)
  Eigen::MatrixXd jacobian;  ///< (6 rows, parameters)
  Eigen::VectorXd field;     ///< (6 rows) posterior mean of the tracker's field error, which is part of the residual
  /// (rows, 2) expected squared length of the position [m^2] and rotation residual [rad^2]: noise, less what the fit has
  /// absorbed of it at fitted rows; noise and uncertainty of the parameters, less the field error that both share, at
  /// others. The root of its mean is the expected error.
  Eigen::MatrixX2d expected_square;
};

/// Residuals and their expected sizes at the fitted values. `predict` has the rows of the fit and may solve more.
/// @throws std::invalid_argument where the rows are not those of the fit. Real time: no.
inline RowReport report_rows(const Identification& fit, const Predictor& predict) {
  RowReport out;
  (void)predict(fit.values, out.residual, &out.jacobian);
  const Eigen::Index rows = fit.weights.rows(), n = fit.values.size();
  if (out.residual.size() != 6 * rows || out.jacobian.cols() != n)
    throw std::invalid_argument("these are not the rows or the parameters of the fit");
  Eigen::VectorXd fitted = out.residual;
  out.field = fit.whitening.field(fitted);
  out.expected_square.resize(rows, 2);
  for (int kind = 0; kind < 2; ++kind) {
    const detail::ThreeAxes& axes = fit.whitening.axes(kind);
    const Eigen::MatrixXd J = Whitening::gathered(out.jacobian, kind);
    // Change of the parameters that a unit of the field at a row brings with it.
    const Eigen::MatrixXd shared = axes.field_mean(J);
    for (Eigen::Index i = 0; i < rows; ++i) {
      Eigen::MatrixXd j(n, 3), s(n, 3);
      for (Eigen::Index k = 0; k < n; ++k)
        j.row(k) = J.row(i).segment<3>(3 * k), s.row(k) = shared.row(i).segment<3>(3 * k);
      const Eigen::MatrixXd Cj = product(fit.covariance, j);
      const double parameters = Cj.cwiseProduct(j).sum(), common = Cj.cwiseProduct(s).sum();
      // The variance that the fit assumed: larger where it had to admit a model error.
      const double assumed = 3 * (axes.variance() + (std::pow(fit.inflation[kind], 2) - 1) * axes.jitter_variance());
      const bool was_fitted = fit.weights(i, kind) > 0;
      out.expected_square(i, kind) =
          3 * axes.variance() * std::max(0.0, 1 + (was_fitted ? -parameters : parameters - 2 * common) / assumed);
    }
  }
  return out;
}

}  // namespace ctcr
