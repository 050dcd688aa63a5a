#pragma once
#include "ctcr/control/control_state.hpp"

namespace ctcr {

/// Keep away from snapping: where Solution::stability is below `wanted`, up its gradient, found by differences (2N + 1
/// solves from the warm start, only there). Real time: yes.
struct StabilityMargin {
  static constexpr const char* name = "stability margin";
  Weight weight{};
  double wanted = 0.3;  ///< det B_u: 1 without interaction between the tubes, 0 where the robot snaps
  double rate = 1;      ///< of its increase [1/s]

  /// d(stability)/dq by one-sided differences.
  template <int N, class Fx>
  [[nodiscard]] static JointVelocity<N> gradient(const ControlState<N, Fx>& s) noexcept {
    constexpr double translation = 1e-5, rotation = 1e-4;
    JointVelocity<N> g = JointVelocity<N>::Zero();
    double here = 0;
    const auto at = [&s](const Joints<N>& q, double& stability) noexcept {
      Workspace<N> ws = s.ws;
      Solution<N> there;
      const Status status = solve<Derivatives::jacobian>(s.model, q, s.load, ws, there, s.settings);
      stability = there.stability;
      return has_equilibrium(status);
    };
    if (!at(s.q, here)) return g;
    for (int j = 0; j < 2 * N; ++j) {
      Joints<N> q = s.q;
      // A step that would leave the order of the tubes is left out: that joint cannot help there.
      const double step = j < N ? -translation : rotation;
      (j < N ? q.beta[j] : q.alpha[j - N]) += step;
      double there = 0;
      if (at(q, there)) g[j] = (there - here) / step;
    }
    return g;
  }

  template <int N, class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    if (!(weight.translation > 0 || weight.rotation > 0) || s.solution.stability >= wanted) return;
    const JointVelocity<N> g = gradient(s);
    const double steepness = g.squaredNorm();
    if (steepness > 0) goals.add_joint_goal(rate * (wanted - s.solution.stability) / steepness * g, weight);
  }

  template <int N, class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>& s, const JointVelocity<N>&) const noexcept {
    return weight.translation > 0 || weight.rotation > 0 ? 2 - s.solution.stability / wanted : 0;
  }
};

}  // namespace ctcr
