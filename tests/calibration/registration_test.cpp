#include "ctcr/calibration/procedures/registration.hpp"

#include <gtest/gtest.h>

#include "calibration/simulated.hpp"
#include "ctcr/sensing/pose_sensor.hpp"

namespace registration_test {

using namespace ctcr;
using namespace ctcr::test;
using enum RegistrationNotice;

/// Points of a baseplate of 120 x 80 mm, and a probe.
struct Plate {
  int count = 8, readings = 3;
  double placement = 0.1 * mm, jitter = 0.035 * mm;
  bool is_flat = true;
  Pose T_ref;

  [[nodiscard]] std::vector<Fiducial> points(Random& random, const Field* field = nullptr) const {
    std::vector<Fiducial> all;
    for (int i = 0; i < count; ++i) {
      Fiducial point{.name = "P" + std::to_string(i + 1)};
      // Corners first, so that few points span the plate too; the rest anywhere.
      const double x = i < 4 ? (i % 2 ? 0.06 : -0.06) : uniform(random, -0.06, 0.06);
      const double y = i < 4 ? (i < 2 ? 0.035 : -0.045) : uniform(random, -0.04, 0.04);
      point.position = {x + 0.002 * i, y, is_flat ? -0.02 : uniform(random, -0.05, 0.05)};
      Vec3 place = T_ref.rotation * point.position + T_ref.position;
      if (field) place += (*field)(place);
      place += normal_vector(random, placement);
      for (int k = 0; k < readings; ++k) point.readings.push_back(place + normal_vector(random, jitter));
      all.push_back(point);
    }
    return all;
  }
};

/// Change of frame that takes `from` to `to`, as moved_frame() makes it.
Vec6 change(const Pose& from, const Pose& to) {
  Vec6 d;
  d << to.position - from.position, rotation_vector(to.rotation * from.rotation.transpose());
  return d;
}

TEST(Registration, RecoversTheFrameToRounding) {
  Random random(1);
  for (int n = 0; n < 100; ++n) {
    const Plate plate{.count = 3 + n % 8,
                      .readings = 1,
                      .placement = 0,
                      .jitter = 0,
                      .is_flat = chance(random, 0.5),
                      .T_ref = random_frame(random)};
    const Registration found = register_points(plate.points(random));
    EXPECT_LE(change(plate.T_ref, found.T_tracker_base).norm(), 1e-13);
    EXPECT_LE(found.fre, 1e-14);
    EXPECT_TRUE(found.outliers.empty());
  }
}

TEST(Registration, ClosedFormIsTheLeastSquaresOfEqualPoints) {
  Random random(2);
  for (int n = 0; n < 50; ++n) {
    Plate plate{.count = 6, .T_ref = random_frame(random)};
    plate.placement = 2 * mm;
    const std::vector<Fiducial> points = plate.points(random);
    registration::Pairs pairs{Eigen::Matrix3Xd(3, 6), Eigen::Matrix3Xd(3, 6)};
    for (int i = 0; i < 6; ++i) {
      pairs.base.col(i) = points[std::size_t(i)].position;
      pairs.tracker.col(i) = points[std::size_t(i)].readings[0];
    }
    const Pose start{rotation_matrix(random_vector(random, 0.3)) * plate.T_ref.rotation, plate.T_ref.position};
    const Pose fitted = registration::refined(pairs, Eigen::VectorXd::Constant(6, mm), 0, start);
    // To where the sum of squares no longer tells.
    EXPECT_LE(change(registration::closed_form(pairs), fitted).norm(), 1e-7);
  }
}

TEST(Registration, CovarianceIsHonest) {
  for (const bool is_stated : {true, false}) {
    SCOPED_TRACE(is_stated);
    Random random(3);
    NormalisedErrors position, rotation, along;
    double mahalanobis = 0;
    for (int n = 0; n < 200; ++n) {
      Plate plate{.count = 10, .T_ref = random_frame(random)};
      const Registration found = register_points(
          plate.points(random),
          {.noise = {.position_jitter = plate.jitter}, .placement_sd = is_stated ? plate.placement : 0});
      const Vec6 error = change(plate.T_ref, found.T_tracker_base);
      for (int i = 0; i < 3; ++i) {
        position.add(error[i], std::sqrt(found.covariance(i, i)));
        rotation.add(error[3 + i], std::sqrt(found.covariance(3 + i, 3 + i)));
      }
      mahalanobis += error.dot(found.covariance.ldlt().solve(error)) / 200;
    }
    position.expect_honest();
    rotation.expect_honest();
    EXPECT_NEAR(mahalanobis, 6, is_stated ? 0.9 : 1.4);  // Hotelling: 6 (24 / 22) for an estimated sd
  }
}

TEST(Registration, CovarianceIsHonestInADistortedField) {
  Random random(4);
  NormalisedErrors position, rotation;
  for (int n = 0; n < 200; ++n) {
    Plate plate{.count = 8, .T_ref = random_frame(random)};
    const Field field(random, 0.31 * mm, 0.1);
    const Registration found = register_points(
        plate.points(random, &field),
        {.noise = {.position_jitter = plate.jitter, .position_field = 0.31 * mm, .correlation_length = 0.1},
         .placement_sd = plate.placement});
    const Vec6 error = change(plate.T_ref, found.T_tracker_base);
    position.add(error[0], std::sqrt(found.covariance(0, 0)));
    rotation.add(error[5], std::sqrt(found.covariance(5, 5)));
  }
  position.expect_honest();
  rotation.expect_honest();
}

TEST(Registration, TargetErrorIsTheFormulaAndTheTruth) {
  Random random(5);
  Plate plate{.count = 7, .readings = 1, .is_flat = false, .T_ref = random_frame(random)};
  plate.jitter = 0;
  const Vec3 target(0.01, -0.02, 0.15);
  double squares = 0, expected = 0;
  for (int n = 0; n < 400; ++n) {
    const std::vector<Fiducial> points = plate.points(random);
    const Registration found = register_points(points, {.placement_sd = plate.placement});
    const Pose& T = found.T_tracker_base;
    squares += (T.rotation * target + T.position - plate.T_ref.rotation * target - plate.T_ref.position).squaredNorm();
    expected += std::pow(found.target_error(target), 2);

    // FLE^2 / N (1 + 1/3 sum_k d_k^2 / f_k^2) over the principal axes of the points.
    Vec3 mean = Vec3::Zero();
    for (const Fiducial& point : points) mean += point.position / double(points.size());
    Mat3 moments = Mat3::Zero();
    for (const Fiducial& point : points)
      moments += (point.position - mean) * (point.position - mean).transpose() / double(points.size());
    const Eigen::SelfAdjointEigenSolver<Mat3> axes(moments);
    const Vec3 d = axes.eigenvectors().transpose() * (target - mean);
    double sum = 1;
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      sum += (d[i] * d[i] + d[j] * d[j]) / (axes.eigenvalues()[i] + axes.eigenvalues()[j]) / 3;
    }
    EXPECT_NEAR(found.target_error(target), std::sqrt(3 * found.fle * found.fle / 7 * sum), 1e-12);
  }
  EXPECT_NEAR(squares / expected, 1, 0.2);
}

