// A reading beside metal, against the least squares that define it.
#include "ctcr/effects/metal_distortion.hpp"

#include <gtest/gtest.h>

#include <Eigen/QR>

#include "support/random_robots.hpp"

namespace ctcr {
namespace metal_test {

using test::Random;

/// Of unit dipoles along x, y, z in the origin; column = dipole.
Mat3 field(const Vec3& at) {
  const double r = at.norm();
  return (3 * at * at.transpose() / (r * r) - Mat3::Identity()) / (r * r * r);
}

Triple<double> triple(const Vec3& v) { return {v[0], v[1], v[2]}; }
Vec3 vector(const Triple<double>& v) { return {v[0], v[1], v[2]}; }

/// The closed form is the pose that explains the sum of the fields best.
TEST(Metal, ErrorIsThatOfTheBestPose) {
  Random random(1);
  for (int n = 0; n < 50; ++n) {
    // So far away that the size of the metal does not matter.
    const Vec3 p = 20 * test::random_vector(random, 1).normalized(),
               m = 30 * test::random_vector(random, 1).normalized();
    const double volume = test::uniform(random, -10, 10);
    const Mat3 extra = -volume * field(p - m) * field(m), own = field(p);
    Eigen::Matrix<double, 9, 6> columns;
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 unit = Vec3::Unit(axis), step = 1e-4 * unit;
      const Mat3 moved = (field(p + step) - field(p - step)) / 2e-4;
      Mat3 turned;  // a sensor turned by w reads the field turned by -w
      for (int coil = 0; coil < 3; ++coil) turned.col(coil) = own.col(coil).cross(unit);
      columns.col(axis) = moved.reshaped();
      columns.col(3 + axis) = turned.reshaped();
    }
    const Vec6 best = columns.colPivHouseholderQr().solve(extra.reshaped());
    const ReadingError<double> off = metal_distortion(triple(p), triple(m), volume);
    EXPECT_LE((vector(off.shift) - best.head<3>()).norm(), 1e-5 * best.head<3>().norm());
    EXPECT_LE((vector(off.turn) - best.tail<3>()).norm(), 1e-5 * best.tail<3>().norm());
  }
}

TEST(Metal, StaysFiniteAtTheMetalAndAtTheCoils) {
  for (const Vec3& p : {Vec3(0.1, 0, -0.2), Vec3(0, 0, 0), Vec3(1e-9, 0, 0)})
    for (const Vec3& m : {Vec3(0.1, 0, -0.2), Vec3(0, 0, 0)}) {
      const ReadingError<double> off = metal_distortion(triple(p), triple(m), 1e-6);
      EXPECT_TRUE(vector(off.shift).allFinite() && vector(off.turn).allFinite());
    }
}

}  // namespace metal_test
}  // namespace ctcr
