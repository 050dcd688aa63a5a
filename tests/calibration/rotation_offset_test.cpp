#include "ctcr/calibration/procedures/rotation_offset.hpp"

#include <gtest/gtest.h>

#include "calibration/simulated.hpp"

namespace rotation_offset_test {

using namespace ctcr;
using namespace ctcr::test;
using enum RotationOffsetNotice;

/// A tube that turns alone, and the tracker that sees its tip.
struct Turning {
  double offset = 0.062, ratio = -1;
  double curvature = 10, curved_length = 0.05;
  double arc = 2 * std::numbers::pi;
  int per_direction = 60;
  bool forward = true, backward = true;
  double backlash = 0;  ///< half width [rad]
  double jitter = 0.035 * mm;
  double ellipse = 0, warp = 0;  ///< amplitude twice a turn, radially and out of plane [m]
  double eccentric = 0;          ///< of the drive [rad]
  Pose T_ref, tilt;              ///< the circle's plane is tilted in the base frame

  [[nodiscard]] double radius() const { return (1 - std::cos(curvature * curved_length)) / curvature; }
  /// Tip in the base frame: the tube bends towards its -y.
  [[nodiscard]] Vec3 tip(double alpha) const {
    const double r = radius() + ellipse * std::cos(2 * alpha);
    return tilt.rotation * Vec3(r * std::sin(alpha), -r * std::cos(alpha), 0.08 + warp * std::sin(2 * alpha));
  }
  [[nodiscard]] std::vector<TurnReading> readings(Random& random, const Field* field = nullptr) const {
    std::vector<TurnReading> all;
    for (int k = 0; k < 2 * per_direction; ++k) {
      const bool goes_up = k < per_direction;
      if (goes_up ? !forward : !backward) continue;
      const int i = goes_up ? k : 2 * per_direction - 1 - k;
      const double theta = 0.3 + arc * i / (per_direction - 1);
      const double moved = ratio * theta + offset + (goes_up ? -backlash : backlash) + eccentric * std::sin(theta);
      Vec3 place = T_ref.rotation * tip(moved) + T_ref.position;
      if (field) place += (*field)(place);
      all.push_back({.motor_angle = theta, .position = place + normal_vector(random, jitter)});
    }
    return all;
  }
  [[nodiscard]] RotationOffsetOptions options() const { return {.ratio = ratio, .T_tracker_base = T_ref}; }
};

double turned(double angle) { return std::remainder(angle, 2 * std::numbers::pi); }

/// In how many of 40 calibrations a notice appears.
int count(RotationOffsetNotice kind, const Turning& turning, const RotationOffsetOptions& options, unsigned seed) {
  Random random(seed);
  int told = 0;
  for (int n = 0; n < 40; ++n) told += tells(fit_rotation_offset(turning.readings(random), options), kind);
  return told;
}

TEST(RotationOffset, RecoversTheTruthInTheBaseFrame) {
  Random random(1);
  for (int n = 0; n < 60; ++n) {
    Turning turning;
    turning.jitter = 0;
    turning.offset = uniform(random, -3.1, 3.1);
    turning.ratio = (chance(random, 0.5) ? 1 : -1) * uniform(random, 0.3, 2);
    turning.arc = uniform(random, 1, 9) / std::abs(turning.ratio);
    turning.curvature = uniform(random, 3, 20) * (chance(random, 0.5) ? 1 : -1);
    turning.backward = chance(random, 0.7);
    turning.T_ref = random_frame(random);
    RotationOffsetOptions options = turning.options();
    if (turning.curvature < 0) options.bend_angle = std::numbers::pi / 2;
    const RotationOffset found = fit_rotation_offset(turning.readings(random), options);
    EXPECT_NEAR(turned(found.offset - turning.offset), 0, 1e-9);
    EXPECT_NEAR(found.radius, std::abs(turning.radius()), 1e-11);
    EXPECT_LE((found.centre - Vec3(0, 0, 0.08)).norm(), 1e-11);
    EXPECT_LE((found.normal - Vec3::UnitZ()).norm(), 1e-9);
    EXPECT_LE((found.zero_axis - Vec3::UnitX()).norm(), 1e-9);
    EXPECT_TRUE(found.in_base_frame);
    EXPECT_LE(found.rms, 1e-11);
  }
}

TEST(RotationOffset, WithoutFrameIsRightUpToTheAngleOfItsZeroAxis) {
  Random random(2);
  for (int n = 0; n < 60; ++n) {
    Turning turning;
    turning.jitter = 0;
    turning.offset = uniform(random, -3, 3);
    turning.T_ref = random_frame(random);
    const RotationOffset found = fit_rotation_offset(turning.readings(random), {.ratio = turning.ratio});
    const Vec3 zero = turning.T_ref.rotation.transpose() * found.zero_axis;  // base frame
    EXPECT_LE((turning.T_ref.rotation * Vec3::UnitZ() - found.normal).norm(), 1e-9);
    EXPECT_NEAR(turned(found.offset + std::atan2(zero.y(), zero.x()) - turning.offset), 0, 1e-9);
    EXPECT_FALSE(found.in_base_frame);
  }
}

TEST(RotationOffset, IsTheMeanOfBothDirections) {
  Random random(3);
  Turning turning;
  turning.jitter = 0;
  turning.ratio = 1;
  turning.backlash = 1.5 * degree;
  const RotationOffset found = fit_rotation_offset(turning.readings(random), turning.options());
  EXPECT_NEAR(found.offset, turning.offset, 1e-9);
  EXPECT_NEAR(found.difference, -2 * turning.backlash, 1e-9);
  EXPECT_NEAR(found.forward, turning.offset - turning.backlash, 1e-9);
  EXPECT_NEAR(found.backward, turning.offset + turning.backlash, 1e-9);
}

TEST(RotationOffset, HoldsWhatIsKnown) {
  Random random(4);
  Turning turning;
  turning.arc = 1.2;
  const std::vector<TurnReading> readings = turning.readings(random);
  RotationOffsetOptions options = turning.options();
  const RotationOffset free = fit_rotation_offset(readings, options);
  options.known = {.centre = Vec3(0, 0, 0.08), .radius = turning.radius(), .normal = Vec3::UnitZ()};
  const RotationOffset held = fit_rotation_offset(readings, options);
  EXPECT_EQ(held.centre, *options.known.centre);
  EXPECT_EQ(held.radius, *options.known.radius);
  EXPECT_EQ(held.normal, *options.known.normal);
  EXPECT_EQ(held.radius_sd, 0);
  EXPECT_LT(held.offset_sd, 0.5 * free.offset_sd);
  EXPECT_LT(std::abs(held.offset - turning.offset), 4 * held.offset_sd);
}

TEST(RotationOffset, SdIsHonest) {
  struct Setting {
    double arc;
    bool is_known, is_stated;
    int per_direction;
  };
  for (const auto& [arc, is_known, is_stated, per_direction] :
       {Setting{6.2, false, false, 60}, Setting{6.2, false, true, 12}, Setting{2.5, false, false, 40},
        Setting{1.0, true, true, 20}}) {
    SCOPED_TRACE(arc);
    Random random(5);
    NormalisedErrors offset, difference, radius, x;
    for (int n = 0; n < 200; ++n) {
      Turning turning;
      turning.arc = arc;
      turning.per_direction = per_direction;
      turning.T_ref = random_frame(random);
      RotationOffsetOptions options = turning.options();
      if (is_stated) options.noise.position_jitter = turning.jitter;
      if (is_known) options.known = {.centre = Vec3(0, 0, 0.08), .radius = {}, .normal = Vec3::UnitZ()};
      const RotationOffset found = fit_rotation_offset(turning.readings(random), options);
      offset.add(found.offset - turning.offset, found.offset_sd);
      difference.add(found.difference, found.difference_sd);
      radius.add(found.radius - turning.radius(), found.radius_sd);
      if (!is_known) x.add(found.centre.x(), found.centre_sd.x());
    }
    offset.expect_honest();
    difference.expect_honest();
    radius.expect_honest();
    if (!is_known) x.expect_honest();
  }
}

TEST(RotationOffset, SdIsHonestInADistortedField) {
  Random random(6);
  NormalisedErrors offset, difference, radius;
  for (int n = 0; n < 200; ++n) {
    Turning turning;
    turning.T_ref = random_frame(random);
    const Field field(random, 0.31 * mm, 0.1);
    RotationOffsetOptions options = turning.options();
    options.noise = {.position_jitter = turning.jitter, .position_field = 0.31 * mm, .correlation_length = 0.1};
    const RotationOffset found = fit_rotation_offset(turning.readings(random, &field), options);
    offset.add(found.offset - turning.offset, found.offset_sd);
    difference.add(found.difference, found.difference_sd);
    radius.add(found.radius - turning.radius(), found.radius_sd);
  }
  offset.expect_honest();
  difference.expect_honest();
  radius.expect_honest();
}

TEST(RotationOffset, IsGoodToTenthsOfADegreeWithARealTracker) {
  // The tubes of the paper's Table II, a tracker of 0.88 mm accuracy (95 %) and 0.035 mm jitter.
  Random random(7);
  for (const double curvature : {10.0, 5.0, 7.0}) {
    double squares = 0, worst = 0;
    for (int n = 0; n < 200; ++n) {
      Turning turning;
      turning.curvature = curvature;
      turning.T_ref = random_frame(random);
      const Field field(random, field_of_accuracy(0.88 * mm, turning.jitter), 0.1);
      const RotationOffset found = fit_rotation_offset(turning.readings(random, &field), turning.options());
      const double error = std::abs(found.offset - turning.offset) / degree;
      squares += error * error / 200;
      worst = std::max(worst, error);
    }
    RecordProperty("rms_deg_" + std::to_string(int(curvature)), std::to_string(std::sqrt(squares)));
    EXPECT_LT(std::sqrt(squares), 0.2) << "RMS [deg], curvature " << curvature;
    EXPECT_LT(worst, 0.6) << "worst [deg], curvature " << curvature;
  }
}

TEST(RotationOffset, ReadingsFarOffDoNotCount) {
  Random random(8);
  NormalisedErrors offset;
  for (int n = 0; n < 200; ++n) {
    const Turning turning;
    std::vector<TurnReading> readings = turning.readings(random);
    for (std::size_t i = 0; i < readings.size(); i += 10)
      readings[i].position += random_vector(random, 1) * 0.01 + Vec3(0.002, 0, 0);
    const RotationOffset found = fit_rotation_offset(readings, turning.options());
    offset.add(found.offset - turning.offset, found.offset_sd);
    EXPECT_TRUE(tells(found, outliers));
    EXPECT_GE(found.outliers.size(), 10U);
  }
  offset.expect_honest();
}

TEST(RotationOffset, SoundReadingsCauseNoNotice) {
  Random random(9);
  int told = 0;
  for (int n = 0; n < 300; ++n) {
    Turning turning;
    turning.T_ref = random_frame(random);
    RotationOffsetOptions options = turning.options();
    if (n % 2) options.noise.position_jitter = turning.jitter;
    told += !fit_rotation_offset(turning.readings(random), options).notices.empty();
  }
  EXPECT_LE(told, 8);
}

TEST(RotationOffset, TellsWhatIsWrongWithTheReadings) {
  const Turning sound;
  const RotationOffsetOptions options = sound.options();
  Turning turning = sound;
  turning.backlash = 0.2 * degree;
  EXPECT_GE(count(directions_differ, turning, options, 10), 39);
  turning = sound;
  turning.backward = false;
  EXPECT_EQ(count(one_direction, turning, options, 11), 40);
  turning = sound;
  turning.arc = 90 * degree;
  EXPECT_EQ(count(arc_too_short, turning, options, 12), 40);
  EXPECT_EQ(count(
                arc_too_short,
                [&] {
                  Turning t = sound;
                  t.arc = 270 * degree;
                  return t;
                }(),
                options, 12),
            0);
  turning = sound;
  turning.curvature = 0.5;
  turning.per_direction = 20;
  EXPECT_GE(count(radius_too_small, turning, options, 13), 38);
  turning = sound;
  turning.ellipse = 0.2 * mm;
  EXPECT_EQ(count(not_round, turning, options, 14), 40);
  EXPECT_LE(count(not_planar, turning, options, 14), 1);
  turning = sound;
  turning.warp = 0.2 * mm;
  EXPECT_EQ(count(not_planar, turning, options, 15), 40);
  EXPECT_LE(count(not_round, turning, options, 15), 1);
  turning = sound;
  turning.eccentric = 0.8 * degree;
  EXPECT_EQ(count(not_uniform, turning, options, 16), 40);
  turning = sound;
  turning.tilt.rotation = rotation_matrix(Vec3(4 * degree, 0, 0));
  EXPECT_EQ(count(tilted, turning, options, 17), 40);
  turning = sound;
  turning.jitter = 0.1 * mm;
  RotationOffsetOptions stated = options;
  stated.noise.position_jitter = 0.035 * mm;
  EXPECT_EQ(count(noise_larger, turning, stated, 18), 40);
}

TEST(RotationOffset, RefusesWithWords) {
  Random random(19);
  const Turning sound;
  const auto said = [](const std::vector<TurnReading>& readings, const RotationOffsetOptions& options) {
    return refusal([&] { (void)fit_rotation_offset(readings, options); });
  };
  std::vector<TurnReading> readings = sound.readings(random);
  EXPECT_EQ(said(readings, sound.options()), "");
  RotationOffsetOptions reversed = sound.options();
  reversed.ratio = 1;
  EXPECT_TRUE(contains(said(readings, reversed), "sign of the ratio"));
  EXPECT_TRUE(contains(said({readings.begin(), readings.begin() + 5}, sound.options()), "at least 6 readings"));
  std::vector<TurnReading> few = readings;
  for (std::size_t i = 0; i < few.size(); ++i) few[i] = readings[i % 3];
  EXPECT_TRUE(contains(said(few, sound.options()), "4 different angles"));
  Turning straight;
  straight.curvature = 1e-6;
  EXPECT_TRUE(contains(said(straight.readings(random), straight.options()), "hardly moves"));
  readings[3].position.y() = std::nan("");
  EXPECT_TRUE(contains(said(readings, sound.options()), "reading 4"));
  RotationOffsetOptions options = sound.options();
  options.ratio = 0;
  EXPECT_TRUE(contains(said(sound.readings(random), options), "ratio"));
}

}  // namespace rotation_offset_test
