#pragma once
#include <span>

#include "ctcr/friction/relative_torsion.hpp"
#include "ctcr/recording/history_propagation.hpp"
#include "ctcr/recording/linearised_torsion.hpp"

namespace ctcr::detail {

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

}  // namespace ctcr::detail
