// Profiles along a tube that come as a table: one tube without load takes the shape of its precurvature.
#include "ctcr/effects/profile_table.hpp"

#include <gtest/gtest.h>

#include "ctcr/recording/derivatives.hpp"

namespace ctcr {
namespace profile_table_test {

using Fx = EffectList<ProfileTable>;
using Parameters = SystemParameters<1, Fx>;

constexpr double length = 0.4, grasped = -0.25;

System<1, Fx> straight_tube(const Profiles<1>* profiles) {
  Robot<1> robot;
  robot.tubes[0] = {.youngs_modulus = 58e9,
                    .inner_diameter = 1.3e-3,
                    .outer_diameter = 1.52e-3,
                    .length = length,
                    .curved_length = 0.05,
                    .curvature = 0};
  Fx::On<1> effects;
  std::get<ProfileTable<1>>(effects.list).profiles = profiles;
  return {{}, Model<1, Fx>(robot, effects), {}, Settings{.steps = 16}};
}

Profiles<1> linear(std::array<double, 2> curvature_at_tip) {
  Profiles<1> profiles;
  profiles.length[0] = length;
  for (int k = 0; k <= 40; ++k)
    profiles.nodes[0].push_back({{k / 40.0 * curvature_at_tip[0], k / 40.0 * curvature_at_tip[1]}, 0});
  return profiles;
}

Pose read(const System<1, Fx>& system, double force = 0) {
  const RecordedRow<1> row{{{VecN<1>(grasped)}, {VecN<1>(0)}}, {.force = {0, force, 0}}, {}};
  Workspace<1> workspace;
  RecordedPrediction<1, Fx> prediction{{}, {}, system.model};
  EXPECT_EQ((predict<1, Fx>(system, row, {}, workspace, prediction)), Status::ok);
  return prediction.reading;
}

TEST(ProfileTable, WithoutATableItChangesNothing) {
  const Pose tip = read(straight_tube(nullptr));
  EXPECT_NEAR((tip.position - Vec3(0, 0, length + grasped)).norm(), 0, 1e-14);
  EXPECT_EQ(Parameters::count, ParameterVector<1>::count);
}

TEST(ProfileTable, TheTipTurnsByTheIntegralOfTheCurvature) {
  constexpr double k = 8;
  const double angle = k * (length * length - grasped * grasped) / (2 * length);
  for (const std::array<double, 2>& at_tip : {std::array{k, 0.0}, std::array{0.0, k}, std::array{-0.6 * k, 0.8 * k}}) {
    const Profiles<1> profiles = linear(at_tip);
    const Vec3 turn = rotation_vector(read(straight_tube(&profiles)).rotation);
    EXPECT_NEAR((turn - angle * Vec3(at_tip[0], at_tip[1], 0) / k).norm(), 0, 1e-9);
  }
}

TEST(ProfileTable, TheStiffnessIsThatOfAnotherTube) {
  Profiles<1> profiles;
  profiles.length[0] = length;
  profiles.nodes[0] = {{{0, 0}, -0.3}, {{0, 0}, -0.3}};
  System<1, Fx> softer = straight_tube(nullptr);
  Robot<1> robot = softer.model.robot();
  robot.tubes[0].youngs_modulus *= 0.7;
  softer.model = Model<1, Fx>(robot, {});
  EXPECT_NEAR((read(straight_tube(&profiles), -0.05).position - read(softer, -0.05).position).norm(), 0, 1e-9);
}

TEST(ProfileTable, DerivativesFollowTheTable) {
  const Profiles<1> profiles = linear({6, 2});
  const System<1, Fx> system = straight_tube(&profiles);
  const RecordedRow<1> row{{{VecN<1>(grasped)}, {VecN<1>(0)}}, {.force = {0, -0.05, 0}}, {}};
  Workspace<1> workspace;
  RecordedPrediction<1, Fx> here{{}, {}, system.model};
  ASSERT_EQ((predict<1, Fx>(system, row, {}, workspace, here)), Status::ok);
  for (const Parameter kind : {Parameter::length, Parameter::home_translation}) {
    const int places[] = {ParameterVector<1>::index(kind, 0)};
    Vec6 slope;
    ASSERT_EQ((differentiate<1, Fx>(system, row, workspace, here, places, slope)), Status::ok);
    const double step = 1e-6;
    Vec3 moved[2];
    for (int side = 0; side < 2; ++side) {
      Eigen::VectorXd x = Parameters::values(system);
      x[places[0]] += side ? step : -step;
      const System<1, Fx> other = Parameters::with_values(system, x);
      moved[side] = read(other, -0.05).position;
    }
    EXPECT_NEAR((slope.head<3>() - (moved[1] - moved[0]) / (2 * step)).norm(), 0, 1e-6) << int(kind);
  }
}

}  // namespace profile_table_test
}  // namespace ctcr
