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

}  // namespace types_test
}  // namespace ctcr