TEST(Registration, IsWithinThePapersFiguresWithARealTracker) {
  // 0.88 mm accuracy (95 %), 0.035 mm jitter, a probe held to 0.1 mm, eight points on a plate.
  Random random(6);
  int within = 0;
  double position = 0, rotation = 0;
  for (int n = 0; n < 200; ++n) {
    const Plate plate{.T_ref = random_frame(random)};
    const Field field(random, field_of_accuracy(0.88 * mm, plate.jitter), 0.1);
    const Vec6 error = change(plate.T_ref, register_points(plate.points(random, &field)).T_tracker_base);
    position += error.head<3>().squaredNorm() / 200;
    rotation += error.tail<3>().squaredNorm() / 200;
    within += error.head<3>().norm() < 0.9 * mm && error.tail<3>().norm() < 0.6 * degree;
  }
  RecordProperty("position_rms_mm", std::to_string(std::sqrt(position) / mm));
  RecordProperty("rotation_rms_deg", std::to_string(std::sqrt(rotation) / degree));
  EXPECT_LT(std::sqrt(position), 0.5 * mm);
  EXPECT_LT(std::sqrt(rotation), 0.3 * degree);
  EXPECT_GE(within, 180);
}

TEST(Registration, LeavesOutWhatTheOtherPointsContradict) {
  Random random(7);
  int found_alone = 0;
  NormalisedErrors position;
  for (int n = 0; n < 200; ++n) {
    const Plate plate{.T_ref = random_frame(random)};
    std::vector<Fiducial> points = plate.points(random);
    for (Vec3& reading : points[std::size_t(n % 8)].readings) reading += Vec3(0, 3 * mm, 0);
    const Registration found = register_points(points);
    found_alone += found.outliers == std::vector{points[std::size_t(n % 8)].name};
    EXPECT_TRUE(tells(found, outliers));
    EXPECT_GT(found.residuals[std::size_t(n % 8)].norm(), 2 * mm);
    position.add(change(plate.T_ref, found.T_tracker_base)[0], std::sqrt(found.covariance(0, 0)));
  }
  EXPECT_GE(found_alone, 195);
  EXPECT_NEAR(position.mean_square(), 1, 0.5);
}

