#pragma once
// The joint fit of a table in which the model may be unable to solve some rows.
#include <algorithm>
#include <iterator>
#include <vector>

#include "ctcr/calibration/identification/identify.hpp"

namespace ctcr {

/// Fits the active rows of a table such as Recording: a Predictor with unsolved(), active() and activate().
///
/// Rows that cannot be solved at the start are excluded from the whole fit. A few others do not stop a descent: a row that
/// cannot be solved at a trial keeps its last solved residual, with derivatives of 0. Rows that cannot be solved where the
/// descent ends are excluded then, and the fit goes on without them.
/// @param excluded  receives the excluded rows
/// @return and throws as identify(); on return the table's active rows are those that were fitted
template <class Table>
Identification identify_with_exclusions(Table& table, const std::vector<FreeParameter>& parameters, const Noise& noise,
                                        const Eigen::MatrixX3d& positions, IdentifyOptions options,
                                        std::vector<int>& excluded) {
  constexpr int rounds = 4;
  const auto exclude = [&](const std::vector<int>& rows) {
    std::vector<bool> active = table.active();
    for (const int row : rows) active[std::size_t(row)] = false;
    table.activate(active);
    excluded.insert(excluded.end(), rows.begin(), rows.end());
  };
  Eigen::VectorXd solved;  // of the last prediction, unsolved rows as they were before
  for (int round = 1;; ++round) {
    std::size_t blocked = 0;
    bool all_solved = true;
    const Predictor predict = [&](const Eigen::VectorXd& at, Eigen::VectorXd& out, Eigen::MatrixXd* jacobian) {
      const bool begins = solved.size() == 0;
      if (!table(at, out, jacobian) && begins) {
        exclude(table.unsolved());
        (void)table(at, out, jacobian);
      }
      const std::vector<int>& unsolved = table.unsolved();
      const auto active = std::ranges::count(table.active(), true);
      const bool few = round < rounds && 10 * std::ssize(unsolved) <= active;
      if (!few && !unsolved.empty()) {
        blocked = unsolved.size();
        return false;
      }
      all_solved = all_solved && unsolved.empty();
      for (const int row : unsolved) out.segment<6>(6 * row) = solved.segment<6>(6 * row);
      solved = out;
      return true;
    };
    Identification fit = identify(predict, parameters, noise, positions, options);
    if (all_solved || table(fit.values, solved, nullptr) || round == rounds) {
      if (!fit.converged && blocked > 0)
        fit.status += "; " + std::to_string(blocked) + " readings cannot be solved where it leads";
      std::sort(excluded.begin(), excluded.end());
      return fit;
    }
    exclude(table.unsolved());
    options.start = fit.values;
  }
}

}  // namespace ctcr
