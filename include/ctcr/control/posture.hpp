#pragma once
#include "ctcr/control/control_state.hpp"

namespace ctcr {

/// Drift towards preferred joints where the other tasks leave freedom. Real time: yes.
template <int N>
struct Posture {
  static constexpr const char* name = "posture";
  Weight weight{};
  Joints<N> preferred;
  double rate = 0.1;        ///< [1/s]
  double tolerance = 0.05;  ///< distance from the preferred positions beyond which it gave way [m]

  template <class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    JointVelocity<N> v;
    v << preferred.beta - s.q.beta, preferred.alpha - s.q.alpha;
    goals.add_joint_goal(rate * v, weight);
  }

  template <class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>& s, const JointVelocity<N>&) const noexcept {
    return weight.translation > 0 ? (preferred.beta - s.q.beta).cwiseAbs().maxCoeff() / tolerance : 0;
  }
};

}  // namespace ctcr
