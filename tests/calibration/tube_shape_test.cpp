#include "ctcr/calibration/procedures/tube_shape.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "calibration/simulated.hpp"

namespace tube_shape_test {

using namespace ctcr;
using namespace ctcr::test;
using enum TubeShapeNotice;
using Points = std::vector<Eigen::Vector2d>;

/// A tube on a photo: pose and scale as they come, points in any order.
struct Photo {
  double curvature = 10, curved_length = 0.05, straight_length = 0.06;  ///< 1/m, m
  double scale = 0.05 * mm;                                             ///< m per pixel
  double noise = 1;                                                     ///< pixels
  double gradient = 0;                                                  ///< relative change of the curvature along it
  double straight_curvature = 0;                                        ///< [1/m]
  int count = 60;
  bool turns_left = true;

  [[nodiscard]] Points points(Random& random) const {
    const double heading = uniform(random, -3.1, 3.1), x0 = uniform(random, 0, 2000), y0 = uniform(random, 0, 2000);
    // Integrated finely from the junction, both ways.
    Points all;
    for (int i = 0; i < count; ++i) {
      const double s = -straight_length + (straight_length + curved_length) * i / (count - 1);
      double angle = 0;
      Eigen::Vector2d p(0, 0);
      constexpr int steps = 100;
      for (int k = 0; k < steps; ++k) {
        const double ds = s / steps, t = s * (k + 0.5) / steps;
        const double u = t < 0 ? straight_curvature : curvature * (1 + gradient * (t / curved_length - 0.5));
        const double middle = angle + 0.5 * u * ds;
        p += ds * Eigen::Vector2d(std::cos(middle), std::sin(middle));
        angle += u * ds;
      }
      if (!turns_left) p.y() = -p.y();
      p = Eigen::Rotation2Dd(heading) * p / scale;
      all.push_back({p.x() + x0 + normal(random, noise), p.y() + y0 + normal(random, noise)});
    }
    std::shuffle(all.begin(), all.end(), random);
    return all;
  }
  [[nodiscard]] TubeShapeOptions options() const { return {.scale = scale}; }
};

TEST(TubeShape, RecoversTheTruthInAnyPoseAndOrder) {
  Random random(1);
  for (int n = 0; n < 40; ++n) {
    Photo photo;
    photo.noise = 0;
    photo.curvature = uniform(random, 3, 40);
    photo.curved_length = std::min(uniform(random, 0.03, 0.1), 3.5 / photo.curvature);
    photo.straight_length = uniform(random, 0.02, 0.1);
    photo.turns_left = chance(random, 0.5);
    const Points points = photo.points(random);
    const TubeShapeFit found = fit_tube_shape(points, photo.options());
    EXPECT_NEAR(found.curvature / photo.curvature, 1, 1e-3) << n;  // what 100 steps leave
    EXPECT_NEAR(found.curved_length, photo.curved_length, 1e-4);
    EXPECT_NEAR(found.straight_length, photo.straight_length, 1e-4);
    EXPECT_LE(found.rms, 0.01 * mm);
    EXPECT_TRUE(found.outliers.empty());
  }
}

TEST(TubeShape, ScaleCarriesOver) {
  Random random(2);
  const Photo photo;
  const Points points = photo.points(random);
  TubeShapeOptions options = photo.options();
  const TubeShapeFit found = fit_tube_shape(points, options);
  options.scale *= 2;
  options.scale_sd = 0.01;
  const TubeShapeFit larger = fit_tube_shape(points, options);
  EXPECT_NEAR(larger.curvature, found.curvature / 2, 1e-9);
  EXPECT_NEAR(larger.curved_length, found.curved_length * 2, 1e-12);
  EXPECT_NEAR(larger.curvature_sd, std::hypot(found.curvature_sd / 2, 0.01 * found.curvature / 2), 1e-9);
  EXPECT_NEAR(picture_scale({0, 0}, {300, 400}, 0.05), 1e-4, 1e-18);
}

TEST(TubeShape, SdIsHonest) {
  for (const bool is_stated : {false, true}) {
    Random random(3);
    NormalisedErrors curvature, length;
    for (int n = 0; n < 200; ++n) {
      Photo photo;
      photo.turns_left = n % 2;
      TubeShapeOptions options = photo.options();
      if (is_stated) options.point_sd = photo.noise;
      const TubeShapeFit found = fit_tube_shape(photo.points(random), options);
      curvature.add(found.curvature - photo.curvature, found.curvature_sd);
      length.add(found.curved_length - photo.curved_length, found.curved_length_sd);
    }
    curvature.expect_honest();
    length.expect_honest();
  }
}

TEST(TubeShape, PointsFarOffDoNotCount) {
  Random random(4);
  NormalisedErrors curvature;
  for (int n = 0; n < 100; ++n) {
    const Photo photo;
    Points points = photo.points(random);
    for (std::size_t i = 0; i < points.size(); i += 10) points[i] += Eigen::Vector2d(normal(random, 100), 60);
    const TubeShapeFit found = fit_tube_shape(points, photo.options());
    curvature.add(found.curvature - photo.curvature, found.curvature_sd);
    EXPECT_TRUE(tells(found, outliers));
  }
  EXPECT_LT(curvature.mean_square(), 2);
}

TEST(TubeShape, TellsWhatIsWrong) {
  const auto count = [](TubeShapeNotice kind, const Photo& photo, const TubeShapeOptions& options) {
    Random random(5);
    int told = 0;
    for (int n = 0; n < 30; ++n) {
      const Points points = photo.points(random);
      // A straight part that is hardly there may as well be refused.
      const std::string said = refusal([&] { told += tells(fit_tube_shape(points, options), kind); });
      told += kind == straight_too_short && contains(said, "no straight part");
    }
    return told;
  };
  const Photo sound;
  Random random(6);
  int clean = 0;
  for (int n = 0; n < 100; ++n) clean += !fit_tube_shape(sound.points(random), sound.options()).notices.empty();
  EXPECT_LE(clean, 3);
  Photo photo = sound;
  photo.gradient = 0.6;
  EXPECT_GE(count(curvature_varies, photo, sound.options()), 28);
  photo = sound;
  photo.straight_curvature = 1.5;
  EXPECT_GE(count(straight_part_bent, photo, sound.options()), 28);
  photo = sound;
  photo.straight_length = 0.003;
  EXPECT_GE(count(straight_too_short, photo, sound.options()), 24);
  photo = sound;
  photo.curved_length = 0.008;
  photo.noise = 2;
  EXPECT_GE(count(arc_too_short, photo, sound.options()), 26);
  photo = sound;
  photo.noise = 3;
  TubeShapeOptions stated = sound.options();
  stated.point_sd = 1;
  EXPECT_EQ(count(residuals_large, photo, stated), 30);
}

TEST(TubeShape, RefusesWithWords) {
  Random random(7);
  const Photo photo;
  Points points = photo.points(random);
  const auto said = [](const Points& p, const TubeShapeOptions& options) {
    return refusal([&] { (void)fit_tube_shape(p, options); });
  };
  EXPECT_EQ(said(points, photo.options()), "");
  EXPECT_TRUE(contains(said({points.begin(), points.begin() + 7}, photo.options()), "at least 8 points"));
  EXPECT_TRUE(contains(said(Points(9, {1, 2}), photo.options()), "one place"));
  EXPECT_TRUE(contains(said(points, {.scale = 0}), "scale"));
  points[4].x() = std::nan("");
  EXPECT_TRUE(contains(said(points, photo.options()), "point 5"));
  EXPECT_TRUE(contains(refusal([] { (void)picture_scale({1, 1}, {1, 1}, 0.1); }), "two different points"));
}

}  // namespace tube_shape_test
