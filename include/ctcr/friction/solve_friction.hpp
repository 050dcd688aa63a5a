#pragma once
// Friction along a recording. Tubes that rub twist each other, and the angle by which they turn against each other at their
// contacts, the relative torsion, decides what friction does next. Solved here: history, torsion and equilibrium along the
// recording, and how the torsion changes with the parameters. In parts:
//
//   frictionless_torsion.hpp    samples, and the torsion to start from
//   relative_torsion.hpp        torsion in one equilibrium, and its derivatives
//   torsion_solver.hpp          friction and torsion at one sample: Newton's method
//   path_nodes.hpp              the samples at which friction is solved
//   path_solver.hpp             from node to node
//   solved_samples.hpp          segments of the path by several threads
//   torsion_sensitivities.hpp   derivatives from node to node
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "ctcr/friction/solved_samples.hpp"
#include "ctcr/friction/torsion_sensitivities.hpp"

namespace ctcr {

/// Gives each row the relative_torsion() of the system with its effects in equilibrium, at all samples. Rows bring the
/// torsion of a robot without effects, by set_frictionless_torsion(), or that of other values; a sample without an equilibrium
/// keeps it, plus the difference at the sample before. Answers do not depend on the number of threads. The torsion is
/// integrated with half of the system's steps.
/// @param out  in: its variables, indices in SystemParameters<N, Fx>, and the equilibria of a solution before, or none;
///             out: how the torsion changes with the variables; or null
/// @return the largest change of a torsion [rad]   Real time: no.
template <int N, class Fx>
  requires(Fx::template On<N>::depends_on_torsion && N > 1)
double solve_friction(const System<N, Fx>& system, std::span<RecordedRow<N>> rows, ThreadPool& pool,
                      LinearisedTorsion<N>* out = nullptr) {
  using Window = detail::Window<4>;
  using Samples = detail::SolvedSamples<N, Fx>;
  for (RecordedRow<N>& row : rows) row.torsion.resize(row.samples());
  if (rows.empty()) return 0;
  LinearisedTorsion<N> none;
  LinearisedTorsion<N>& linear = out ? *out : none;

  // The samples of the path, with the torsion that the rows bring; the equilibria to start from.
  RecordedPath<N> path = recorded_path<N, Fx>(system, rows);
  const std::size_t count = path.q.size();
  const int variables = int(linear.variables.size());
  linear.values = SystemParameters<N, Fx>::values(system)(linear.variables);
  linear.derivatives = Eigen::MatrixXd::Zero(Contacts<N>::count, Eigen::Index(count) * variables);
  if (linear.equilibria.size() != count) linear.equilibria.assign(count, {});

  // The variables in the lanes of a torsion's derivatives, and alone in windows that are propagated along the path.
  detail::Variables<N, Fx> after_contacts, alone;
  for (int j = 0; j < variables; ++j) {
    after_contacts.put(first_variable<N> + j, j, linear.variables[std::size_t(j)]);
    alone.put(j, j, linear.variables[std::size_t(j)]);
  }
  std::vector<detail::TorsionSensitivities<N, Fx>> sensitivities;
  for (Window window; window.first < variables; window.first += window.size)
    sensitivities.emplace_back(system, rows, path, alone, window);

  // Friction, torsion and equilibrium at each node, then the derivatives from node to node.
  const detail::PathNodes<N> nodes(rows, path);
  Samples samples(system, rows, path, nodes, linear.equilibria, after_contacts, pool);
  detail::PathSolver<N, Fx> solver(system.model.effects());
  for (std::size_t first = 0; first < nodes.size(); first += Samples::most) {
    const std::size_t end = std::min(first + Samples::most, nodes.size());
    samples.solve(first, end, solver);
    pool.parallel_for(int(sensitivities.size()), [&](int j, int) noexcept {
      for (std::size_t i = first; i < end; ++i)
        sensitivities[std::size_t(j)].advance(nodes[i], samples.derivatives(i), linear);
    });
  }

  // Between the nodes, interpolate what friction adds to the torsion, and the derivatives.
  using Vec = VecN<Contacts<N>::count>;
  const auto given = [&](std::size_t k) {
    return Vec::Map(rows[path.index[k].row].torsion[path.index[k].of_row].data());
  };
  const auto found = [&](std::size_t k) { return Vec::Map(path.q[k].torsion.data()); };
  nodes.for_each_between([&](std::size_t k, std::size_t a, std::size_t b, double part) {
    found(k) = given(k) + (1 - part) * (found(a) - given(a)) + part * (found(b) - given(b));
    linear.at(k) = (1 - part) * linear.at(a) + part * linear.at(b);
  });

  // The torsion back into the rows.
  double largest = 0;
  for (std::size_t k = 0; k < count; ++k) {
    RelativeTorsion<N>& torsion = rows[path.index[k].row].torsion[path.index[k].of_row];
    for (std::size_t c = 0; c < torsion.size(); ++c)
      largest = std::max(largest, std::abs(path.q[k].torsion[c] - torsion[c]));
    torsion = path.q[k].torsion;
  }
  return largest;
}

}  // namespace ctcr
