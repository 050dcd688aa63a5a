#pragma once
// Derivatives of the effects' history in each row of a recording by parameters of the system.
#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "ctcr/recording/history.hpp"
#include "ctcr/recording/variables.hpp"

namespace ctcr {

/// Derivatives of the history of one row; by default there are none.
struct RowHistorySensitivities {
  const double* derivatives = nullptr;  ///< (variables, kept states), column after column
  int variables = 0;
  const int* kept = nullptr;  ///< of each state of all effects, its column; -1: its derivatives are 0

  /// Derivatives of a state by all variables, or null.
  [[nodiscard]] const double* operator()(int state) const noexcept {
    return derivatives && kept[state] >= 0 ? derivatives + std::ptrdiff_t(kept[state]) * variables : nullptr;
  }
};

namespace detail {

/// Propagates the history of the effect that depends on torsion along a path, with derivatives by a window of variables.
template <int N, class Fx, class Window>
class HistoryPropagation {
  using S = typename Window::S;

public:
  using Effect = TorsionEffect<Fx, N, S>;
  using Row = typename Path<N, S>::Row;

  /// Keeps references to its arguments: they must outlive it.
  HistoryPropagation(const System<N, Fx>& system, std::span<const RecordedRow<N>> rows, const RecordedPath<N>& path,
                     const Variables<N, Fx>& variables, const Window& window) noexcept
    : transmission_(&system.transmission),
      rows_(rows),
      path_(&path),
      variables_(&variables),
      window_(window),
      effect_(std::get<0>(variables.template effects<typename Fx::OnTorsion>(system.model.effects(), window).list)) {
    effect_.history = {};
  }

  /// Sample k of the path, without derivatives of the torsion.
  [[nodiscard]] Row sample(std::size_t k) const noexcept {
    Row row;
    joints_of<N, S>(*transmission_, path_->sample(rows_, k).theta, variables_->seeding(window_), row.beta, row.alpha);
    std::ranges::copy(path_->q[k].torsion, row.torsion.begin());
    row.jumps = path_->q[k].jumps;
    return row;
  }

  /// The effect after the motion to the next sample; at the first one it has no history.
  [[nodiscard]] Effect after(const Row& to) const noexcept {
    Effect next = effect_;
    if (!from_) return next;
    const std::array<Row, 2> q{*from_, to};
    next.update_history({q, {}, {}, path_->radius}, 1);
    return next;
  }
  void advance(const Row& to) noexcept {
    effect_ = after(to);
    from_ = to;
  }
  [[nodiscard]] const Effect& effect() const noexcept { return effect_; }

private:
  const Transmission<N>* transmission_;
  std::span<const RecordedRow<N>> rows_;
  const RecordedPath<N>* path_;
  const Variables<N, Fx>* variables_;
  Window window_;
  Effect effect_;
  std::optional<Row> from_;
};

}  // namespace detail

/// Derivatives of the histories of all rows, by some parameters. Real time: no.
template <int N, class Fx>
class HistorySensitivities {
  using V = ParameterVector<N>;
  using On = typename Fx::template On<N>;
  using Window = detail::Window<4>;
  using S = typename Window::S;

public:
  /// Call fill() for all windows; then the derivatives are known. The arguments must outlive these calls.
  /// @param path       recorded_path() of the rows
  /// @param torsion    with which it was extrapolated
  /// @param variables  indices in SystemParameters<N, Fx>, each once
  /// @param wanted     rows whose derivatives are asked for
  HistorySensitivities(const System<N, Fx>& system, std::span<const RecordedRow<N>> rows, const RecordedPath<N>& path,
                       const LinearisedTorsion<N>& torsion, std::span<const int> variables,
                       const std::vector<bool>& wanted)
    : system_(system), rows_(rows), path_(path), torsion_(torsion), count_(int(variables.size())), slot_(rows.size()) {
    find_kept(variables);
    if (kept_count_ == 0) return;
    for (std::size_t j = 0; j < variables.size(); ++j) {
      const int v = variables[j];
      if (v >= V::index(Parameter::tracker_position) && v < V::count) continue;  // of the reading alone
      variables_.put(lanes_++, int(j), v);
      const auto found = std::ranges::find(torsion.variables, v);
      torsion_column_.push_back(found == torsion.variables.end() ? -1 : int(found - torsion.variables.begin()));
    }
    std::ptrdiff_t next = 0;
    for (std::size_t row = 0; row < rows.size(); ++row) slot_[row] = wanted[row] ? next++ : -1;
    derivatives_ = Eigen::MatrixXd::Zero(count_, next * kept_count_);
  }

