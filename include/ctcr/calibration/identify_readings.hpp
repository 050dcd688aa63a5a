#pragma once
// The fit of a table some of whose rows the model may be unable to solve.
#include <algorithm>
#include <iterator>
#include <vector>

#include "ctcr/calibration/identify.hpp"

namespace ctcr {

/// Fits the active rows of a table such as Recording: a Predictor with unsolved(), active() and activate().
///
/// Rows that cannot be solved at the start are left out of the whole fit. So are, once a descent gets stuck for their
/// sake, those that cannot be solved where it wants to go, if they are few; it then goes on without them.
/// @param excluded  receives the rows left out
/// @return and throws as identify(); on return the table's active rows are those that were fitted
template <class Table>
Identification identify_readings(Table& table, const std::vector<FreeParameter>& parameters, const Noise& noise,
                                 const Eigen::MatrixX3d& places, IdentifyOptions options, std::vector<int>& excluded) {
  constexpr int rounds = 4;
  const auto exclude = [&](const std::vector<int>& rows) {
    std::vector<bool> active = table.active();
    for (const int row : rows) active[std::size_t(row)] = false;
    table.activate(active);
    excluded.insert(excluded.end(), rows.begin(), rows.end());
  };
  Eigen::VectorXd x(Eigen::Index(parameters.size())), residual;
  for (Eigen::Index k = 0; k < x.size(); ++k)
    x[k] = options.start ? (*options.start)[k] : parameters[std::size_t(k)].mean;
  if (!table(x, residual, nullptr)) exclude(table.unsolved());

  for (int round = 1;; ++round) {
    std::vector<int> blocked;
    const Predictor predict = [&](const Eigen::VectorXd& at, Eigen::VectorXd& out, Eigen::MatrixXd* jacobian) {
      const bool solved = table(at, out, jacobian);
      if (!solved) blocked = table.unsolved();
      return solved;
    };
    Identification fit = identify(predict, parameters, noise, places, options);
    const auto active = std::count(table.active().begin(), table.active().end(), true);
    const bool few = 10 * std::ssize(blocked) <= active;
    if (fit.converged || blocked.empty() || !few || round == rounds) {
      if (!fit.converged && !blocked.empty())
        fit.status += "; " + std::to_string(blocked.size()) + " readings cannot be solved where it leads";
      std::sort(excluded.begin(), excluded.end());
      return fit;
    }
    exclude(blocked);
    options.start = fit.values;
  }
}

}  // namespace ctcr
