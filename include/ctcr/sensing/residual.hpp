#pragma once
#include <cmath>

#include "ctcr/core/types.hpp"
#include "ctcr/math/se3.hpp"

namespace ctcr {

/// Measured against predicted pose, in the axes they share: position 0-2, measured - predicted [m]; rotation 3-5, the
/// rotation vector of R_measured R_predicted^T, |.| <= pi [rad]. Real time: yes.
[[nodiscard]] inline Vec6 residual(const Pose& measured, const Pose& predicted) noexcept {
  Vec6 e;
  e << measured.position - predicted.position, rotation_vector(measured.rotation * predicted.rotation.transpose());
  return e;
}

/// Derivative of residual `e` by the predicted pose's position [m] and rotation [rad]: -1 for the position, minus the
/// inverse right Jacobian of SO(3) at e for the rotation. Real time: yes.
[[nodiscard]] inline Mat6 residual_by_prediction(const Vec6& e) noexcept {
  const Vec3 o = e.tail<3>();
  const double z = o.squaredNorm(), half = 0.5 * std::sqrt(z);
  const double k = z < 1e-3 ? 1.0 / 12 + z / 720 + z * z / 30240 : (1.0 - half / std::tan(half)) / z;
  Mat3 W;
  W << 0, -o.z(), o.y(), o.z(), 0, -o.x(), -o.y(), o.x(), 0;
  Mat6 D = -Mat6::Identity();
  D.bottomRightCorner<3, 3>() -= 0.5 * W + k * (W * W);
  return D;
}

}  // namespace ctcr
