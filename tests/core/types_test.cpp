#include "ctcr/core/types.hpp"

#include <gtest/gtest.h>

namespace ctcr {
namespace types_test {

Pose pose(double angle, const Vec3& axis, const Vec3& position) {
  return {Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix(), position};
}

const Pose T_a_b = pose(0.7, {1, 2, -3}, {0.1, -0.2, 0.3}), T_b_c = pose(-2.1, {0, 1, 4}, {-1, 0.5, 2});

TEST(Pose, ChainMapsPointsThroughBoth) {
  const Vec3 x_c(0.3, -0.4, 0.9);
  const Vec3 x_b = T_b_c.rotation * x_c + T_b_c.position, x_a = T_a_b.rotation * x_b + T_a_b.position;
  const Pose T_a_c = T_a_b * T_b_c;
  EXPECT_LT((T_a_c.rotation * x_c + T_a_c.position - x_a).norm(), 1e-15);
}

TEST(Pose, InverseUndoes) {
  for (const Pose& identity : {T_a_b * T_a_b.inverse(), T_a_b.inverse() * T_a_b}) {
    EXPECT_TRUE(identity.rotation.isIdentity(1e-15));
    EXPECT_LT(identity.position.norm(), 1e-15);
  }
}

TEST(Pose, IsIdentityByDefault) {
  EXPECT_TRUE(Pose{}.rotation.isIdentity(0));
  EXPECT_TRUE(Pose{}.position.isZero(0));
}

/// A rotation written with four decimals is one; a mirror, a shear, a scaled one and any NaN are none.
TEST(Rotation, IsTold) {
  const Mat3& R = T_a_b.rotation;
  EXPECT_TRUE(is_rotation(R));
  EXPECT_TRUE(is_rotation((R * 1e4).array().round() / 1e4));
  EXPECT_FALSE(is_rotation(-R));
  EXPECT_FALSE(is_rotation(Mat3::Zero()));
  EXPECT_FALSE(is_rotation(1.01 * R));
  EXPECT_FALSE(is_rotation(Eigen::Quaterniond(1.01, 0.1, 0, 0).toRotationMatrix()));
  for (int k = 0; k < 9; ++k)
    for (const double bad : {R(k) + 0.01, std::nan(""), HUGE_VAL, 1e200}) {
      Mat3 wrong = R;
      wrong(k) = bad;
      EXPECT_FALSE(is_rotation(wrong));
    }
}

}  // namespace types_test
}  // namespace ctcr
