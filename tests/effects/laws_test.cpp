// Effects of the tubes and of the entry against closed forms, equal robots and reciprocity.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "support/catalogue_cases.hpp"

namespace ctcr {
namespace laws_test {

using test::effect, test::Random;

template <int N>
Solution<N> solved(const Robot<N>& robot, const Catalogue::On<N>& effects, const Joints<N>& q, const TipLoad& load,
                   int steps = 4) {
  Workspace<N> ws;
  Solution<N> s;
  EXPECT_EQ(solve<Derivatives::compliance>(Model<N, Catalogue>(robot, effects), q, load, ws, s,
                                           {.tolerance = 1e-12, .steps = steps, .accuracy = test::as_told}),
            Status::ok);
  return s;
}

/// One tube with 80 mm deployed, of which the last 50 mm are curved.
struct OneTube {
  Robot<1> robot;
  Joints<1> q;
  static constexpr double deployed = 0.08, curved = 0.05;

  explicit OneTube(double curvature) {
    robot.tubes[0] = test::paper_robot().tubes[0];
    robot.tubes[0].curvature = curvature;
    q.beta << deployed - robot.tubes[0].length;
    q.alpha << 0.7;
  }
  [[nodiscard]] double EI() const { return robot.tubes[0].EI(); }
};

/// Where an arc ends: its curvature vector u is constant in a frame that twists at `twist`.
Pose arc(const Vec3& u, double length) {
  Frame<double> frame;
  const double o[3] = {u[0] * length, u[1] * length, u[2] * length};
  move_by_exponential(frame, o, 0.0, 0.0, length);
  return pose_of(frame);
}

void expect_pose(const Pose& found, const Pose& expected, double tolerance) {
  EXPECT_LE((found.position - expected.position).norm(), tolerance);
  EXPECT_LE((found.rotation - expected.rotation).norm(), 10 * tolerance);
}

TEST(EntryCompliance, TurnsTheRobotByTheMomentAtThePlate) {
  OneTube tube(0);
  Catalogue::On<1> effects;
  constexpr double compliance = 0.8;
  effect<EntryCompliance>(effects).values = {compliance};
  const TipLoad load{.force = Vec3(0.1, 0.2, -0.3), .moment = Vec3::Zero()};
  const Solution<1> s = solved(tube.robot, effects, tube.q, load, 64);
  const Mat3 turn = rotation_matrix(compliance * s.position.cross(load.force));
  const TipLoad seen{.force = turn.transpose() * load.force, .moment = Vec3::Zero()};
  const Solution<1> plain = test::solved<Derivatives::none>(tube.robot, tube.q, seen, 64);
  expect_pose(s.pose(), Pose{turn, Vec3::Zero()} * plain.pose(), 1e-11);
}

// What lies beyond the plate is displaced as well, by the depth times the turn.
TEST(EntryCompliance, TurnsTheRobotAboutItsPivot) {
  OneTube tube(0);
  Catalogue::On<1> effects;
  constexpr double compliance = 0.8, depth = 0.02;
  effect<EntryCompliance>(effects).values = {compliance, depth};
  const TipLoad load{.force = Vec3(0.1, 0.2, -0.3), .moment = Vec3::Zero()};
  const Solution<1> s = solved(tube.robot, effects, tube.q, load, 64);
  const auto entry = [&](const Vec3& by) {
    return Pose{rotation_matrix(by), Vec3::Zero()} * Pose{Mat3::Identity(), depth * by.cross(Vec3::UnitZ())};
  };
  Vec3 by = Vec3::Zero();
  for (int k = 0; k < 50; ++k) {
    const Vec3 pivot = (entry(by) * Pose{Mat3::Identity(), {0, 0, -depth}}).position;
    by = compliance * (s.position - pivot).cross(load.force);
  }
  const TipLoad seen{.force = entry(by).rotation.transpose() * load.force, .moment = Vec3::Zero()};
  const Solution<1> plain = test::solved<Derivatives::none>(tube.robot, tube.q, seen, 64);
  expect_pose(s.pose(), entry(by) * plain.pose(), 1e-11);
}

/// A tube that hardly bends, under a side force: what leans is the entry or the joint between tubes.
double lean(double size, double moment, double force, double length, double compliance = 0) {
  double angle = 0;
  for (int k = 0; k < 200; ++k) {
    const double carried = force * length * std::cos(angle);
    angle = size * std::tanh(carried / moment) + compliance * carried;
  }
  return angle;
}

TEST(EntryClearance, LeansAndSaturates) {
  OneTube tube(0);
  tube.robot.tubes[0].bending_stiffness = 1e9;
  Catalogue::On<1> effects;
  effect<EntryClearance>(effects).values = {0.02, 0.01};
  for (const double force : {1e-3, 0.1, 0.3, 10.0}) {
    const Solution<1> s = solved(tube.robot, effects, tube.q, {.force = {force, 0, 0}, .moment = Vec3::Zero()});
    const double angle = lean(0.02, 0.01, force, tube.deployed);
    EXPECT_NEAR(s.position.x(), tube.deployed * std::sin(angle), 1e-9);
    if (force == 10.0) {
      EXPECT_NEAR(angle, 0.02, 1e-12);
    }
  }
}

TEST(EntryClearance, GivesWayAboutItsPivot) {
  OneTube tube(0);
  tube.robot.tubes[0].bending_stiffness = 1e9;
  Catalogue::On<1> effects;
  effect<EntryClearance>(effects).values = {0.02, 0.01, 0.3, 0.015};
  for (const double force : {1e-3, 0.1, 0.3, 1.0}) {
    const Solution<1> s = solved(tube.robot, effects, tube.q, {.force = {force, 0, 0}, .moment = Vec3::Zero()});
    const double angle = lean(0.02, 0.01, force, tube.deployed + 0.015, 0.3);
    EXPECT_NEAR(s.position.x(), tube.deployed * std::sin(angle) + 0.015 * angle * std::cos(angle), 1e-9);
  }
}

TEST(Clearance, KinksTheRobotWhereAnOuterTubeEnds) {
  Robot<2> robot;
  for (std::size_t i = 0; i < 2; ++i) {
    robot.tubes[i] = test::paper_robot().tubes[i];
    robot.tubes[i].curvature = 0;
    robot.tubes[i].bending_stiffness = 1e9;
  }
  Joints<2> q;
  q.beta << 0.1 - robot.tubes[0].length, 0.04 - robot.tubes[1].length;
  Catalogue::On<2> effects;
  for (const double compliance : {0.0, 0.2})
    for (const double force : {1e-3, 0.1, 1.0}) {
      effect<Clearance, 2>(effects).values = {0.5, 0.015, 0.01, compliance};  // that of the innermost tube is not felt
      const Solution<2> s = solved(robot, effects, q, {.force = {0, force, 0}, .moment = Vec3::Zero()});
      EXPECT_NEAR(s.position.y(), 0.06 * std::sin(lean(0.015, 0.01, force, 0.06, compliance)), 1e-9);
      EXPECT_LE((s.tube_tips[1].position - Vec3(0, 0, 0.04)).norm(), 1e-9);
    }
}

// A straight tube in a curved one bends it open, and where that ends leans towards its own shape, with no load at all.
TEST(Clearance, LeansAlongTheMomentThatTheOuterTubeHandsOver) {
  Robot<2> robot;
  for (std::size_t i = 0; i < 2; ++i) robot.tubes[i] = test::paper_robot().tubes[i];
  robot.tubes[0].curvature = 0;
  robot.tubes[1].curved_length = robot.tubes[1].length;
  Joints<2> q;
  q.alpha << 0.7, 0;
  q.beta << 0.1 - robot.tubes[0].length, 0.04 - robot.tubes[1].length;
  const double inner = robot.tubes[0].EI(), outer = robot.tubes[1].EI(),
               u = outer * robot.tubes[1].curvature / (inner + outer);
  Catalogue::On<2> effects;
  const auto leans_by = [&](double size, double law = 1) {
    effect<Clearance, 2>(effects).values = {0.5, 0.015, size, 0, law};
    const Vec3 turn = rotation_vector(solved(robot, effects, q, {}).rotation * rotation_matrix(Vec3(0, 0, -0.7)));
    EXPECT_LE(turn.tail<2>().norm(), 1e-9);
    return (0.04 * u - turn.x()) / 0.015;
  };
  const double moment = inner * u;
  EXPECT_NEAR(leans_by(moment), 1, 1e-7);
  EXPECT_NEAR(leans_by(1e3 * moment) / 1e-3, std::pow(2, 0.25), 1e-4);
  for (const double size : {1e-4, 1e-3})
    EXPECT_NEAR(leans_by(size * moment), std::pow(2, 0.25) / std::sqrt(size), size * size / std::sqrt(size)) << size;
  for (const double size : {0.1, 1.0, 10.0}) EXPECT_NEAR(leans_by(size * moment, 2), std::tanh(1 / size), 1e-7) << size;
}

TEST(TipWeight, IsATipLoad) {
  Random random(1);
  for (int n = 0; n < test::cases(10); ++n) {
    const auto [robot, q, load] = test::smooth_case<2>(random, 0.1, 0.002, test::tilted_gravity);
    Catalogue::On<2> effects;
    effect<TipWeight, 2>(effects).values = {0.003, 0.01, -0.02, 0.015};
    TipLoad all = load;
    all.force += 0.003 * robot.gravity + Vec3(0.01, -0.02, 0.015);
    const Solution<2> loaded = solved(robot, {}, q, all);
    if (loaded.stability < 0.1) continue;
    expect_pose(solved(robot, effects, q, load).pose(), loaded.pose(), 1e-11);
  }
}

TEST(TorsionalCompliance, IsALongerTubeBehindThePlate) {
  Random random(2);
  for (int n = 0; n < test::cases(10); ++n) {
    const auto [robot, q, load] = test::smooth_case<2>(random, 0.1, 0.002, test::tilted_gravity);
    Catalogue::On<2> effects;
    const double compliance = 3;
    effect<TorsionalCompliance, 2>(effects).values = {compliance, 0};
    const double longer = compliance * robot.tubes[0].GJ();
    Robot<2> other = robot;
    Joints<2> back = q;
    other.tubes[0].length += longer;
    back.beta[0] -= longer;
    const Solution<2> expected = test::solved<Derivatives::none>(other, back, load, 4);
    if (expected.stability < 0.1) continue;
    expect_pose(solved(robot, effects, q, load).pose(), expected.pose(), 1e-10);
  }
}

TEST(Softening, GivesWayTowardsAPlateau) {
  OneTube tube(0);
  tube.q.alpha << 0;
  Catalogue::On<1> effects;
  for (const double gamma : {0.004, 0.08})
    for (const double r : {0.25, 0.6})
      for (const double p : {2.0, 5.0, 8.0}) {
        effect<Softening>(effects).values = {gamma, r, p};
        for (const double u : {0.5, 5.0, 15.0}) {
          const double q = 2 * gamma * u * u / (1 - r), left = r + (1 - r) * std::pow(1 + std::pow(q, p / 2), -1 / p);
          if (u == 0.5 && r == 0.25 && p == 2) {
            EXPECT_NEAR(left, 1 - gamma * u * u, 3 * std::pow(gamma * u * u, 2));
          }
          const TipLoad bend{.force = Vec3::Zero(), .moment = {left * tube.EI() * u, 0, 0}};
          expect_pose(solved(tube.robot, effects, tube.q, bend).pose(), arc({u, 0, 0}, tube.deployed), 1e-11);
        }
      }
}

TEST(Anisotropy, IsStifferOneWayThanTheOther) {
  OneTube tube(0);
  tube.q.alpha << 0;
  Catalogue::On<1> effects;
  for (const double turn : {0.0, 0.4}) {  // the stiff axis stands at turn / 2
    constexpr double e = 0.2;
    effect<Anisotropy>(effects).values = {e * std::cos(turn), e * std::sin(turn)};
    const Vec3 stiff(std::cos(turn / 2), std::sin(turn / 2), 0), soft(-stiff.y(), stiff.x(), 0);
    for (const auto& [axis, stiffness] : {std::pair(stiff, 1 + e), {soft, 1 - e}}) {
      const Solution<1> s =
          solved(tube.robot, effects, tube.q, {.force = Vec3::Zero(), .moment = 2 * tube.EI() * axis});
      expect_pose(s.pose(), arc(axis * 2 / stiffness, tube.deployed), 1e-11);
    }
  }
}

TEST(StraightCurvature, BendsTheStraightPartAlone) {
  OneTube tube(6);
  tube.q.alpha << 0;
  Catalogue::On<1> effects;
  effect<StraightCurvature>(effects).values = {0.4, -0.3};
  const Pose expected = arc({0.4, -0.3, 0}, tube.deployed - tube.curved) * arc({6, 0, 0}, tube.curved);
  expect_pose(solved(tube.robot, effects, tube.q, {}).pose(), expected, 1e-11);
}

TEST(StraightCurvature, MayBeUneven) {
  OneTube tube(0);
  tube.q.alpha << 0;
  Catalogue::On<1> effects;
  effect<StraightCurvature>(effects).values = {0.4, 0, 0.5, -0.3};
  const double straight = tube.robot.tubes[0].length - tube.curved;
  const double x0 = 1 - 2 * (tube.deployed - tube.curved) / straight;  // from -1 to 1 along the straight part
  const auto integral = [](double x) { return x + 0.5 * x * x / 2 - 0.3 * (x * x * x - x) / 2; };
  const double turn = 0.4 * straight / 2 * (integral(1) - integral(x0));
  EXPECT_NEAR(rotation_vector(solved(tube.robot, effects, tube.q, {}).rotation).x(), turn, 1e-12);
}

TEST(StraightCurvature, DoesNothingToATubeThatIsCurvedAllAlong) {
  OneTube tube(9);
  tube.robot.tubes[0].curved_length = tube.robot.tubes[0].length;
  Catalogue::On<1> effects;
  for (const double beta : {0.0, -0.03}) {
    tube.q.beta << beta;
    const Pose plain = solved(tube.robot, effects, tube.q, {}).pose();
    Catalogue::On<1> bent;
    effect<StraightCurvature>(bent).values = {0.4, 0.3, 0.5, -0.3};
    expect_pose(solved(tube.robot, bent, tube.q, {}).pose(), plain, 1e-12);
  }
}

TEST(LegendreSum, IsThatOfThePolynomials) {
  constexpr std::array c{0.3, -0.2, 0.15, 0.4, -0.7};
  for (const double x : {-1.0, -0.3, 0.0, 0.8, 1.0}) {
    double sum = 0;
    for (unsigned k = 1; k <= 5; ++k) sum += c[k - 1] * std::legendre(k, x);
    EXPECT_NEAR(legendre_sum(x, c[0], c[1], c[2], c[3], c[4]), sum, 1e-14);
    EXPECT_NEAR(legendre_sum(x, 0.3, 0.0, 0.0), 0.3 * x, 1e-15);
  }
}

TEST(PrecurvatureProfile, KeepsTheTurnOfTheWholeCurve) {
  for (const double deployed : {0.08, 0.03}) {
    OneTube tube(6);
    tube.q.alpha << 0;
    tube.q.beta << deployed - tube.robot.tubes[0].length;
    Catalogue::On<1> effects;
    effect<PrecurvatureProfile>(effects).values = {0.3, -0.2, 0.15};
    const Solution<1> s = solved(tube.robot, effects, tube.q, {});
    const double x0 = std::max(1 - 2 * deployed / tube.curved, -1.0);  // from -1 to 1 along the curve
    const auto integral = [](double x) {                               // of 1 + a P1 + b P2 + c P3
      return x + 0.3 * x * x / 2 - 0.2 * (x * x * x - x) / 2 + 0.15 * (2.5 * x * x * x * x / 4 - 1.5 * x * x / 2);
    };
    const double turn = 6 * tube.curved / 2 * (integral(1) - integral(x0));
    EXPECT_NEAR(rotation_vector(s.rotation).x(), turn, 1e-12);
    if (deployed > tube.curved) {
      EXPECT_NEAR(turn, 6 * tube.curved, 1e-12);
    }
  }
}

TEST(HelicalPrecurvature, MakesAHelix) {
  for (const double deployed : {0.05, 0.02}) {  // what is behind the plate turns the plane as well
    OneTube tube(8);
    tube.q.beta << deployed - tube.robot.tubes[0].length;
    Catalogue::On<1> effects;
    constexpr double rate = 12;
    effect<HelicalPrecurvature>(effects).values = {rate};
    const Solution<1> s = solved(tube.robot, effects, tube.q, {}, 32);
    const Mat3 start = rotation_z(tube.q.alpha[0] + rate * (tube.curved - deployed));
    const Pose helix = Pose{start, Vec3::Zero()} * arc({8, 0, rate}, deployed);
    EXPECT_LE((s.position - helix.position).norm(), 1e-9);
    EXPECT_LE((s.rotation.col(2) - helix.rotation.col(2)).norm(), 1e-8);
    const Mat3 R = helix.rotation * rotation_z(-rate * tube.curved);  // the tube itself is not twisted
    EXPECT_LE((s.rotation - R).norm(), 1e-8);
  }
}

/// A force alone has a potential, and so has every law of the tubes, of the joints between them and of the entry.
template <int N>
void expect_reciprocity() {
  Random random(50 + N);
  for (int n = 0; n < test::cases(10); ++n) {
    const auto [robot, q, load] = test::smooth_case<N>(random, 0.1, 0, test::tilted_gravity);
    auto effects = test::random_effects<N>(random);
    effect<Friction, N>(effects).values = {};
    const Solution<N> s = solved(robot, effects, q, load, 16);
    if (s.stability < 0.1) continue;
    const Mat6 unequal = s.compliance - s.compliance.transpose();
    EXPECT_LE(unequal.norm(), 1e-5 * s.compliance.norm()) << n;
  }
}

TEST(Effects, AreReciprocal) {
  expect_reciprocity<1>();
  expect_reciprocity<2>();
  expect_reciprocity<3>();
}

/// Tubes that lean relieve their energy, so their torques and their kink have one potential: what a small tilt adds to the
/// compliance is symmetric.
template <int N>
void expect_reciprocal_lean() {
  Random random(60 + N);
  for (int n = 0; n < test::cases(10); ++n) {
    const auto [robot, q, load] = test::smooth_case<N>(random, 0.1, 0, test::tilted_gravity);
    Catalogue::On<N> effects;
    const Solution<N> plain = solved(robot, effects, q, load, 16);
    effect<Clearance, N>(effects).values.fill(1e-5);
    auto& values = effect<Clearance, N>(effects).values;
    values[N] = 0.02, values[N + 1] = 0, values[N + 2] = 1;
    const Solution<N> loose = solved(robot, effects, q, load, 16);
    if (plain.stability < 0.1) continue;
    const Mat6 added = loose.compliance - plain.compliance;
    EXPECT_LE((added - added.transpose()).norm(), 1e-2 * added.norm()) << n;
  }
}

TEST(Clearance, IsReciprocalWhereATubeHandsOverItsMoment) {
  expect_reciprocal_lean<2>();
  expect_reciprocal_lean<3>();
}

// Where both bounds meet, a large gamma and a plateau near 0, next to no stiffness is left.
TEST(Softening, IsSolvedUpToItsHardBounds) {
  Random random(9);
  for (const auto& [gamma, plateau, sharpness] : {std::array{0.0, 0.25, 2.0}, {0.016, 0.02, 8.0}, {0.08, 0.25, 8.0}})
    for (int n = 0; n < test::cases(15); ++n) {
      const auto [robot, q, load] = test::smooth_case<3>(random, 0.1, 0, test::tilted_gravity);
      Catalogue::On<3> effects;
      effect<Softening, 3>(effects).values = {gamma, gamma, gamma, plateau, sharpness};
      Workspace<3> ws;
      Solution<3> s;
      const Status status = solve<Derivatives::compliance>(Model<3, Catalogue>(robot, effects), q, load, ws, s);
      ASSERT_TRUE(status == Status::ok || status == Status::singular) << gamma << ", case " << n;
    }
}

}  // namespace laws_test
}  // namespace ctcr
