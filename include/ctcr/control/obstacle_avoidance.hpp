#pragma once
#include "ctcr/control/control_state.hpp"

namespace ctcr {

/// A ball that the tip must not touch. Base frame.
struct Obstacle {
  Vec3 centre = Vec3::Zero();  ///< [m]
  double radius = 0;           ///< [m]; 0: there is none
};

/// Keep the tip away from an obstacle: a velocity that points away from it, inversely proportional to the square of the
/// distance to its surface. Ref: Boyer et al., Section IV.A. Real time: yes.
struct ObstacleAvoidance {
  static constexpr const char* name = "obstacle avoidance";
  Weight weight{10, 0};
  Obstacle obstacle;
  double strength = 0.1;  ///< velocity times squared distance [m^3/s]
  double range = 10e-3;   ///< distance below which a step towards the obstacle gave way [m]

  /// From the surface to the tip [m].
  [[nodiscard]] double distance(const Vec3& tip) const noexcept {
    return (tip - obstacle.centre).norm() - obstacle.radius;
  }

  template <int N, class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    if (!(obstacle.radius > 0)) return;
    constexpr double nearest = 1e-4;  // [m]: the velocity stays finite on the surface, and points out from inside
    const double d = std::max(distance(s.tip.position), nearest);
    Vec6 away = Vec6::Zero();
    away.head<3>() = strength / (d * d) * (s.tip.position - obstacle.centre).normalized();
    goals.add_tip_goal(s.solution.jacobian, away, weight);
  }

  template <int N, class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>& s, const JointVelocity<N>& v) const noexcept {
    if (!(obstacle.radius > 0)) return 0;
    const Vec3 move = (s.solution.jacobian * v).template head<3>();
    const bool nears = move.dot(s.tip.position - obstacle.centre) < 0;
    return nears ? 2 - distance(s.tip.position) / range : 0;
  }
};

}  // namespace ctcr
