#pragma once
#include <Eigen/LU>
#include <cmath>

#include "ctcr/core/status.hpp"
#include "ctcr/core/types.hpp"

namespace ctcr {

/// An unknown tip force from the deflection that the model does not explain, through the compliance:
/// f += gain (C^T C + softest^2 I)^-1 C^T (measured - predicted). Real time: yes.
struct ForceEstimate {
  double gain = 0.1;          ///< share of the deflection that one period explains, 0 to 1; small: noise is averaged
  double softest = 0.01;      ///< compliance below which a direction is not observed [m/N], >= 0
  double largest = 5;         ///< no force is larger [N], >= 0: bounds the estimate, and which deflections are believed
  Vec3 force = Vec3::Zero();  ///< [N], base frame

  /// ok; invalid_settings: a setting is NaN, infinite or out of range, or the force is not finite. Real time: yes.
  [[nodiscard]] Status check() const noexcept {
    const bool possible = gain >= 0 && gain <= 1 && softest >= 0 && softest < HUGE_VAL && largest >= 0 &&
                          largest < HUGE_VAL && all_finite(force);
    return possible ? Status::ok : Status::invalid_settings;
  }

  /// The force and its estimate are `largest` at most: a deflection that asks for a change by more than twice that is an
  /// outlier, or not finite, and changes nothing. Nor does any with settings that check() refuses.
  /// @param compliance   of the position by the force [m/N]   @param deflection  measured minus predicted position [m]
  void update(const Mat3& compliance, const Vec3& deflection) noexcept {
    if (check() != Status::ok) return;
    const Mat3 normal = compliance.transpose() * compliance + softest * softest * Mat3::Identity();
    const Vec3 missing = normal.inverse() * (compliance.transpose() * deflection);
    if (!(missing.norm() <= 2 * largest)) return;
    force += gain * missing;
    const double size = force.norm();
    if (size > largest) force *= largest / size;
  }

  /// After a period in which the model has no equilibrium: half of the force, so that a wrong one fades.
  void doubt() noexcept { force *= 0.5; }
};

}  // namespace ctcr
