#pragma once
#include <cmath>

#include "ctcr/core/status.hpp"
#include "ctcr/robot/joints.hpp"

namespace ctcr {

/// Angles of the 2N motors [rad], innermost tube first.
template <int N>
struct MotorAngles {
  VecN<N> translation = VecN<N>::Zero();  ///< of the motors that translate the tubes
  VecN<N> rotation = VecN<N>::Zero();     ///< of the motors that rotate them
};

/// From motor angles theta to joints: q = rho theta + Delta, axis by axis. A ratio may be negative.
/// Ref: Boyer et al., Section V.
template <int N>
struct Transmission {
  double translation_ratio = 1;                ///< rho of beta [m/rad]
  double rotation_ratio = 1;                   ///< rho of alpha [rad/rad]
  VecN<N> home_translation = VecN<N>::Zero();  ///< Delta of beta [m]
  VecN<N> home_rotation = VecN<N>::Zero();     ///< Delta of alpha [rad]
};

/// Whether the motors can move the joints and be told how: ratios and their inverses are finite, and so are the homes.
/// @return ok or invalid_settings. Real time: yes.
template <int N>
[[nodiscard]] Status check_transmission(const Transmission<N>& t) noexcept {
  const auto is_ratio = [](double ratio) { return std::abs(ratio) < HUGE_VAL && std::abs(1 / ratio) < HUGE_VAL; };
  const bool possible =
      is_ratio(t.translation_ratio) && is_ratio(t.rotation_ratio) && all_finite(t.home_translation, t.home_rotation);
  return possible ? Status::ok : Status::invalid_settings;
}

/// Joints that the motors hold. Real time: yes.
template <int N>
[[nodiscard]] Joints<N> joints(const Transmission<N>& t, const MotorAngles<N>& theta) noexcept {
  return {t.translation_ratio * theta.translation + t.home_translation,
          t.rotation_ratio * theta.rotation + t.home_rotation};
}

/// Motor angles that hold the joints; neither ratio may be 0. Real time: yes.
template <int N>
[[nodiscard]] MotorAngles<N> motor_angles(const Transmission<N>& t, const Joints<N>& q) noexcept {
  return {(q.beta - t.home_translation) / t.translation_ratio, (q.alpha - t.home_rotation) / t.rotation_ratio};
}

}  // namespace ctcr
