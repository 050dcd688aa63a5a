#pragma once
// What is wrong with an answer of solve() or step(). The judge knows the equations (independent_rod.hpp), not the solver.
#include <string>

#include "robustness/independent_rod.hpp"
#include "support/defined_outputs.hpp"

namespace ctcr::test {

/// Whether an `ok` answer is an equilibrium of the model, to three times the stated accuracy, and stable.
/// @param ws  as the answer left it: the tip frame and the angles at the tubes' tips
/// @return empty, or what is wrong. An equilibrium so near to a snap that the discrete model and the exact one may differ
///         (det below 0.01) is not judged for stability.
template <int N>
std::string wrong_equilibrium(const Case<N>& c, const Workspace<N>& ws, const Solution<N>& s, double accuracy) {
  const IndependentRod<N> rod(c.robot, c.q, c.load);
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

/// Whether the tip is farther than three times the accuracy from that of the same equilibrium in 32 steps a segment.
template <int N>
std::string differs_from_32_steps(const Case<N>& c, const Model<N>& model, const Workspace<N>& ws, const Solution<N>& s,
                                  double accuracy) {
  Workspace<N> fine;
  fine.begin_at(ws.guess);
  Solution<N> exact;
  (void)solve<Derivatives::compliance>(model, c.q, c.load, fine, exact,
                                       {.max_iterations = 30, .tolerance = 1e-9, .steps = 32, .accuracy = as_told});
  const double off = (exact.position - s.position).norm() / length_of(c);
  if (!(exact.residual < 1e-6)) return "32 steps have no equilibrium there";
  // Newton's method may lead to another branch where the robot bends much: the equations alone decide then.
  if ((s.rotation - exact.rotation).norm() + (ws.guess.psi - fine.guess.psi).norm() > 0.1)
    return wrong_equilibrium(c, ws, s, accuracy);
  if (!(off < 3 * accuracy)) return "the tip is " + std::to_string(off) + " of the length from that in 32 steps";
  return {};
}

}  // namespace ctcr::test
