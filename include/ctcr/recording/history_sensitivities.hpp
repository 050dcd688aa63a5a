#pragma once
// What the motion before each row left behind in the effects: its slopes by the system's parameters.
#include <algorithm>
#include <span>
#include <vector>

#include "ctcr/recording/history_propagation.hpp"
#include "ctcr/recording/linearised_torsion.hpp"

namespace ctcr {

/// Slopes of what the past left behind at one row; by default none.
struct PastSlopesOfRow {
  const double* slopes = nullptr;  ///< (variables, kept numbers), column after column
  int variables = 0;
  const int* kept = nullptr;  ///< of each number, its place among those that are kept; -1: its slopes are 0

  /// Slopes of a number by all variables, or null.
  [[nodiscard]] const double* operator()(int state) const noexcept {
    return slopes && kept[state] >= 0 ? slopes + std::ptrdiff_t(kept[state]) * variables : nullptr;
  }
};

/// Those of all rows, by some parameters. Real time: no.
template <int N, class Fx>
class PastSlopes {
  using V = ParameterVector<N>;
  using On = typename Fx::template On<N>;
  using Window = detail::Window<4>;
  using S = typename Window::S;

public:
  /// Fill all windows; then they are known. What is given must outlive this.
  /// @param rows       as histories() takes them
  /// @param variables  places in SystemParameters<N, Fx>, each once
  /// @param wanted     rows whose slopes are asked for
  PastSlopes(const System<N, Fx>& system, std::span<const RecordedRow<N>> rows, std::span<const int> variables,
             const Winding<N>& winding, const std::vector<bool>& wanted)
    : system_(system), rows_(rows), winding_(winding), count_(int(variables.size())), place_(rows.size(), -1) {
    kept_.fill(-1);
    find_kept(variables);
    if (kept_count_ == 0) return;
    for (std::size_t j = 0; j < variables.size(); ++j) {
      const int v = variables[j];
      if (v >= V::index(Parameter::tracker_position) && v < V::count) continue;  // of the reading alone
      variables_.put(lanes_++, int(j), v);
      const auto wound = std::ranges::find(winding.variables, v);
      wound_.push_back(wound == winding.variables.end() ? -1 : int(wound - winding.variables.begin()));
    }
    std::ptrdiff_t next = 0;
    for (std::size_t row = 0; row < rows.size(); ++row)
      if (wanted[row]) place_[row] = next++;
    slopes_ = Eigen::MatrixXd::Zero(count_, next * kept_count_);
    if constexpr (On::follows_twist) {
      path_.emplace(system.transmission, rows, [](double x, int) { return x; });
      winding.unwind(SystemParameters<N, Fx>::values(system), *path_);
    }
  }

  [[nodiscard]] int windows() const noexcept { return (lanes_ + Window::size - 1) / Window::size; }

  /// Different windows may be filled at once.
  void fill(int window) {
    const Window here{window * Window::size};
    auto effects = variables_.effects(system_.model.effects(), here, [](double, int) { return S(0.0); });
    int first = 0;
    std::apply([&](auto&... effect) { (follow(effect, std::exchange(first, first + effect.states), here), ...); },
               effects.list);
  }

  [[nodiscard]] PastSlopesOfRow at(std::size_t row) const noexcept {
    if (kept_count_ == 0 || place_[row] < 0) return {};
    return {slopes_.data() + place_[row] * kept_count_ * count_, count_, kept_.data()};
  }

private:
  /// Those of effects that act, or are asked for.
  void find_kept(std::span<const int> variables) {
    const auto all = [&] {
      detail::Variables<N, Fx> any;
      for (const int v : variables)
        if (v >= V::count) any.put(0, 0, v);
      return any.effects(system_.model.effects(), Window{}, [](double, int) { return S(0.0); });
    }();
    int first = 0;
    all.for_each([&](const auto& effect, int) {
      for (int i = 0; i < effect.states; ++i)
        if (effect.active) kept_[std::size_t(first + i)] = kept_count_++;
      first += effect.states;
    });
  }

  template <class E>
  void follow(E& effect, int first, const Window& window) {
    if constexpr (E::states > 0) {
      if (!effect.active) return;
      if constexpr (FollowsTwist<E>)
        follow_twist(first, window);
      else
        follow_joints(effect, first, window);
    }
  }

  void follow_joints(auto& effect, int first, const Window& window) {
    const detail::RecordedPath<N, S> path(system_.transmission, rows_, variables_.seeding(window));
    for (std::size_t row = 0, k = 0; row < rows_.size(); ++row) {
      for (; k <= path.end[row]; ++k) effect.update_history(path, k);
      keep(effect, first, window, row);
    }
  }

  void follow_twist(int first, const Window& window) {
    detail::FollowerWay<N, Fx, Window> way(system_, path_->radius, variables_, window);
    for (std::size_t row = 0, k = 0; row < rows_.size(); ++row) {
      for (; k <= path_->end[row]; ++k) {
        auto to = way.row(path_->standing_at(rows_, k), path_->q[k]);
        add_slopes_of_twist(k, window, to.twist);
        way.go(to);
      }
      keep(way.effect(), first, window, row);
    }
  }

  void add_slopes_of_twist(std::size_t k, const Window& window, Twist<N, S>& twist) const noexcept {
    if (winding_.variables.empty()) return;
    const auto slopes = winding_.at(k);
    variables_.for_each_in(window, [&](int lane, int) {
      const int j = wound_[std::size_t(lane)];
      if (j < 0) return;
      for (std::size_t c = 0; c < twist.size(); ++c) window.add(twist[c], lane, slopes(Eigen::Index(c), j));
    });
  }

  void keep(const auto& effect, int first, const Window& window, std::size_t row) noexcept {
    if (place_[row] < 0) return;
    for (int i = 0; i < effect.states; ++i) {
      const auto& d = effect.history.state[std::size_t(i)].d;
      auto column = slopes_.col(place_[row] * kept_count_ + kept_[std::size_t(first + i)]);
      variables_.for_each_in(window, [&](int lane, int variable) {
        const int here = lane - window.first;
        column[variable] = d[here / lane_count][here % lane_count];
      });
    }
  }

  const System<N, Fx>& system_;
  std::span<const RecordedRow<N>> rows_;
  const Winding<N>& winding_;
  int count_, lanes_ = 0, kept_count_ = 0;
  detail::Variables<N, Fx> variables_;
  std::vector<int> wound_;             ///< of each lane, its place among the variables of the winding; -1: none
  std::vector<std::ptrdiff_t> place_;  ///< of each row
  std::array<int, std::size_t(std::max(1, On::states))> kept_;
  std::optional<detail::RecordedPath<N, double>> path_;  ///< with the twist of this system
  Eigen::MatrixXd slopes_;
};

/// All of them.
template <int N, class Fx>
PastSlopes<N, Fx> past_slopes(const System<N, Fx>& system, std::span<const RecordedRow<N>> rows,
                              std::span<const int> variables, const Winding<N>& winding = {}) {
  PastSlopes<N, Fx> slopes(system, rows, variables, winding, std::vector<bool>(rows.size(), true));
  for (int window = 0; window < slopes.windows(); ++window) slopes.fill(window);
  return slopes;
}

}  // namespace ctcr
