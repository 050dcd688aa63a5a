#pragma once
// The internal state of the effects in each row of a recording.
#include <span>
#include <vector>

#include "ctcr/recording/linearised_torsion.hpp"
#include "ctcr/system/parameters.hpp"

namespace ctcr {

/// The path of a system along a recording; without samples if no effect of the system has a history.
/// @param torsion  how the torsion of the rows changes with the parameters; by default it does not
/// Real time: no (allocates).
template <int N, class Fx>
RecordedPath<N> recorded_path(const System<N, Fx>& system, std::span<const RecordedRow<N>> rows,
                              const LinearisedTorsion<N>& torsion = {}) {
  if constexpr (Fx::template On<N>::states == 0) rows = {};
  RecordedPath<N> path(system.transmission, rows, [](double x, int) { return x; });
  torsion.extrapolate(SystemParameters<N, Fx>::values(system), path);
  return path;
}

/// The history of the effects in each row.
/// @param path  recorded_path() of these rows   Real time: no (allocates).
template <int N, class Fx>
std::vector<typename Fx::template On<N>::History> histories(const System<N, Fx>& system,
                                                            std::span<const RecordedRow<N>> rows,
                                                            const RecordedPath<N>& path) {
  std::vector<typename Fx::template On<N>::History> history(rows.size());
  if constexpr (Fx::template On<N>::states > 0) {
    auto effects = system.model.effects();
    effects.set_history({});
    for (std::size_t row = 0, k = 0; row < rows.size(); ++row) {
      for (; k <= path.end[row]; ++k) effects.update_history(path, k);
      history[row] = effects.history();
    }
  }
  return history;
}
template <int N, class Fx>
auto histories(const System<N, Fx>& system, std::span<const RecordedRow<N>> rows) {
  return histories(system, rows, recorded_path(system, rows));
}

}  // namespace ctcr
