#pragma once
#include "ctcr/control/control_state.hpp"

namespace ctcr {

/// Follow the reference: feedforward of its velocity and feedback of the error. A rotation weight of 0 leaves the
/// orientation free. Ref: Boyer et al., Section IV.A. Real time: yes.
struct Tracking {
  static constexpr const char* name = "tracking";
  Weight weight{1e7, 0};
  double gain = 20;           ///< of the feedback [1/s]
  double correction = 20e-3;  ///< feedback is not faster than this [m/s]
  double tolerance = 1e-3;    ///< deviation from the wanted tip velocity beyond which it gave way [m/s]

  template <class S>
  [[nodiscard]] Vec6 velocity(const S& s) const noexcept {
    Vec6 feedback;
    feedback << s.reference.pose.position - s.tip.position,
        rotation_vector(s.reference.pose.rotation * s.tip.rotation.transpose());
    feedback *= gain;
    const double speed = feedback.head<3>().norm();
    return s.reference.velocity + (speed > correction ? correction / speed : 1.0) * feedback;
  }

  template <int N, class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    goals.add_tip_goal(s.solution.jacobian, velocity(s), weight);
  }

  /// How far the task gives way at q', in units of its tolerance.
  template <int N, class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>& s, const JointVelocity<N>& v) const noexcept {
    const Vec6 missing = s.solution.jacobian * v - velocity(s);
    const double turn = weight.rotation > 0 ? missing.tail<3>().norm() * rotation_per_translation : 0;
    return std::max(missing.head<3>().norm(), turn) / tolerance;
  }

private:
  static constexpr double rotation_per_translation = 0.05;  ///< [m]: 1 mm/s counts as much as 1.1 degrees/s
};

}  // namespace ctcr
