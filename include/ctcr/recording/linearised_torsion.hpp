#pragma once
// How the twist of tubes that rub changes with the parameters of their system.
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "ctcr/mechanics/solution.hpp"
#include "ctcr/recording/path.hpp"

namespace ctcr {

/// The twist at each place of a recording, near the parameters with which the tubes were wound up: linear in some of them.
template <int N>
struct Winding {
  std::vector<std::optional<TipGuess<N>>> equilibria{};  ///< at each place; nothing: none was found
  std::vector<int> variables{};                          ///< these, by their places in SystemParameters
  Eigen::VectorXd values{};  ///< theirs, with which the tubes were wound up; empty: it is not known
  Eigen::MatrixXd slopes{};  ///< (contacts, variables x places)

  /// Slopes of the twist at a place: (contacts, variables).
  [[nodiscard]] auto at(std::size_t place) { return slopes.middleCols(first(place), Eigen::Index(variables.size())); }
  [[nodiscard]] auto at(std::size_t place) const {
    return slopes.middleCols(first(place), Eigen::Index(variables.size()));
  }

  /// Adds to the twist along a path what other values of all parameters change.
  void unwind(const Eigen::VectorXd& to, detail::RecordedPath<N, double>& path) const noexcept {
    for (std::size_t place = 0; place < path.q.size(); ++place) extrapolate(to, place, path.q[place].twist);
  }
  /// The same of rows.
  void unwind(const Eigen::VectorXd& to, std::span<RecordedRow<N>> rows) const noexcept {
    std::size_t place = 0;
    for (RecordedRow<N>& row : rows)
      for (Twist<N>& twist : row.twist) extrapolate(to, place++, twist);
  }
  /// The same at a place.
  void extrapolate(const Eigen::VectorXd& to, std::size_t place, Twist<N>& twist) const noexcept {
    auto sum = VecN<Contacts<N>::count>::Map(twist.data());
    const auto here = at(place);
    for (Eigen::Index j = 0; j < values.size(); ++j) {
      const double change = to[variables[std::size_t(j)]] - values[j];
      if (change != 0) sum += change * here.col(j);
    }
  }

private:
  [[nodiscard]] Eigen::Index first(std::size_t place) const noexcept { return Eigen::Index(place * variables.size()); }
};

}  // namespace ctcr
