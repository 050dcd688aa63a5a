#pragma once
#include <span>

#include "ctcr/friction/relative_torsion.hpp"
#include "ctcr/recording/history_sensitivities.hpp"

namespace ctcr::detail {

/// Propagates the derivatives of torsion and friction from node to node, for a window of variables.
template <int N, class Fx>
class TorsionSensitivities {
  static constexpr int contacts = Contacts<N>::count;
  using Window = detail::Window<4>;
  using ByLanes = Eigen::Matrix<double, contacts, Window::size>;

public:
  TorsionSensitivities(const System<N, Fx>& system, std::span<const RecordedRow<N>> rows, const RecordedPath<N>& path,
                       const Variables<N, Fx>& variables, const Window& window) noexcept
    : variables_(&variables), window_(window), history_(system, rows, path, variables, window) {}

  /// To sample k, straight on from that of the call before.
  /// @param there  derivatives of the torsion there, as PathSolver::linearise() gives them; nothing without an equilibrium:
  ///               then it keeps those of the sample before
  void advance(std::size_t k, const std::optional<TorsionDerivatives<N>>& there, LinearisedTorsion<N>& out) noexcept {
    auto to = history_.sample(k);
    if (there) {
      const auto effect = history_.after(to);  // friction if the torsion there did not depend on the variables
      ByLanes friction;
      for (int c = 0; c < contacts; ++c)
        for (int i = 0; i < Window::size; ++i)
          friction(c, i) = effect.history.state[std::size_t(c)].d[i / lane_count][i % lane_count];
      torsion_.noalias() = there->by_friction * friction;
      variables_->for_each_in(window_, [&](int lane, int variable) {
        torsion_.col(lane - window_.first) += there->by_variables.col(variable);
      });
    }
    for (int c = 0; c < contacts; ++c)
      for (int i = 0; i < Window::size; ++i)
        to.torsion[std::size_t(c)].d[i / lane_count] += torsion_(c, i) * unit_lane(i % lane_count);
    history_.advance(to);
    auto all = out.at(k);
    variables_->for_each_in(window_,
                            [&](int lane, int variable) { all.col(variable) = torsion_.col(lane - window_.first); });
  }

private:
  const Variables<N, Fx>* variables_;
  Window window_;
  HistoryPropagation<N, Fx, Window> history_;
  ByLanes torsion_ = ByLanes::Zero();
};

}  // namespace ctcr::detail
