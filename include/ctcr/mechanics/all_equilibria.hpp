#pragma once
// The stable equilibria of one configuration, where the robot may rest in several.
#include <algorithm>
#include <vector>

#include "ctcr/mechanics/solve.hpp"

namespace ctcr {
namespace detail {

/// Two tips that differ by less, in frame and angles of the tubes [rad], are of one equilibrium: between two stable ones lies an unstable one.
inline constexpr double same_equilibrium = 1e-2;

}  // namespace detail

/// One of several stable equilibria.
template <int N>
struct Equilibrium {
  Solution<N> solution;
  Workspace<N> workspace;  ///< warm start from which to go on: of solve(), step(), shape()
};

/// Stable equilibria at the same joints and load: that of a cold solve first, then those that solves from starts scattered
/// over all angles reach, in the order in which they are found. None that is listed is wrong; one whose basin of attraction
/// is small may be missing.
/// @param q, load, settings  as solve() takes them
/// @param starts  scattered starts, >= 0
/// @return the answers that are `ok`; empty where there is none. Real time: no.
template <Derivatives D = Derivatives::none, class Stepper = MagnusRk4, int N, class Fx>
std::vector<Equilibrium<N>> all_equilibria(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load,
                                           const Settings& settings = {}, int starts = 100) {
  std::vector<Equilibrium<N>> found;
  for (int k = 0; k <= starts; ++k) {
    Equilibrium<N> one;
    if (k > 0) one.workspace.begin_at(detail::scattered_guess(q, k));
    if (solve<D, Stepper>(model, q, load, one.workspace, one.solution, settings) != Status::ok) continue;
    // The workspace's own frame may be turned about a force at the tip.
    const auto tip = [](const Equilibrium<N>& e) { return TipGuess<N>{e.solution.rotation, e.workspace.guess.psi}; };
    const auto is_here = [&](const Equilibrium<N>& other) {
      return detail::distance(tip(one), tip(other)) < detail::same_equilibrium;
    };
    if (std::ranges::none_of(found, is_here)) found.push_back(one);
  }
  return found;
}

}  // namespace ctcr
