#pragma once
// The rows of a table that are fitted. The others cost nothing.
#include "ctcr/calibration/identification/identification.hpp"

namespace ctcr::detail {

/// Rows that have a weight above 0: selects them from arrays of all rows.
class FittedRows {
public:
  explicit FittedRows(const RowWeights& use) {
    for (Eigen::Index i = 0; i < use.rows(); ++i)
      if ((use.row(i).array() > 0).any()) rows_.push_back(i);
    for (const Eigen::Index i : rows_)
      for (Eigen::Index entry = 6 * i; entry < 6 * i + 6; ++entry) entries_.push_back(entry);
    all_ = Eigen::Index(rows_.size()) == use.rows();
  }

  /// `predict` restricted to these rows; refers to it and to this.
  [[nodiscard]] Predictor predictor(const Predictor& predict) const {
    return [this, &predict, residual = Eigen::VectorXd(), jacobian = Eigen::MatrixXd()](
               const Eigen::VectorXd& x, Eigen::VectorXd& selected, Eigen::MatrixXd* selected_jacobian) mutable {
      if (all_) return predict(x, selected, selected_jacobian);
      if (!predict(x, residual, selected_jacobian ? &jacobian : nullptr)) return false;
      selected = of(residual);
      if (selected_jacobian) *selected_jacobian = of(jacobian);
      return true;
    };
  }
  /// Of columns (6 rows, any).
  [[nodiscard]] Eigen::MatrixXd of(const Eigen::MatrixXd& columns) const { return columns(entries_, Eigen::all); }
  [[nodiscard]] SmoothField field(const SmoothField& field) const {
    return {field.factor(rows_, Eigen::all), field.rest(rows_)};
  }
  [[nodiscard]] RowWeights weights(const RowWeights& weights) const { return weights(rows_, Eigen::all); }
  /// Weights of all rows, 0 where they are not fitted.
  [[nodiscard]] RowWeights expanded(Eigen::Index rows, const RowWeights& weights) const {
    RowWeights all = RowWeights::Zero(rows, 2);
    all(rows_, Eigen::all) = weights;
    return all;
  }

private:
  std::vector<Eigen::Index> rows_, entries_;
  bool all_ = false;  ///< every row is fitted
};

}  // namespace ctcr::detail