  [[nodiscard]] int windows() const noexcept { return (lanes_ + Window::size - 1) / Window::size; }

  /// Different windows may be filled at once.
  void fill(int number) {
    const Window window{number * Window::size};
    auto effects = variables_.effects(system_.model.effects(), window, [](double, int) { return S(0.0); });
    int first = 0;
    std::apply([&](auto&... effect) { (propagate(effect, std::exchange(first, first + effect.states), window), ...); },
               effects.list);
  }

  [[nodiscard]] RowHistorySensitivities at(std::size_t row) const noexcept {
    if (kept_count_ == 0 || slot_[row] < 0) return {};
    return {derivatives_.data() + slot_[row] * kept_count_ * count_, count_, kept_.data()};
  }

private:
  /// Keeps the states of effects that act, or whose parameters are among the variables.
  void find_kept(std::span<const int> variables) {
    detail::Variables<N, Fx> any;
    for (const int v : variables)
      if (v >= V::count) any.put(0, 0, v);
    int state = 0;
    any.effects(system_.model.effects(), Window{}, [](double, int) { return S(0.0); })
        .for_each([&](const auto& effect, int) {
          for (int i = 0; i < effect.states; ++i) kept_[std::size_t(state++)] = effect.active ? kept_count_++ : -1;
        });
  }

  template <class E>
  void propagate(E& effect, int first, const Window& window) {
    if constexpr (E::states > 0) {
      if (!effect.active) return;
      if constexpr (DependsOnTorsion<E>) {
        detail::HistoryPropagation<N, Fx, Window> way(system_, rows_, path_, variables_, window);
        each_row(first, window, way.effect(), [&](std::size_t k) {
          auto to = way.sample(k);
          add_torsion_derivatives(k, window, to.torsion);
          way.advance(to);
        });
      } else {
        const RecordedPath<N, S> path(system_.transmission, rows_, variables_.seeding(window));
        each_row(first, window, effect, [&](std::size_t k) { effect.update_history(path, k); });
      }
    }
  }

  /// Calls advance(k) for each sample and keeps the derivatives of the effect's states in each row.
  void each_row(int first, const Window& window, const auto& effect, const auto& advance) {
    for (std::size_t row = 0, k = 0; row < rows_.size(); ++row) {
      for (; k <= path_.end[row]; ++k) advance(k);
      if (slot_[row] < 0) continue;
      for (int i = 0; i < effect.states; ++i) {
        const auto& d = effect.history.state[std::size_t(i)].d;
        auto column = derivatives_.col(slot_[row] * kept_count_ + kept_[std::size_t(first + i)]);
        variables_.for_each_in(window, [&](int lane, int variable) {
          const int here = lane - window.first;
          column[variable] = d[here / lane_count][here % lane_count];
        });
      }
    }
  }

  void add_torsion_derivatives(std::size_t k, const Window& window, RelativeTorsion<N, S>& torsion) const noexcept {
    if (torsion_.variables.empty()) return;
    const auto derivatives = torsion_.at(k);
    variables_.for_each_in(window, [&](int lane, int) {
      const int j = torsion_column_[std::size_t(lane)];
      if (j < 0) return;
      for (std::size_t c = 0; c < torsion.size(); ++c) window.add(torsion[c], lane, derivatives(Eigen::Index(c), j));
    });
  }

  const System<N, Fx>& system_;
  std::span<const RecordedRow<N>> rows_;
  const RecordedPath<N>& path_;
  const LinearisedTorsion<N>& torsion_;
  int count_, lanes_ = 0, kept_count_ = 0;
  detail::Variables<N, Fx> variables_;
  std::vector<int> torsion_column_;   ///< of each lane, its column in torsion_.at(); -1: none
  std::vector<std::ptrdiff_t> slot_;  ///< of each row in derivatives_; -1: not wanted
  std::array<int, std::size_t(std::max(1, On::states))> kept_;
  Eigen::MatrixXd derivatives_;
};

}  // namespace ctcr
