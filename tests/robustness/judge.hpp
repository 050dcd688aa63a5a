#pragma once
// What is wrong with an answer of solve() or step(). The judge knows the equations (independent_rod.hpp), not the solver.
#include <string>

#include "robustness/independent_rod.hpp"
#include "support/defined_outputs.hpp"

namespace ctcr::test {

/// Effects that the judge knows, too.
template <int N>
struct Known {
  typename IndependentRod<N>::Materials materials{};
  Vec3 tip_force = Vec3::Zero();  ///< beside the load, base frame [N]
};

/// Whether an `ok` answer is an equilibrium of the model, to three times the stated accuracy, and stable.
/// @param ws     as the answer left it: the tip frame and the angles at the tubes' tips
/// @param known  what the effects of the model make of the robot
/// @return empty, or what is wrong. An equilibrium so near to a snap that the discrete model and the exact one may differ
///         (det below 0.01) is not judged for stability.
template <int N>
std::string wrong_equilibrium(const Case<N>& c, const Workspace<N>& ws, const Solution<N>& s, double accuracy,
                              const Known<N>& known = {}) {
  const TipLoad load{c.load.force + known.tip_force, c.load.moment};
  const IndependentRod<N> rod(c.robot, c.q, load, known.materials);
  // Under a force alone any turn about it leaves the workspace's frame as good; that of the tip is the one.
  typename IndependentRod<N>::Tip tip{s.rotation, ws.guess.psi};
  typename IndependentRod<N>::Miss found;
  const double left = rod.solve(tip, found), off = (found.tip - s.position).norm() / length_of(c);
  if (!(left < 1e-6)) return "no equilibrium: misses the grasps by " + std::to_string(left) + " rad";
  if (!(off < 3 * accuracy)) return "the tip is off by " + std::to_string(off) + " of the length";
  const double stability = rod.smallest_determinant(tip);
  if (!(stability > -0.01)) return "unstable: determinant " + std::to_string(stability);
  return {};
}

/// Whether the tip is farther than three times the accuracy from that of the same equilibrium in at least 32 steps a segment
/// and twice as many as the answer took.
/// @param model  with effects or without   @param same_branch  out: whether finer steps lead to the same equilibrium; where
///               the robot bends much, Newton's method may lead to another one or to none
template <int N>
std::string differs_from_finer_steps(const Case<N>& c, const auto& model, const Workspace<N>& ws, const Solution<N>& s,
                                     double accuracy, bool& same_branch) {
  Workspace<N> fine;
  fine.begin_at(ws.guess);
  Solution<N> exact;
  const int steps = std::max(32, 2 * ws.steps.times * ws.steps.largest_share());
  (void)solve<Derivatives::compliance>(model, c.q, c.load, fine, exact,
                                       {.max_iterations = 30, .tolerance = 1e-9, .steps = steps, .accuracy = as_told});
  const double off = (exact.position - s.position).norm() / length_of(c);
  same_branch =
      exact.residual < 1e-6 && (s.rotation - exact.rotation).norm() + (ws.guess.psi - fine.guess.psi).norm() <= 0.1;
  if (same_branch && !(off < 3 * accuracy))
    return "the tip is " + std::to_string(off) + " of the length from that in finer steps";
  return {};
}

}  // namespace ctcr::test
