#pragma once
// Fixed-size linear algebra shared by all layers. SI units everywhere: m, rad, N, N m, s.
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "ctcr/core/arithmetic.hpp"

namespace ctcr {

template <int N>
using VecN = Eigen::Matrix<double, N, 1>;
using Vec3 = Eigen::Vector3d;
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat3 = Eigen::Matrix3d;
using Mat6 = Eigen::Matrix<double, 6, 6>;

/// Whether all entries of all matrices are finite: 0 times anything else is NaN. Real time: yes, without a branch.
template <class... Matrices>
inline bool all_finite(const Matrices&... m) noexcept {
  return ((m * 0.0).sum() + ...) == 0;
}

/// Whether R is a rotation, but for the rounding of numbers with four decimals. A shear, a mirror, the matrix of a
/// quaternion that is not of length 1, and NaN are none. Real time: yes.
inline bool is_rotation(const Mat3& R) noexcept {
  constexpr double rounding = 1e-3;  // entries of R R^T - I
  return ((R * R.transpose() - Mat3::Identity()).array().abs() <= rounding).all() &&
         R.col(0).cross(R.col(1)).dot(R.col(2)) > 0;
}

/// Rigid transform T_a_b: maps coordinates in frame b to frame a, x_a = rotation * x_b + position.
struct Pose {
  Mat3 rotation = Mat3::Identity();
  Vec3 position = Vec3::Zero();

  friend Pose operator*(const Pose& T_a_b, const Pose& T_b_c) noexcept {
    return {T_a_b.rotation * T_b_c.rotation, T_a_b.rotation * T_b_c.position + T_a_b.position};
  }
  [[nodiscard]] Pose inverse() const noexcept { return {rotation.transpose(), -(rotation.transpose() * position)}; }
};

}  // namespace ctcr
