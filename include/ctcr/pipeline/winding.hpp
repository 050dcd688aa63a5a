#pragma once
// How the twist of tubes that rub changes with the parameters of their system.
#include <Eigen/LU>
#include <optional>
#include <vector>

#include "ctcr/pipeline/follower_way.hpp"

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

namespace detail {

/// Follows the slopes of the twist, and of what is remembered of it, from place to place, for a window of variables.
template <int N, class Fx>
class WindingSlopes {
  static constexpr int contacts = Contacts<N>::count;
  using Window = detail::Window<4>;

public:
  WindingSlopes(const System<N, Fx>& system, std::span<const RecordedRow<N>> rows, const Variables<N, Fx>& variables,
                const Window& window) noexcept
    : rows_(rows), variables_(&variables), window_(window), way_(system, rows.front().radius, variables, window) {}

  /// At place k, the one after that of the call before.
  /// @param there  slopes of the twist by what is rubbed on the way to this place and by the variables; or null where
  ///               there is no equilibrium: then the twist keeps its slopes
  void advance(const RecordedPath<N, double>& path, std::size_t k, const TwistSlopes<N>* there,
               Winding<N>& out) noexcept {
    auto to = way_.row(path.standing_at(rows_, k), path.q[k]);
    if (there) {
      const auto next = way_.reached(to);
      Slopes rubbed;
      for (int c = 0; c < contacts; ++c)
        for (int i = 0; i < Window::size; ++i)
          rubbed(c, i) = next.history.state[std::size_t(c)].d[i / lane_count][i % lane_count];
      slopes_.noalias() = there->by_rubbing * rubbed;
      variables_->for_each_in(window_, [&](int lane, int variable) {
        slopes_.col(lane - window_.first) += there->by_variables.col(variable);
      });
    }
    for (int c = 0; c < contacts; ++c)
      for (int i = 0; i < Window::size; ++i)
        to.twist[std::size_t(c)].d[i / lane_count] += slopes_(c, i) * unit_lane(i % lane_count);
    way_.go(to);
    auto all = out.at(k);
    variables_->for_each_in(window_,
                            [&](int lane, int variable) { all.col(variable) = slopes_.col(lane - window_.first); });
  }

private:
  using Slopes = Eigen::Matrix<double, contacts, Window::size>;

  std::span<const RecordedRow<N>> rows_;
  const Variables<N, Fx>* variables_;
  Window window_;
  FollowerWay<N, Fx, Window> way_;
  Slopes slopes_ = Slopes::Zero();
};

}  // namespace detail

}  // namespace ctcr
