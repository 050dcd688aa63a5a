#pragma once
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "ctcr/friction/path_nodes.hpp"
#include "ctcr/friction/path_solver.hpp"
#include "ctcr/parallel/thread_pool.hpp"

namespace ctcr::detail {

/// Nodes of the path of a recording, solved by several threads. Friction depends on how the tubes came to a sample, but not for
/// long: it forgets. So the path is cut into segments, which are solved at once, each from the state that the torsion known
/// so far gives at its beginning. Where the segment before ends in another state, the next one is solved again from that,
/// up to the node from which the difference is negligible.
template <int N, class Fx>
class SolvedSamples {
  using Solver = PathSolver<N, Fx>;
  static constexpr std::size_t segment = 32;  // nodes; fixed, so that answers do not depend on the number of threads
  static constexpr double alike = 1e-3, alike_torsion = 1e-4;  // no difference: of the limit of friction; [rad]
  static constexpr double tolerance = 1e-6;                    // of an equilibrium [rad]: far less than that

public:
  static constexpr std::size_t most = 32 * segment;

  /// @param path        of the rows; takes the torsion that is found
  /// @param equilibria  of all samples: where to look for them, then where they are
  /// @param variables   as PathSolver::linearise() takes them; without any, nothing is linearised
  SolvedSamples(const System<N, Fx>& system, std::span<const RecordedRow<N>> rows, RecordedPath<N>& path,
                const PathNodes<N>& nodes, std::span<std::optional<WarmStart<N>>> equilibria,
                const Variables<N, Fx>& variables, ThreadPool& pool)
    : system_(system),
      rows_(rows),
      path_(path),
      nodes_(nodes),
      equilibria_(equilibria),
      variables_(variables),
      pool_(pool) {
    // Readings show a fraction of the torsion: it may be less exact than these.
    system_.settings.tolerance = std::max(system_.settings.tolerance, tolerance);
    system_.settings.steps = (system_.settings.steps + 1) / 2;
  }

  /// Solves nodes first .. end - 1, at most `most`. @param solver  in: before the first of them; out: at the last one
  void solve(std::size_t first, std::size_t end, Solver& solver) {
    first_ = first;
    samples_.assign(end - first, {});
    std::vector<Solver> begin;
    for (std::size_t i = first; i < end; ++i) {
      if ((i - first) % segment == 0) begin.push_back(solver);
      solver.pass(path_, nodes_[i]);
    }
    std::vector<Solver> ended = begin;
    const auto solve_segment = [&](std::size_t i, const Solver& from) noexcept {
      walk(first + i * segment, std::min(first + (i + 1) * segment, end), from, ended[i]);
    };
    pool_.parallel_for(int(begin.size()),
                       [&](int i, int) noexcept { solve_segment(std::size_t(i), begin[std::size_t(i)]); });
    for (std::size_t i = 1; i < begin.size(); ++i)
      if (!are_alike(begin[i].state(), ended[i - 1].state())) solve_segment(i, ended[i - 1]);
    solver = std::move(ended.back());
  }

  /// Derivatives of the torsion at a node, if it has an equilibrium.
  [[nodiscard]] const std::optional<TorsionDerivatives<N>>& derivatives(std::size_t i) const noexcept {
    return samples_[i - first_].derivatives;
  }

private:
  struct Sample {
    std::optional<typename Solver::State> state;  ///< nothing: not solved yet
    std::optional<TorsionDerivatives<N>> derivatives;
  };

  /// Solves nodes i .. end - 1, or those up to one that is already so.
  void walk(std::size_t i, std::size_t end, Solver solver, Solver& ended) noexcept {
    for (; i < end; ++i) {
      const std::size_t k = nodes_[i];
      const auto [row, of_row] = path_.index[k];
      const RecordedRow<N> sample = path_.sample(rows_, k);
      Sample& solved = samples_[i - first_];
      solver.solve(system_, sample, rows_[row].torsion[of_row], path_, k, equilibria_[k]);
      if (variables_.size() > 0) solved.derivatives = solver.linearise(system_, sample, variables_);
      equilibria_[k] = solver.equilibrium();
      const bool was_so = solved.state && are_alike(*solved.state, solver.state());
      solved.state = solver.state();
      path_.q[k].torsion = solver.state().torsion;
      if (was_so) return;
    }
    ended = std::move(solver);
  }

  static bool are_alike(const typename Solver::State& a, const typename Solver::State& b) noexcept {
    const auto within = [](double most) { return [=](double x, double y) { return std::abs(x - y) <= most; }; };
    return std::ranges::equal(a.friction, b.friction, within(alike)) &&
           std::ranges::equal(a.torsion, b.torsion, within(alike_torsion));
  }

  System<N, Fx> system_;
  std::span<const RecordedRow<N>> rows_;
  RecordedPath<N>& path_;
  const PathNodes<N>& nodes_;
  std::span<std::optional<WarmStart<N>>> equilibria_;
  const Variables<N, Fx>& variables_;
  ThreadPool& pool_;
  std::size_t first_ = 0;
  std::vector<Sample> samples_;
};

}  // namespace ctcr::detail
