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

/// Stable equilibria at the same joints and load: that of a cold solve first, then those that solves from starts scattered
/// over all angles reach, in the order in which they are found. None that is listed is wrong; one whose basin of attraction
/// is small may be missing.
/// @param q, load, settings  as solve() takes them
/// @param starts  scattered starts, >= 0
/// @return the answers that are `ok`; empty where there is none. Real time: no.
template <Derivatives D = Derivatives::none, class Stepper = MagnusRk4, int N, class Fx>
std::vector<Solution<N>> all_equilibria(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load,
                                        const Settings& settings = {}, int starts = 100) {
  std::vector<Solution<N>> found;
  std::vector<TipGuess<N>> tips;
  Workspace<N> ws;
  for (int k = 0; k <= starts; ++k) {
    if (k > 0) ws.begin_at(detail::scattered_guess(q, k));
    Solution<N> out;
    if (solve<D, Stepper>(model, q, load, ws, out, settings) != Status::ok) continue;
    // The workspace's own frame may be turned about a force at the tip.
    const TipGuess<N> here{out.rotation, ws.guess.psi};
    const auto is_here = [&](const TipGuess<N>& other) {
      return detail::distance(here, other) < detail::same_equilibrium;
    };
    if (std::ranges::any_of(tips, is_here)) continue;
    tips.push_back(here);
    found.push_back(out);
  }
  return found;
}

}  // namespace ctcr
