// Effects of the drives, of the tracker and of the tip's surroundings.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <string>

#include "support/catalogue_cases.hpp"

namespace ctcr {
namespace devices_test {

using test::Random;

using JointArray = std::array<double, 2>;

/// What an effect adds to the joints.
template <class E>
std::pair<JointArray, JointArray> added(const E& effect, const JointArray& beta, const JointArray& alpha) {
  JointArray b = beta, a = alpha;
  effect.actuate({}, b, a);
  for (std::size_t i = 0; i < 2; ++i) b[i] -= beta[i], a[i] -= alpha[i];
  return {b, a};
}

TEST(PeriodicRotation, RepeatsWithEveryTurn) {
  PeriodicRotation<2> effect;
  effect.values = {0.01, 0, 0.02, 0.03, 2};  // twice a turn
  const auto at = [&](double alpha) { return added(effect, {-0.2, -0.1}, {alpha, 0.3}); };
  EXPECT_NEAR(at(0).second[0], 0.01, 1e-15);
  EXPECT_NEAR(at(std::numbers::pi / 4).second[0], 0.02, 1e-15);
  EXPECT_NEAR(at(0.7).second[0], at(0.7 + std::numbers::pi).second[0], 1e-14);
  EXPECT_NEAR(at(0.7).second[0], -at(0.7 + std::numbers::pi / 2).second[0], 1e-14);
  EXPECT_NEAR(at(0.7).second[1], 0.03 * std::sin(0.6), 1e-15);
  EXPECT_EQ(at(0.7).first, JointArray{});
}

TEST(PeriodicErrors, MayReturnTwiceAsOftenToo) {
  for (const double turn : {0.0, 0.4, 2.9}) {
    PeriodicRotation<2> rotation;
    rotation.values = {0.01, 0, 0.02, 0, 1, 0.003, 0, -0.004, 0};
    const double expected =
        0.01 * std::cos(turn) + 0.02 * std::sin(turn) + 0.003 * std::cos(2 * turn) - 0.004 * std::sin(2 * turn);
    EXPECT_NEAR(added(rotation, {-0.2, -0.1}, {turn, 0.3}).second[0], expected, 1e-15);
    PeriodicTranslation<2> translation;
    translation.values = {0.01, 0, 0.02, 0, 2 * std::numbers::pi, 0.003, 0, -0.004, 0};
    EXPECT_NEAR(added(translation, {turn, -0.1}, {0.7, 0.3}).first[0], expected, 1e-15);
  }
}

TEST(PeriodicTranslation, RepeatsWithThePitch) {
  PeriodicTranslation<2> effect;
  effect.values = {3e-5, 0, 2e-5, 1e-5, 0.002};
  const auto at = [&](double beta) { return added(effect, {beta, -0.1}, {0.7, 0.3}); };
  EXPECT_NEAR(at(0).first[0], 3e-5, 1e-18);
  EXPECT_NEAR(at(-0.1234).first[0], at(-0.1234 + 0.006).first[0], 1e-15);
  EXPECT_NEAR(at(-0.1234).first[0], -at(-0.1234 + 0.001).first[0], 1e-15);
  EXPECT_EQ(at(-0.1234).second, JointArray{});
}

/// What the tracker makes of a pose.
template <class E>
Pose sensed(const E& effect, const Occasion& at, const Pose& pose) {
  Frame<double> reading = frame_of<double>(pose);
  effect.sense(at, reading);
  return pose_of(reading);
}

Pose random_pose(Random& random) {
  return {rotation_matrix(test::random_vector(random, 3)), test::random_vector(random, 0.3)};
}

/// A polynomial of the position read, and a piece of metal.
TEST(FieldDistortion, IsPolynomialPlusMetal) {
  Random random(5);
  for (int n = 0; n < test::cases(20); ++n) {
    FieldDistortion<2> effect;
    std::map<std::string, double> c;
    for (std::size_t k = 0; k < effect.values.size(); ++k)
      c[std::string(effect.parameters[k].name)] = effect.values[k] = test::uniform(random, -1e-3, 1e-3);
    c["metal_volume"] = effect.values[effect.values.size() - 7] *= 0.01;  // [m^3]
    c["metal_z"] = effect.values[effect.values.size() - 4] = -0.2;
    const Pose pose = random_pose(random);
    const Vec3 centre = test::random_vector(random, 0.1), v = pose.position - centre;
    Vec3 by = c["scale"] * v, turn = Vec3::Zero();
    c["z_z"] = -c["x_x"] - c["y_y"];
    c["y_x"] = c["x_y"], c["z_x"] = c["x_z"], c["z_y"] = c["y_z"];
    const Vec3 coils(c["coils_x"], c["coils_y"], c["coils_z"]),
        p = pose.position - coils, metal = Vec3(c["metal_x"], c["metal_y"], c["metal_z"]) - coils;
    const auto off = metal_distortion<double>({p[0], p[1], p[2]}, {metal[0], metal[1], metal[2]}, c["metal_volume"]);
    by += Vec3(off.shift[0], off.shift[1], off.shift[2]);
    turn += Vec3(off.turn[0], off.turn[1], off.turn[2]);
    for (const auto& [name, value] : c) {
      const std::size_t bar = name.rfind('_');
      if (bar == std::string::npos || name.starts_with("metal") || name.starts_with("coils")) continue;
      double product = value;
      for (const char axis : name.substr(bar + 1)) product *= v[axis - 'x'] / 0.05;
      (name.starts_with("turn") ? turn : by)[name[bar - 1] - 'x'] += product;
    }
    const Pose read = sensed(effect, {.centre = centre}, pose);
    EXPECT_LE((read.position - pose.position - by).norm(), 1e-14);
    EXPECT_LE((read.rotation - rotation_matrix(turn) * pose.rotation).norm(), 1e-14);
  }
}

TEST(SensorOffset, IsALeverArm) {
  Random random(1);
  SensorOffset<1> effect;
  effect.values = {1e-3, -2e-3, 0.5e-3, 0.02, 0.03, -0.1};
  for (int n = 0; n < 10; ++n) {
    const Pose tip = random_pose(random), read = sensed(effect, {}, tip);
    EXPECT_LE((read.position - tip.position - tip.rotation * Vec3(1e-3, -2e-3, 0.5e-3)).norm(), 1e-15);
    EXPECT_LE((read.rotation - tip.rotation * rotation_matrix({0.02, 0.03, -0.1})).norm(), 1e-14);
  }
}

TEST(FieldDistortion, DependsOnThePositionAlone) {
  Random random(2);
  FieldDistortion<1> effect;
  for (std::size_t k = 0; k < effect.values.size(); ++k)
    if (effect.parameters[k].role == Role::amplitude) effect.values[k] = test::uniform(random, -1e-3, 1e-3);
  const Vec3 centre(0.1, 0.2, -0.1);
  const auto shift = [&](const Pose& pose) -> Vec3 {
    const Pose read = sensed(effect, {.centre = centre}, pose);
    EXPECT_LE((read.rotation - pose.rotation).norm(), 1e-15);
    return read.position - pose.position;
  };
  const Pose pose = random_pose(random), turned{random_pose(random).rotation, pose.position};
  EXPECT_LE((shift(pose) - shift(turned)).norm(), 1e-15);
  // Linear and quadratic in the distance from the centre, of the size that its parameters say.
  const auto along_x = [&](double x) { return shift({Mat3::Identity(), centre + Vec3(x, 0, 0)}); };
  EXPECT_LE(along_x(0).norm(), 1e-15);
  const Vec3 even = 0.5 * (along_x(0.05) + along_x(-0.05)), odd = 0.5 * (along_x(0.05) - along_x(-0.05));
  EXPECT_LE((even - Vec3(effect.values[1], effect.values[7], effect.values[13])).norm(), 1e-15);
  EXPECT_LE((odd - Vec3(0.05 * effect.values[0], 0, 0)).norm(), 1e-15);
}

TEST(FrameDrift, IsNothingHalfWay) {
  Random random(3);
  FrameDrift<1> effect;
  effect.values = {1e-3, 2e-3, -1e-3, 0.01, -0.02, 0.03};
  const Vec3 centre(0.1, 0, 0.3);
  const Pose pose = random_pose(random);
  EXPECT_LE((sensed(effect, {.part = 0.5, .centre = centre}, pose).position - pose.position).norm(), 1e-15);
  const Pose first = sensed(effect, {.part = 0, .centre = centre}, pose);
  const Pose last = sensed(effect, {.part = 1, .centre = centre}, first);
  EXPECT_LE((last.rotation - pose.rotation).norm(), 1e-14);  // half the drift back and half forth
  const Pose middle = sensed(effect, {.part = 1, .centre = centre}, Pose{Mat3::Identity(), centre});
  EXPECT_LE((middle.position - centre - 0.5 * Vec3(1e-3, 2e-3, -1e-3)).norm(), 1e-15);
}

/// A drift that settles is faster at first and ends where a constant one does.
TEST(FrameDrift, SettlesToTheSameEnd) {
  FrameDrift<1> even, settling;
  even.values = settling.values = {1e-3, 2e-3, -1e-3, 0, 0, 0, 0};
  settling.values[6] = 1;
  const Pose pose{Mat3::Identity(), Vec3::Zero()};
  const auto moved = [&](const FrameDrift<1>& drift, double from, double to) {
    return (sensed(drift, {.part = to}, pose).position - sensed(drift, {.part = from}, pose).position).eval();
  };
  EXPECT_LE((moved(settling, 0, 1) - moved(even, 0, 1)).norm(), 1e-15);
  EXPECT_LE((moved(settling, 0, 1e-6) - 2 * moved(even, 0, 1e-6)).norm(), 1e-11);
  EXPECT_LE(moved(settling, 1 - 1e-6, 1).norm(), 1e-11);
}

TEST(FrameJump, HappensOnce) {
  Random random(4);
  FrameJump<1> effect;
  effect.values = {1e-3, 2e-3, -1e-3, 0.01, -0.02, 0.03, 0.4};
  const Pose pose = random_pose(random);
  EXPECT_LE((sensed(effect, {.part = 0.4}, pose).position - pose.position).norm(), 1e-15);
  const Pose after = sensed(effect, {.part = 0.41}, pose);
  const Mat3 turn = rotation_matrix({0.01, -0.02, 0.03});
  EXPECT_LE((after.position - turn * pose.position - Vec3(1e-3, 2e-3, -1e-3)).norm(), 1e-15);
  EXPECT_LE((after.position - sensed(effect, {.part = 1}, pose).position).norm(), 1e-15);
}

/// In proportion to the depth.
TEST(Contact, PushesBackAndNeverPulls) {
  Random random(5);
  for (int n = 0; n < test::cases(6); ++n) {
    auto recorded = test::random_recording<2>({}, n % 2, random);
    const auto predicted = [&](double stiffness, const Vec3& normal, double distance) {
      Catalogue::On<2> effects;
      test::effect<Contact, 2>(effects).values = {stiffness, distance, std::atan2(normal.y(), normal.x()),
                                                  std::asin(normal.z())};
      recorded.system.model = Model<2, Catalogue>(recorded.system.model.robot(), effects);
      Workspace<2> ws;
      RecordedPrediction<2, Catalogue> p;
      EXPECT_EQ(test::predict_last(recorded.system, recorded.rows, ws, p), Status::ok) << n << ", " << stiffness;
      return p;
    };
    const Vec3 normal = test::random_vector(random, 1).normalized();
    const auto free = predicted(0, normal, 0);
    const double reach = normal.dot(free.solution.position);
    EXPECT_EQ(predicted(1e6, normal, reach + 1e-6).solution.position, free.solution.position);
    for (const double stiffness : {1.0, 100.0, 1e4, 1e6}) {
      const auto touching = predicted(stiffness, normal, reach - 1e-3);
      const double depth = normal.dot(touching.solution.position) - (reach - 1e-3);
      const Vec3 push = touching.load.force - recorded.rows.back().load.force;
      EXPECT_GT(depth, 0);
      EXPECT_LT(depth, 1e-3);
      // The push is sought to 1e-10 N, and moves the tip by the compliance.
      const double compliance = touching.solution.compliance.topLeftCorner<3, 3>().norm();
      EXPECT_LE((push / stiffness + depth * normal).norm(), 1e-10 * (1 / stiffness + compliance)) << stiffness;
    }
  }
}

/// Over its rounding the slope has no jump.
TEST(Contact, SetsInSmoothly) {
  constexpr double stiffness = 20, distance = 0.1, r = 2e-3;
  Contact<1> effect;
  effect.values = {stiffness, distance, 0, 0, r};
  const auto push = [&](double depth) {
    std::array<double, 3> force{};
    effect.environment({distance + depth, 0.01, -0.02}, force);
    EXPECT_EQ(std::hypot(force[1], force[2]), 0);
    return -force[0];
  };
  EXPECT_EQ(push(-1.0001 * r), 0);
  EXPECT_NEAR(push(0), stiffness * r / 4, 1e-15);
  EXPECT_NEAR(push(3 * r), stiffness * 3 * r, 1e-15);
  for (const double edge : {-r, r}) {
    constexpr double h = 1e-8;
    EXPECT_NEAR(push(edge + h) - push(edge), push(edge) - push(edge - h), 1.01 * stiffness * h * h / r);
  }
}

TEST(Contact, IsAPlaneABallOrAHollow) {
  Random random(6);
  for (int n = 0; n < 50; ++n) {
    const Vec3 normal = test::random_vector(random, 1).normalized(), tip = test::random_vector(random, 0.05);
    const double distance = test::uniform(random, -0.05, 0.05), radius = test::uniform(random, 0.02, 1);
    const auto force = [&](double curvature) {
      Contact<1> effect;
      effect.values = {20, distance, std::atan2(normal.y(), normal.x()), std::asin(normal.z()), 0, curvature};
      std::array<double, 3> f{};
      effect.environment({tip.x(), tip.y(), tip.z()}, f);
      return Vec3(f[0], f[1], f[2]);
    };
    const auto expected = [&](double depth, const Vec3& outwards) -> Vec3 {
      return 20 * std::max(depth, 0.0) * outwards;
    };
    EXPECT_LE((force(0) - expected(normal.dot(tip) - distance, -normal)).norm(), 1e-14);
    for (const double side : {1.0, -1.0}) {
      const Vec3 from = tip - (distance + side * radius) * normal;
      const double depth = side * (radius - from.norm());
      EXPECT_LE((force(side / radius) - expected(depth, side * from.normalized())).norm(), 1e-13) << side;
    }
  }
}

}  // namespace devices_test
}  // namespace ctcr
