#include "ctcr/sensing/pose_sensor.hpp"

#include <gtest/gtest.h>

#include "ctcr/sensing/residual.hpp"
#include "support/laws.hpp"

namespace pose_sensor_test {

using namespace ctcr;

Pose random_pose(test::Random& random, double max_angle = 3) {
  return {rotation_matrix(test::random_vector(random, max_angle)), test::random_vector(random, 0.3)};
}

/// A pose displaced and turned in the axes it is given in.
Pose displaced(const Pose& pose, const Vec6& change) {
  return {rotation_matrix(change.tail<3>()) * pose.rotation, pose.position + change.head<3>()};
}

TEST(PoseSensor, ReadsTheTubeThatCarriesIt) {
  test::Random random(1);
  std::array<Pose, 3> tips;
  for (Pose& tip : tips) tip = random_pose(random);
  for (int tube = 0; tube < 3; ++tube) {
    const PoseSensor sensor{random_pose(random), tube, random_pose(random)};
    const Pose tip = tips[std::size_t(tube)], read = reading(sensor, tips);
    EXPECT_LE((tip_of(sensor, read).rotation - tip.rotation).norm(), 1e-14);
    EXPECT_LE((tip_of(sensor, read).position - tip.position).norm(), 1e-14);
    const Vec3 point(0.1, 0.2, 0.3);  // of the sensor, in both ways to the tracker
    const Vec3 of_tip = sensor.T_tip_sensor.rotation * point + sensor.T_tip_sensor.position;
    const Vec3 in_base = tip.rotation * of_tip + tip.position;
    EXPECT_LE((read.rotation * point + read.position -
               (sensor.T_tracker_base.rotation * in_base + sensor.T_tracker_base.position))
                  .norm(),
              1e-15);
  }
}

TEST(PoseSensor, DerivativesAreThoseOfTheReading) {
  test::Random random(2);
  for (int n = 0; n < 50; ++n) {
    const PoseSensor sensor{random_pose(random), 0, random_pose(random)};
    const std::array<Pose, 1> tip{random_pose(random)};
    const Pose read = reading(sensor, tip);
    const Mat6 by_tip = reading_by_tip(sensor, read), by_frame = reading_by_frame(sensor, read),
               by_mount = reading_by_mount(sensor, read);
    for (int j = 0; j < 6; ++j) {
      const auto at_tip = [&](double t) { return reading(sensor, std::array{displaced(tip[0], t * Vec6::Unit(j))}); };
      const auto at_frame = [&](double t) {
        return reading(PoseSensor{moved_frame(sensor.T_tracker_base, t * Vec6::Unit(j)), 0, sensor.T_tip_sensor}, tip);
      };
      const auto at_mount = [&](double t) {
        return reading(PoseSensor{sensor.T_tracker_base, 0, displaced(sensor.T_tip_sensor, t * Vec6::Unit(j))}, tip);
      };
      EXPECT_LE((test::slope(at_tip, 1e-2) - by_tip.col(j)).norm(), 1e-8);
      EXPECT_LE((test::slope(at_frame, 1e-2) - by_frame.col(j)).norm(), 1e-8);
      EXPECT_LE((test::slope(at_mount, 1e-2) - by_mount.col(j)).norm(), 1e-8);
    }
  }
}

TEST(Residual, MapsPredictionToMeasurement) {
  test::Random random(3);
  for (int n = 0; n < 100; ++n) {
    const Pose measured = random_pose(random), predicted = random_pose(random);
    const Pose corrected = displaced(predicted, residual(measured, predicted));
    EXPECT_LE((corrected.position - measured.position).norm(), 1e-15);
    EXPECT_LE((corrected.rotation - measured.rotation).norm(), 1e-13);
    EXPECT_LE(residual(measured, measured).norm(), 1e-15);
    EXPECT_LE(residual(measured, predicted).tail<3>().norm(), 3.1416);
  }
}

/// For small and for large errors.
TEST(Residual, DerivativeIsExact) {
  test::Random random(4);
  for (const double angle : {0.0, 1e-8, 1e-3, 0.03, 0.5, 2.0, 3.1})
    for (int n = 0; n < 20; ++n) {
      const Pose predicted = random_pose(random);
      const Vec3 axis = test::random_vector(random, 1).normalized();
      const Pose measured{rotation_matrix(angle * axis) * predicted.rotation, random_pose(random).position};
      const Mat6 exact = residual_by_prediction(residual(measured, predicted));
      for (int j = 0; j < 6; ++j) {
        const auto e = [&](double t) { return residual(measured, displaced(predicted, t * Vec6::Unit(j))); };
        constexpr double h = 1e-3;
        const Vec6 slope = (8 * (e(h) - e(-h)) - (e(2 * h) - e(-2 * h))) / (12 * h);
        EXPECT_LE((slope - exact.col(j)).norm(), 1e-8) << angle;
      }
    }
}

}  // namespace pose_sensor_test
