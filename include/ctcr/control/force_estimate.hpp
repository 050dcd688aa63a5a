#pragma once
#include <Eigen/LU>

#include "ctcr/core/types.hpp"

namespace ctcr {

/// An unknown tip force from the deflection that the model does not explain, through the compliance:
/// f += gain (C^T C + softest^2 I)^-1 C^T (measured - predicted). Real time: yes.
struct ForceEstimate {
  double gain = 0.1;          ///< share of the deflection that one period explains; small: noise is averaged
  double softest = 0.01;      ///< compliance below which a direction is not observed [m/N]
  Vec3 force = Vec3::Zero();  ///< [N], base frame

  /// @param compliance   of the position by the force [m/N]   @param deflection  measured minus predicted position [m]
  void update(const Mat3& compliance, const Vec3& deflection) noexcept {
    const Mat3 normal = compliance.transpose() * compliance + softest * softest * Mat3::Identity();
    const Vec3 change = gain * (normal.inverse() * (compliance.transpose() * deflection));
    if (change.allFinite()) force += change;
  }
};

}  // namespace ctcr
