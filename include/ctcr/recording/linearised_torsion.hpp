#pragma once
#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "ctcr/mechanics/solution.hpp"
#include "ctcr/recording/path.hpp"

namespace ctcr {

/// Relative torsion at each sample of a recording as a linear function of some parameters, about the values with which
/// solve_friction() found it.
template <int N>
struct LinearisedTorsion {
  std::vector<std::optional<WarmStart<N>>> equilibria{};  ///< at each sample; nothing: none was found
  std::vector<int> variables{};                           ///< the parameters, by their indices in SystemParameters
  Eigen::VectorXd values{};                               ///< theirs at the solution; empty: there is none yet
  Eigen::MatrixXd derivatives{};                          ///< (contacts, variables x samples)

  /// Derivatives at a sample: (contacts, variables).
  [[nodiscard]] auto at(std::size_t k) { return derivatives.middleCols(first(k), Eigen::Index(variables.size())); }
  [[nodiscard]] auto at(std::size_t k) const {
    return derivatives.middleCols(first(k), Eigen::Index(variables.size()));
  }

  /// Adds to the torsion at a sample what changes from the solution to other values of all parameters.
  void extrapolate(const Eigen::VectorXd& to, std::size_t k, RelativeTorsion<N>& torsion) const noexcept {
    auto sum = VecN<Contacts<N>::count>::Map(torsion.data());
    const auto here = at(k);
    for (Eigen::Index j = 0; j < values.size(); ++j) {
      const double change = to[variables[std::size_t(j)]] - values[j];
      if (change != 0) sum += change * here.col(j);
    }
  }
  void extrapolate(const Eigen::VectorXd& to, RecordedPath<N>& path) const noexcept {
    for (std::size_t k = 0; k < path.q.size(); ++k) extrapolate(to, k, path.q[k].torsion);
  }
  void extrapolate(const Eigen::VectorXd& to, std::span<RecordedRow<N>> rows) const noexcept {
    std::size_t k = 0;
    for (RecordedRow<N>& row : rows)
      for (RelativeTorsion<N>& torsion : row.torsion) extrapolate(to, k++, torsion);
  }

private:
  [[nodiscard]] Eigen::Index first(std::size_t k) const noexcept { return Eigen::Index(k * variables.size()); }
};

}  // namespace ctcr
