#pragma once
// Residuals with the covariance of Noise made independent and of unit variance, in time linear in the rows.
//
// The covariance is the same for the three axes of a position (of a rotation): with the precision W^2 = diag(weight / jitter^2)
// and A = W Phi it is W^-1 (I + A A^T) W^-1. The eigenvectors V and eigenvalues t of the small matrix A^T A give
// (I + A A^T)^(-1/2) = I - A V diag(1 / (1 + t + sqrt(1 + t))) V^T A^T.
#include <Eigen/Eigenvalues>
#include <array>
#include <numeric>
#include <vector>

#include "ctcr/calibration/dense.hpp"
#include "ctcr/calibration/noise.hpp"

namespace ctcr {

/// Weight of each row's position and rotation: 1 as the noise says, less for outliers, 0 where not measured or not used.
using RowWeights = Eigen::MatrixX2d;

namespace detail {

/// The three axes of a position or of a rotation, which share one covariance.
class ThreeAxes {
public:
  ThreeAxes() = default;
  ThreeAxes(double jitter, double field_sd, const SmoothField& field, const Eigen::VectorXd& weight)
    : jitter_variance_(jitter * jitter), variance_(jitter_variance_ + field_sd * field_sd) {
    const Eigen::ArrayXd variance = jitter * jitter + field_sd * field_sd * field.rest.array();
    scale_ = (weight.array() / variance).sqrt();
    for (Eigen::Index i = 0; i < weight.size(); ++i)
      if (weight[i] > 0) rows_.push_back(i);
    field_ = field_sd * field.factor.leftCols(field_sd > 0 && !rows_.empty() ? field.factor.cols() : 0);
    log_determinant_ = -2 * (scale_.array() > 0).select(scale_.array().log(), 0.0).sum();
    if (field_.cols() == 0) return;
    const Eigen::MatrixXd A = scale_(rows_).asDiagonal() * field_(rows_, Eigen::all);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(transposed_product(A, A));
    const Eigen::ArrayXd t = eigen.eigenvalues().array().max(0.0);
    const Eigen::MatrixXd to_posterior = eigen.eigenvectors() * (1 + t).rsqrt().matrix().asDiagonal();
    field_ = product(field_, to_posterior);
    scaled_field_ = product(A, to_posterior);
    shrink_ = (1 + t).sqrt() / (1 + (1 + t).sqrt());
    eigenvalues_ = t;
    log_determinant_ += (1 + t).log().sum();
  }

  /// @param y  (rows of weight above 0, any)
  [[nodiscard]] Eigen::MatrixXd whitened(Eigen::MatrixXd y) const {
    y = scale_(rows_).asDiagonal() * y;
    if (scaled_field_.cols() > 0)
      y -= product(scaled_field_, shrink_.matrix().asDiagonal() * transposed_product(scaled_field_, y));
    return y;
  }
  /// Posterior mean of the field error at every row, given residuals (rows, any).
  [[nodiscard]] Eigen::MatrixXd field_mean(const Eigen::MatrixXd& residual) const {
    return product(field_, transposed_product(field_, scale_.cwiseAbs2().asDiagonal() * residual));
  }
  /// Factor on the jitter's variance with which the chi-square of a residual (rows, 3) is `expected`; 1 where it is not
  /// significantly above that (four standard deviations).
  [[nodiscard]] double inflation(const Eigen::MatrixXd& residual, double expected) const {
    const Eigen::MatrixXd y = scale_.asDiagonal() * residual;
    const double all = y.squaredNorm();
    Eigen::ArrayXd smooth;  // the part that the field can explain, by eigenvector of A A^T
    if (field_.cols() > 0)
      smooth = (1 + eigenvalues_) * transposed_product(field_, scale_.asDiagonal() * y).rowwise().squaredNorm().array();
    const auto chi_square = [&](double s2) {
      return (all - (smooth.size() > 0 ? (smooth / (s2 + eigenvalues_)).sum() : 0.0)) / s2;
    };
    double low = 1, high = 1;
    if (!(expected > 0) || chi_square(1) <= expected + 4 * std::sqrt(2 * expected)) return 1;
    while (chi_square(high *= 4) > expected) low = high;
    for (int halving = 0; halving < 40; ++halving) {
      const double middle = std::sqrt(low * high);
      (chi_square(middle) > expected ? low : high) = middle;
    }
    return high;
  }
  /// Variance of the field error given the rows that count, per axis.
  [[nodiscard]] Eigen::VectorXd field_variance() const { return field_.rowwise().squaredNorm(); }
  [[nodiscard]] const Eigen::VectorXd& scale() const { return scale_; }  ///< sqrt(weight) / sd of the jitter
  [[nodiscard]] double variance() const { return variance_; }            ///< of one reading, jitter and field, per axis
  [[nodiscard]] double jitter_variance() const { return jitter_variance_; }
  [[nodiscard]] double log_determinant() const { return 3 * log_determinant_; }
  [[nodiscard]] const std::vector<Eigen::Index>& rows() const { return rows_; }  ///< of weight above 0

private:
  Eigen::MatrixXd field_;         ///< its posterior covariance is field_ field_^T
  Eigen::MatrixXd scaled_field_;  ///< its rows of weight above 0, scaled
  Eigen::VectorXd scale_;
  Eigen::ArrayXd shrink_, eigenvalues_;
  double jitter_variance_ = 0, variance_ = 0, log_determinant_ = 0;
  std::vector<Eigen::Index> rows_;
};

}  // namespace detail

/// The noise of a table of readings at given weights, ready to be applied to any number of columns.
///
/// Columns have six entries a row, interleaved: entry 6 i + a is axis a of row i. Rows of weight 0 become 0.
/// Real time: no.
class Whitening {
public:
  Whitening() = default;
  /// @param field  smooth_field() at the rows' positions; its factor may have no columns
  Whitening(const Noise& noise, const SmoothField& field, const RowWeights& weights)
    : axes_{detail::ThreeAxes(noise.position_jitter, noise.position_field, field, weights.col(0)),
            detail::ThreeAxes(noise.rotation_jitter, noise.rotation_field, field, weights.col(1))} {}

