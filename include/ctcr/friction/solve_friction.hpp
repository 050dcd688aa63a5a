#pragma once
// Recorded rows of tubes that wind each other up, since they rub.
#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "ctcr/friction/path_solver.hpp"
#include "ctcr/friction/torsion_sensitivities.hpp"
#include "ctcr/parallel/thread_pool.hpp"

namespace ctcr {

namespace detail {

/// Places of a recording that are wound up together. What tubes rub depends on how they came to a place, but not for
/// long: friction forgets. So the places are walked in pieces at once, each from what the twist so far remembers at its
/// beginning; then, one after the other, where the piece before ended otherwise, again from its beginning to where that
/// makes no difference.
template <int N, class Fx>
class WoundPlaces {
  using Winder = detail::Winder<N, Fx>;
  static constexpr std::size_t piece = 32;     // places; fixed, so that answers do not depend on the number of threads
  static constexpr double alike = 1e-3;        // share of a limit of friction: no difference
  static constexpr double alike_twist = 1e-4;  // [rad]
  static constexpr double enough = 1e-6;       // tolerance of an equilibrium [rad]: far less than that

public:
  static constexpr std::size_t most = 32 * piece;

  /// @param path        of the rows, where this puts the twists that it finds
  /// @param equilibria  as Winder::wind() takes them, of all places
  /// @param variables   as Winder::wind() takes them, or null: no slopes
  WoundPlaces(const System<N, Fx>& system, std::span<const RecordedRow<N>> rows, RecordedPath<N, double>& path,
              std::span<std::optional<TipGuess<N>>> equilibria, const Variables<N, Fx>* variables, ThreadPool& pool)
    : system_(system), rows_(rows), path_(path), equilibria_(equilibria), variables_(variables), pool_(pool) {
    // Friction feels what readings show: the twist may be less exact than these.
    system_.settings.tolerance = std::max(system_.settings.tolerance, enough);
    system_.settings.steps = (system_.settings.steps + 1) / 2;
  }

  /// Winds up places first .. end - 1, at most `most`. @param winder  in: before the first of them; out: at the last one
  void wind(std::size_t first, std::size_t end, Winder& winder) {
    first_ = first;
    place_.assign(end - first, {});
    std::vector<Winder> begin;
    for (std::size_t k = first; k < end; ++k) {
      if ((k - first) % piece == 0) begin.push_back(winder);
      winder.pass(path_, k);
    }
    std::vector<Winder> ended = begin;
    const auto walk_piece = [&](std::size_t i, const Winder& from) noexcept {
      walk(first + i * piece, std::min(first + (i + 1) * piece, end), from, ended[i]);
    };
    pool_.parallel_for(int(begin.size()),
                       [&](int i, int) noexcept { walk_piece(std::size_t(i), begin[std::size_t(i)]); });
    for (std::size_t i = 1; i < begin.size(); ++i)
      if (!are_alike(begin[i].stand(), ended[i - 1].stand())) walk_piece(i, ended[i - 1]);
    winder = std::move(ended.back());
  }

  /// Slopes of the twist at a place, if it has an equilibrium.
  [[nodiscard]] const std::optional<typename Winder::Slopes>& slopes(std::size_t k) const noexcept {
    return place_[k - first_].slopes;
  }

private:
  struct Place {
    std::optional<typename Winder::Stand> stand;  ///< nothing: nobody was here yet
    std::optional<typename Winder::Slopes> slopes;
  };

  /// Winds up places k .. end - 1, or as many of them as are not yet so.
  void walk(std::size_t k, std::size_t end, Winder winder, Winder& ended) noexcept {
    auto row = std::size_t(std::ranges::lower_bound(path_.end, k) - path_.end.begin());
    for (; k < end; ++k) {
      row += k > path_.end[row];
      const std::size_t way = path_.way(rows_, row, k);
      Place& here = place_[k - first_];
      winder.wind(system_, on_the_way(rows_, row, way), rows_[row].twist[way], path_, k, equilibria_[k], variables_,
                  variables_ ? &here.slopes : nullptr);
      const bool was_so = here.stand && are_alike(*here.stand, winder.stand());
      here.stand = winder.stand();
      path_.q[k].twist = winder.stand().twist;
      if (was_so) return;
    }
    ended = std::move(winder);
  }