TEST(Registration, RobustLossWeighsLessWhatIsFarOff) {
  Random random(8);
  double plain = 0, robust = 0;
  for (int n = 0; n < 100; ++n) {
    Plate plate{.count = 4, .T_ref = random_frame(random)};  // four points: too few to leave one out
    plate.is_flat = false;
    std::vector<Fiducial> points = plate.points(random);
    points.push_back({"far", {0, 0, 0.03}, {plate.T_ref.rotation * Vec3(0, 0, 0.03) + plate.T_ref.position}});
    for (Vec3& reading : points.back().readings) reading += Vec3(0.6 * mm, 0, 0);
    plain += change(plate.T_ref, register_points(points).T_tracker_base).head<3>().norm();
    robust += change(plate.T_ref, register_points(points, {.loss_scale = 0.2 * mm}).T_tracker_base).head<3>().norm();
  }
  EXPECT_LT(robust, 0.9 * plain);
}

TEST(Registration, SoundPointsCauseNoNotice) {
  Random random(9);
  int told = 0;
  for (int n = 0; n < 300; ++n) {
    const Plate plate{.count = 4 + n % 6, .is_flat = n % 2 == 0, .T_ref = random_frame(random)};
    told += !register_points(plate.points(random)).notices.empty();
  }
  EXPECT_LE(told, 8);
}

TEST(Registration, TellsRepeatsAndPointsWithoutReading) {
  Random random(10);
  Plate plate{.count = 40, .readings = 5, .T_ref = random_frame(random)};
  std::vector<Fiducial> points = plate.points(random);
  points[3].readings.clear();
  Registration found = register_points(points);
  EXPECT_NEAR(found.repeatability_sd / plate.jitter, 1, 0.15);
  EXPECT_TRUE(tells(found, without_reading));
  EXPECT_TRUE(std::isnan(found.residuals[3].x()));
  EXPECT_FALSE(std::isnan(found.residuals[4].x()));
  EXPECT_NEAR(found.fle / plate.placement, 1, 0.2);
  plate.count = 3;
  plate.readings = 1;
  found = register_points(plate.points(random));
  EXPECT_TRUE(tells(found, few_points));
  EXPECT_TRUE(std::isnan(found.repeatability_sd));
  plate.count = 8;
  plate.placement = 8 * mm;
  EXPECT_TRUE(tells(register_points(plate.points(random)), large_residuals));
  plate.placement = 0.1 * mm;
  points = plate.points(random);
  for (Fiducial& point : points) point.position *= 1.05;
  EXPECT_TRUE(tells(register_points(points), wrong_scale));
}

TEST(Registration, RefusesWithWords) {
  Random random(11);
  const Plate plate{.is_flat = false, .T_ref = random_frame(random)};
  const auto said = [](const std::vector<Fiducial>& points) { return refusal([&] { (void)register_points(points); }); };
  const std::vector<Fiducial> sound = plate.points(random);
  EXPECT_EQ(said(sound), "");
  EXPECT_TRUE(contains(said({sound[0], sound[1]}), "at least 3 points"));
  EXPECT_TRUE(contains(said({sound[0], sound[1], sound[1]}), "given twice"));
  std::vector<Fiducial> points = sound;
  for (Fiducial& point : points) point.position.x() *= -1;
  EXPECT_TRUE(contains(said(points), "mirror image"));
  points = sound;
  std::swap(points[2].readings, points[6].readings);
  EXPECT_TRUE(contains(said(points), "'P3' and 'P7' look exchanged"));
  points = sound;
  for (Fiducial& point : points) point.position *= 1000;
  EXPECT_TRUE(contains(said(points), "another unit"));
  points = sound;
  points[1].readings[0].x() = std::nan("");
  EXPECT_TRUE(contains(said(points), "'P2'"));
  points = sound;
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].position = {0.01 * double(i), 0.02 * double(i), 0};
    points[i].readings = {points[i].position};
  }
  EXPECT_TRUE(contains(said(points), "on one line"));
  // Three points that are read to be on a line, and so are not those of the CAD.
  EXPECT_TRUE(contains(said({sound[0], sound[1], sound[0]}), "given twice"));
}

}  // namespace registration_test