  /// Columns (6 rows, any) in place.
  void apply(Eigen::Ref<Eigen::MatrixXd> columns) const {
    constexpr Eigen::Index panel = 16;  // columns at a time: bounds the memory
    for (Eigen::Index first = 0; first < columns.cols(); first += panel) {
      auto some = columns.middleCols(first, std::min(panel, columns.cols() - first));
      const Eigen::MatrixXd position = axes_[0].whitened(gathered(some, 0, axes_[0].rows())),
                            rotation = axes_[1].whitened(gathered(some, 1, axes_[1].rows()));
      some.setZero();
      scatter(position, 0, axes_[0].rows(), some);
      scatter(rotation, 1, axes_[1].rows(), some);
    }
  }
  /// log |Sigma| of the rows of weight above 0.
  [[nodiscard]] double log_determinant() const { return axes_[0].log_determinant() + axes_[1].log_determinant(); }
  /// Numbers of weight above 0.
  [[nodiscard]] Eigen::Index observations() const {
    return 3 * Eigen::Index(axes_[0].rows().size() + axes_[1].rows().size());
  }
  /// Posterior mean of the field error given a residual (6 rows), the part of it that the field explains. Defined at
  /// rows of weight 0 too, from the others.
  [[nodiscard]] Eigen::VectorXd field(const Eigen::VectorXd& residual) const {
    Eigen::VectorXd out(residual.size());
    for (int kind = 0; kind < 2; ++kind)
      scatter(axes(kind).field_mean(gathered(residual, kind)), kind, all_of(out), out);
    return out;
  }
  /// 0: position, 1: rotation.
  [[nodiscard]] const detail::ThreeAxes& axes(int kind) const { return axes_[std::size_t(kind)]; }

  /// Three columns for each of `columns` (6 rows, any): the axes of a kind, row by row. Not finite numbers count as 0.
  static Eigen::MatrixXd gathered(const Eigen::Ref<const Eigen::MatrixXd>& columns, int kind) {
    return gathered(columns, kind, all_of(columns));
  }

private:
  using Rows = std::vector<Eigen::Index>;
  static Rows all_of(const Eigen::Ref<const Eigen::MatrixXd>& columns) {
    Rows rows(std::size_t(columns.rows() / 6));
    std::iota(rows.begin(), rows.end(), 0);
    return rows;
  }
  /// The same of some rows, and back.
  static Eigen::MatrixXd gathered(const Eigen::Ref<const Eigen::MatrixXd>& columns, int kind, const Rows& rows) {
    Eigen::MatrixXd y(Eigen::Index(rows.size()), 3 * columns.cols());
    for (Eigen::Index k = 0; k < y.cols(); ++k)
      for (Eigen::Index i = 0; i < y.rows(); ++i) {
        const double x = columns(6 * rows[std::size_t(i)] + 3 * kind + k % 3, k / 3);
        y(i, k) = std::isfinite(x) ? x : 0.0;
      }
    return y;
  }
  static void scatter(const Eigen::MatrixXd& y, int kind, const Rows& rows, Eigen::Ref<Eigen::MatrixXd> columns) {
    for (Eigen::Index k = 0; k < y.cols(); ++k)
      for (Eigen::Index i = 0; i < y.rows(); ++i) columns(6 * rows[std::size_t(i)] + 3 * kind + k % 3, k / 3) = y(i, k);
  }

  std::array<detail::ThreeAxes, 2> axes_;
};

}  // namespace ctcr
