// Timing in closed form, and velocities that are the derivatives of positions.
#include <gtest/gtest.h>

#include "ctcr/control/polyline.hpp"
#include "ctcr/control/spline_path.hpp"
#include "random_control.hpp"
#include "support/no_alloc.hpp"

namespace ctcr {
namespace path_test {

using test::Random, test::uniform;

/// Largest difference between velocity and differences of the position, and largest speed and acceleration.
struct Kinematics {
  double mismatch = 0, speed = 0, acceleration = 0;
  template <class Path>
  explicit Kinematics(const Path& path) {
    constexpr double h = 1e-5;
    for (double t = 2 * h; t < path.duration(); t += path.duration() / 997) {
      const Vec3 before = path.at(t - h).pose.position, after = path.at(t + h).pose.position;
      const Vec3 v = path.at(t).velocity.template head<3>();
      mismatch = std::max(mismatch, (v - (after - before) / (2 * h)).norm());
      speed = std::max(speed, v.norm());
      const Vec3 dv = path.at(t + h).velocity.template head<3>() - path.at(t - h).velocity.template head<3>();
      acceleration = std::max(acceleration, dv.norm() / (2 * h));
    }
  }
};

TEST(Trapezoid, EdgeOfTheCubeTakesEightSeconds) {
  const Trapezoid edge(30e-3, 5e-3, 2.5e-3);
  EXPECT_DOUBLE_EQ(edge.duration(), 8);
  EXPECT_DOUBLE_EQ(edge.at(2).position, 5e-3);
  EXPECT_DOUBLE_EQ(edge.at(2).velocity, 5e-3);
  EXPECT_DOUBLE_EQ(edge.at(4).position, 15e-3);
  EXPECT_DOUBLE_EQ(edge.at(8).position, 30e-3);
}

TEST(Trapezoid, DurationAndSymmetryInClosedForm) {
  Random random(21);
  for (int n = 0; n < test::cases(500); ++n) {
    const double length = uniform(random, 1e-4, 0.2), speed = uniform(random, 1e-3, 0.1), a = uniform(random, 1e-3, 1);
    const Trapezoid motion(length, speed, a);
    const bool travels = length > speed * speed / a;
    EXPECT_NEAR(motion.duration(), travels ? length / speed + speed / a : 2 * std::sqrt(length / a), 1e-9);
    for (const double part : {0.1, 0.3, 0.45}) {
      const auto early = motion.at(part * motion.duration()), late = motion.at((1 - part) * motion.duration());
      EXPECT_NEAR(early.position + late.position, length, 1e-12);
      EXPECT_NEAR(early.velocity, late.velocity, 1e-12);
    }
  }
  EXPECT_EQ(Trapezoid(0, 1, 1).duration(), 0);
}

/// One infinite limit is no limit; two leave no time, and the motion is refused as one without speed is.
TEST(Trapezoid, InfinityIsNoBound) {
  Random random(23);
  for (int n = 0; n < test::cases(500); ++n) {
    const double length = uniform(random, 1e-4, 0.2), limit = std::pow(10, uniform(random, -3, 1));
    const Trapezoid any_speed(length, HUGE_VAL, limit), any_acceleration(length, limit, HUGE_VAL);
    EXPECT_NEAR(any_speed.duration(), 2 * std::sqrt(length / limit), 1e-12 * any_speed.duration());
    EXPECT_NEAR(any_acceleration.duration(), length / limit, 1e-12 * any_acceleration.duration());
    for (const Trapezoid& motion : {any_speed, any_acceleration}) {
      EXPECT_EQ(motion.check(), Status::ok);
      EXPECT_NEAR(motion.at(0.5 * motion.duration()).position, 0.5 * length, 1e-12);
      EXPECT_EQ(motion.at(motion.duration()).position, length);
    }
    EXPECT_EQ(any_acceleration.at(1e-3 * any_acceleration.duration()).velocity, limit);
  }
  EXPECT_EQ(Trapezoid(0, 1, 1).check(), Status::ok);
  EXPECT_NEAR(Trapezoid(1e-200, 1, 1e-200).duration(), 2, 1e-12) << "however small the numbers";
}

TEST(Paths, WithoutSpeedTheyRestAtTheirStart) {
  const std::vector<Vec3> points{{0, 0, 0.1}, {0.01, 0, 0.1}, {0.02, 0.01, 0.1}, {0.03, 0.01, 0.12}};
  for (const auto& [speed, acceleration] : {std::pair{0.0, 1.0},
                                            {1.0, 0.0},
                                            {-1.0, 1.0},
                                            {1.0, -1.0},
                                            {std::nan(""), 1.0},
                                            {1.0, std::nan("")},
                                            {HUGE_VAL, HUGE_VAL},
                                            {1e-320, 1.0}}) {
    const Polyline line(points, speed, acceleration);
    const SplinePath curve(points, speed, acceleration);
    EXPECT_EQ(Trapezoid(0.1, speed, acceleration).check(), Status::invalid_settings);
    EXPECT_EQ(line.check(), Status::invalid_settings);
    EXPECT_EQ(curve.check(), Status::invalid_settings);
    EXPECT_EQ(line.duration(), 0);
    EXPECT_EQ(curve.duration(), 0);
    for (const double t : {-1.0, 0.0, 1.0, 1e6})
      for (const Reference& r : {line.at(t), curve.at(t)}) {
        EXPECT_LT((r.pose.position - points.front()).norm(), 1e-12);
        EXPECT_EQ(r.velocity.norm(), 0);
      }
  }
}

TEST(Paths, WithoutAnOrientationTheyRestAtTheirStart) {
  const std::vector<Vec3> points{{0, 0, 0.1}, {0.01, 0, 0.1}, {0.02, 0.01, 0.1}, {0.03, 0.01, 0.12}};
  for (const Mat3& none : {Mat3(Mat3::Zero()), Mat3(-Mat3::Identity()), Mat3(Mat3::Constant(std::nan("")))}) {
    const Polyline line(points, 1, 1, none);
    const SplinePath curve(points, 1, 1, none);
    EXPECT_EQ(line.check(), Status::invalid_settings);
    EXPECT_EQ(curve.check(), Status::invalid_settings);
    EXPECT_EQ(line.duration() + curve.duration(), 0);
  }
}

TEST(Paths, ThroughWhatIsNoWayTheyRestAtTheFirstPoint) {
  const std::vector<Vec3> good{{0, 0, 0.1}, {0.01, 0, 0.1}, {0.02, 0.01, 0.1}, {0.03, 0.01, 0.12}};
  EXPECT_EQ(Polyline(good, 1, 1).check(), Status::ok);
  EXPECT_EQ(SplinePath(good, 1, 1).check(), Status::ok);
  const auto expect_rest = [](const auto& path, const Vec3& start) {
    EXPECT_EQ(path.check(), Status::invalid_settings);
    EXPECT_EQ(path.duration(), 0);
    for (const double t : {-1.0, 0.0, 1.0}) {
      EXPECT_EQ(path.at(t).pose.position, start);
      EXPECT_EQ(path.at(t).velocity.norm(), 0);
    }
  };
  for (std::size_t k = 1; k < good.size(); ++k)
    for (const double bad : {std::nan(""), HUGE_VAL, 1e200}) {
      std::vector<Vec3> points = good;
      points[k][1] = bad;
      expect_rest(Polyline(points, 1, 1), good[0]);
      expect_rest(SplinePath(points, 1, 1), good[0]);
    }
  for (std::size_t count = 1; count < 4; ++count) expect_rest(SplinePath(std::span(good).first(count), 1, 1), good[0]);
  for (std::size_t k = 1; k < good.size(); ++k) {
    std::vector<Vec3> points = good;
    points[k] = points[k - 1];
    expect_rest(SplinePath(points, 1, 1), good[0]);
    EXPECT_EQ(Polyline(points, 1, 1).check(), Status::ok);
  }
  EXPECT_EQ(Polyline({}, 1, 1).check(), Status::invalid_settings);
  EXPECT_FALSE(Polyline({}, 1, 1).at(0).pose.position.allFinite()) << "nowhere, not at the front plate";
  EXPECT_FALSE(SplinePath({}, 1, 1).at(0).pose.position.allFinite());
}

TEST(Polyline, RestsAtEachCornerOnTime) {
  const std::vector<Vec3> corners{{0, 0, 0.1}, {0.03, 0, 0.1}, {0.03, 0.03, 0.1}, {0.03, 0.03, 0.13}};
  const Polyline path(corners, 5e-3, 2.5e-3);
  EXPECT_DOUBLE_EQ(path.duration(), 24);
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const Reference r = path.at(8.0 * double(k));
    EXPECT_LT((r.pose.position - corners[k]).norm(), 1e-15);
    EXPECT_EQ(r.velocity.norm(), 0);
  }
  const Kinematics k(path);
  EXPECT_LT(k.mismatch, 1e-7);
  EXPECT_LE(k.speed, 5e-3 * (1 + 1e-12));
  EXPECT_LE(k.acceleration, 2.5e-3 * (1 + 1e-6));
}

TEST(SplinePath, ThroughItsPointsAtTheWantedSpeed) {
  Random random(22);
  std::vector<Vec3> points;
  for (int i = 0; i < 7; ++i) points.emplace_back(0.01 * i, uniform(random, -5e-3, 5e-3), uniform(random, 0.1, 0.11));
  const SplinePath path(points, 5e-3, 2.5e-3);
  EXPECT_NEAR(path.duration(), path.length() / 5e-3 + 2, 1e-12);
  EXPECT_LT((path.at(0).pose.position - points.front()).norm(), 1e-9);
  EXPECT_LT((path.at(path.duration()).pose.position - points.back()).norm(), 1e-9);
  for (const Vec3& point : points) {
    double nearest = 1;
    for (double t = 0; t < path.duration(); t += 0.01)
      nearest = std::min(nearest, (path.at(t).pose.position - point).norm());
    EXPECT_LT(nearest, 3e-5);
  }
  const Kinematics k(path);
  EXPECT_LT(k.mismatch, 5e-7);
  EXPECT_LE(k.speed, 5e-3 * (1 + 1e-12));
}

TEST(SplinePath, OnALineItIsThePolyline) {
  std::vector<Vec3> points;
  for (const double s : {0.0, 0.3, 0.5, 0.6, 1.0}) points.emplace_back(s * Vec3(0.03, 0.01, -0.02));
  const SplinePath curve(points, 5e-3, 2.5e-3);
  const Polyline line(std::vector<Vec3>{points.front(), points.back()}, 5e-3, 2.5e-3);
  EXPECT_NEAR(curve.duration(), line.duration(), 1e-9);
  for (double t = 0; t < line.duration(); t += 0.1) {
    EXPECT_LT((curve.at(t).pose.position - line.at(t).pose.position).norm(), 1e-9);
    EXPECT_LT((curve.at(t).velocity - line.at(t).velocity).norm(), 1e-9);
  }
}

TEST(Paths, DoNotAllocateOnTheWay) {
  const std::vector<Vec3> points{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {2, 1, 1}};
  const Polyline line(points, 1, 1);
  const SplinePath curve(points, 1, 1);
  static_assert(noexcept(line.at(0)) && noexcept(curve.at(0)));
  const test::HeapGuard guard;
  double sum = 0;
  for (double t = 0; t < 5; t += 0.1) sum += line.at(t).pose.position.x() + curve.at(t).pose.position.x();
  EXPECT_EQ(guard.uses(), 0);
  EXPECT_GT(sum, 0);
}

}  // namespace path_test
}  // namespace ctcr