  static bool are_alike(const typename Winder::Stand& a, const typename Winder::Stand& b) noexcept {
    const auto within = [](double most) { return [=](double x, double y) { return std::abs(x - y) <= most; }; };
    return std::ranges::equal(a.rubbed, b.rubbed, within(alike)) &&
           std::ranges::equal(a.twist, b.twist, within(alike_twist));
  }

  System<N, Fx> system_;
  std::span<const RecordedRow<N>> rows_;
  RecordedPath<N, double>& path_;
  std::span<std::optional<TipGuess<N>>> equilibria_;
  const Variables<N, Fx>* variables_;
  ThreadPool& pool_;
  std::size_t first_ = 0;
  std::vector<Place> place_;
};

}  // namespace detail

/// Gives each row the twist_of() the system with its effects in equilibrium on the way there. Rows bring the twist of a
/// robot without effects, by add_twist(), or that of other values; a place without an equilibrium keeps it, with what the
/// place before was wound up. Answers do not depend on the number of threads. The twist is integrated with half of the
/// system's steps.
/// @param winding  in: its variables, places in SystemParameters<N, Fx>, and the equilibria of a winding before or none;
///                 out: how the twist changes with them; or null
/// @return the largest change of a twist [rad]   Real time: no.
template <int N, class Fx>
  requires(Fx::template On<N>::follows_twist && N > 1)
double wind_up(const System<N, Fx>& system, std::span<RecordedRow<N>> rows, ThreadPool& pool,
               Winding<N>* winding = nullptr) {
  using Window = detail::Window<4>;
  for (RecordedRow<N>& row : rows) row.twist.resize(row.places());
  if (rows.empty()) return 0;
  detail::RecordedPath<N, double> path(system.transmission, rows, [](double x, int) { return x; });
  const std::size_t places = path.q.size();
  Winding<N> own;
  Winding<N>& wound = winding ? *winding : own;
  const int count = int(wound.variables.size());
  detail::Variables<N, Fx> from_contacts, alone;
  for (int j = 0; j < count; ++j) {
    from_contacts.put(first_variable<N> + j, j, wound.variables[std::size_t(j)]);
    alone.put(j, j, wound.variables[std::size_t(j)]);
  }
  std::vector<detail::WindingSlopes<N, Fx>> ways;
  for (Window window; window.first < count; window.first += window.size) ways.emplace_back(system, rows, alone, window);
  wound.values = SystemParameters<N, Fx>::values(system)(wound.variables);
  wound.slopes = Eigen::MatrixXd::Zero(Contacts<N>::count, Eigen::Index(places) * count);
  if (wound.equilibria.size() != places) wound.equilibria.assign(places, {});
  using Together = detail::WoundPlaces<N, Fx>;
  Together together(system, rows, path, wound.equilibria, count > 0 ? &from_contacts : nullptr, pool);
  detail::Winder<N, Fx> winder(system.model.effects());
  for (std::size_t first = 0; first < places; first += Together::most) {
    const std::size_t end = std::min(first + Together::most, places);
    together.wind(first, end, winder);
    pool.parallel_for(int(ways.size()), [&](int i, int) noexcept {
      for (std::size_t k = first; k < end; ++k) {
        const auto& there = together.slopes(k);
        ways[std::size_t(i)].advance(path, k, there ? &*there : nullptr, wound);
      }
    });
  }
  double largest = 0;
  for (std::size_t row = 0, k = 0; row < rows.size(); ++row)
    for (Twist<N>& twist : rows[row].twist) {
      for (std::size_t c = 0; c < twist.size(); ++c)
        largest = std::max(largest, std::abs(path.q[k].twist[c] - twist[c]));
      twist = path.q[k++].twist;
    }
  return largest;
}

}  // namespace ctcr
