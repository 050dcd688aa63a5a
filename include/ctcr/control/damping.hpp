#pragma once
#include "ctcr/control/control_state.hpp"

namespace ctcr {

/// Move the joints little. Ref: Boyer et al., Section IV.A. Real time: yes.
struct Damping {
  static constexpr const char* name = "damping";
  Weight weight{1e6, 10};
  double translation = 20e-3, rotation = 2;  ///< speeds beyond which it gave way [m/s], [rad/s]

  template <int N, class Fx>
  void add(const ControlState<N, Fx>&, LeastSquares<N>& goals) const noexcept {
    goals.add_joint_goal(JointVelocity<N>::Zero(), weight);
  }

  template <int N, class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>&, const JointVelocity<N>& v) const noexcept {
    return std::max(v.template head<N>().cwiseAbs().maxCoeff() / translation,
                    v.template tail<N>().cwiseAbs().maxCoeff() / rotation);
  }
};

}  // namespace ctcr
