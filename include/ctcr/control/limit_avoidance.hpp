#pragma once
#include "ctcr/control/control_state.hpp"

namespace ctcr {

/// Keep away from the limits of the actuators: down the gradient of L, the sum of the squared gaps. Gaps add up to a
/// constant, so L is least where they are equal. Ref: Boyer et al., Section IV.A. Real time: yes.
struct LimitAvoidance {
  static constexpr const char* name = "limit avoidance";
  Weight weight{100, 0};
  double rate = 100;      ///< v = -rate dL/dq [1/s]
  double comfort = 5e-3;  ///< gap below which a step that narrows it gave way [m]

  /// dL/dq.
  template <int N>
  [[nodiscard]] static JointVelocity<N> gradient(const Robot<N>& robot, const VecN<N>& beta) noexcept {
    const Gaps<N> g = gaps(robot, beta);
    JointVelocity<N> d = JointVelocity<N>::Zero();
    for (int i = 0; i < N; ++i) {
      d[i] += 2 * (g.tips[i] - g.bases[i]);
      if (i > 0) d[i] += 2 * (g.bases[i - 1] - g.tips[i - 1]);
    }
    return d;
  }

  template <int N, class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    goals.add_joint_goal(-rate * gradient(s.model.robot(), s.q.beta), weight);
  }

  template <int N, class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>& s, const JointVelocity<N>& v) const noexcept {
    const Gaps<N> now = gaps(s.model.robot(), s.q.beta);
    const VecN<N> ahead = s.q.beta + v.template head<N>();
    const Gaps<N> later = gaps(s.model.robot(), ahead);
    double worst = 0;
    for (int i = 0; i < N; ++i) {
      if (later.bases[i] < now.bases[i]) worst = std::max(worst, 2 - now.bases[i] / comfort);
      if (later.tips[i] < now.tips[i]) worst = std::max(worst, 2 - now.tips[i] / comfort);
    }
    return worst;
  }
};

}  // namespace ctcr
