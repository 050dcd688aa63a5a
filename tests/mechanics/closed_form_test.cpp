// Robots whose shape a formula tells.
#include <gtest/gtest.h>

#include <cmath>

#include "support/laws.hpp"

namespace ctcr {
namespace closed_form_test {

using test::Random, test::uniform;

template <class T>
struct ClosedForm : testing::Test {};
TYPED_TEST_SUITE(ClosedForm, test::TubeCounts);

/// A circular arc of curvature u about x.
Pose arc(double u, double s) {
  Pose pose;
  pose.rotation = rotation_matrix(Vec3(u * s, 0, 0));
  pose.position = u == 0 ? Vec3(0, 0, s) : Vec3(0, -(1 - std::cos(u * s)) / u, std::sin(u * s) / u);
  return pose;
}

/// Tubes that are all aligned do not twist: between breakpoints the robot is an arc whose curvature is the mean of
/// their precurvatures, weighted by their stiffnesses.
template <int N>
Pose aligned_pose(const Robot<N>& robot, const Joints<N>& q) {
  std::vector<double> breakpoints{0};
  for (int i = 0; i < N; ++i) {
    const Tube& tube = robot.tubes[std::size_t(i)];
    const double tip = tube.length + q.beta[i];
    for (const double s : {tip, tip - tube.curved_length})
      if (s > 0) breakpoints.push_back(s);
  }
  std::sort(breakpoints.begin(), breakpoints.end());
  Pose pose{rotation_z(q.alpha[0]), Vec3::Zero()};
  for (std::size_t k = 1; k < breakpoints.size(); ++k) {
    const double middle = 0.5 * (breakpoints[k - 1] + breakpoints[k]);
    double stiffness = 0, moment = 0;
    for (int i = 0; i < N; ++i) {
      const Tube& tube = robot.tubes[std::size_t(i)];
      const double tip = tube.length + q.beta[i];
      if (middle > tip) continue;
      stiffness += tube.EI();
      if (middle > tip - tube.curved_length) moment += tube.EI() * tube.curvature;
    }
    pose = pose * arc(moment / stiffness, breakpoints[k] - breakpoints[k - 1]);
  }
  return pose;
}

TYPED_TEST(ClosedForm, AlignedTubesAreArcsWithoutTorsion) {
  constexpr int N = TypeParam::N;
  Random random(1);
  for (int n = 0; n < test::cases(100); ++n) {
    const Robot<N> robot = test::random_robot<N>(random);
    Joints<N> q = test::random_joints(robot, random, 0.2);
    q.alpha.setConstant(uniform(random, -10, 10));
    const Pose expected = aligned_pose(robot, q);
    const Solution<N> plain = test::solved<Derivatives::none>(robot, q, {});
    const Solution<N> general = test::solved<Derivatives::compliance>(robot, q, {});
    for (const Solution<N>& solution : {plain, general}) {
      EXPECT_EQ(solution.status, Status::ok);
      EXPECT_LT(test::difference(expected, solution.pose()).norm(), 1e-12);
    }
  }
}

TEST(OneTube, IsAnArcInThePlaneOfItsAngle) {
  Robot<1> robot;
  robot.tubes[0] = {.length = 0.2, .curved_length = 0.08, .curvature = 12, .bending_stiffness = 0.01};
  for (double alpha = -7; alpha < 7; alpha += 0.5) {
    const Solution<1> s = test::solved<Derivatives::none>(robot, {VecN<1>(-0.05), VecN<1>(alpha)}, {});
    const double side = (1 - std::cos(12 * 0.08)) / 12, ahead = 0.15 - 0.08 + std::sin(12 * 0.08) / 12;
    // Curvature is about the tube's x axis, so that it bends towards its -y.
    EXPECT_LT((s.position - Vec3(side * std::sin(alpha), -side * std::cos(alpha), ahead)).norm(), 1e-14);
    EXPECT_LT((s.rotation - rotation_z(alpha) * rotation_matrix(Vec3(12 * 0.08, 0, 0))).norm(), 1e-14);
  }
}

/// And their tip turns with the innermost tube.
TYPED_TEST(ClosedForm, StraightTubesStayStraight) {
  constexpr int N = TypeParam::N;
  Random random(2);
  for (int n = 0; n < test::cases(30); ++n) {
    Robot<N> robot = test::random_robot<N>(random);
    for (Tube& tube : robot.tubes) tube.curvature = 0;
    const Joints<N> q = test::random_joints(robot, random);
    const Solution<N> s = test::solved<Derivatives::jacobian>(robot, q, {});
    EXPECT_EQ(s.status, Status::ok);
    EXPECT_NEAR(s.stability, 1, 1e-14);
    const double deployed = robot.tubes[0].length + q.beta[0];
    EXPECT_LT(test::difference({rotation_z(q.alpha[0]), {0, 0, deployed}}, s.pose()).norm(), 1e-13);
    Eigen::Matrix<double, 6, 2 * N> J = Eigen::Matrix<double, 6, 2 * N>::Zero();
    J(2, 0) = 1;
    J(5, N) = 1;
    EXPECT_LT((s.jacobian - J).cwiseAbs().maxCoeff(), 1e-13);
  }
}

/// Straight tubes with flush tips are one beam (Euler-Bernoulli); torsion is tube 1's alone, also behind the plate.
template <int N>
Robot<N> beam(Random& random) {
  Robot<N> robot = test::random_robot<N>(random);
  for (Tube& tube : robot.tubes) tube.curvature = 0;
  return robot;
}
template <int N>
Joints<N> flush(const Robot<N>& robot, double deployed) {
  Joints<N> q;
  for (int i = 0; i < N; ++i) q.beta[i] = deployed - robot.tubes[std::size_t(i)].length;
  return q;
}
template <int N>
Mat6 beam_compliance(const Robot<N>& robot, double L) {
  double EI = 0;
  for (const Tube& tube : robot.tubes) EI += tube.EI();
  Mat6 C = Mat6::Zero();
  C(0, 0) = C(1, 1) = L * L * L / (3 * EI);
  C(3, 3) = C(4, 4) = L / EI;
  C(0, 4) = C(4, 0) = L * L / (2 * EI);
  C(1, 3) = C(3, 1) = -L * L / (2 * EI);
  C(5, 5) = robot.tubes[0].length / robot.tubes[0].GJ();
  return C;
}

TYPED_TEST(ClosedForm, StraightTubesAreABeam) {
  constexpr int N = TypeParam::N;
  Random random(3);
  for (int n = 0; n < test::cases(30); ++n) {
    const Robot<N> robot = beam<N>(random);
    const double L = uniform(random, 0.02, robot.tubes[N - 1].length);
    const Joints<N> q = flush(robot, L);
    const Mat6 C = beam_compliance(robot, L);
    EXPECT_LT((test::solved<Derivatives::compliance>(robot, q, {}).compliance - C).norm(), 1e-11 * C.norm());
    // Deflections are small to second order: 1e-7 rad leaves 1e-14.
    TipLoad load = test::random_load(random, 1e-7 / C(4, 0), 1e-7 / C(5, 5));
    Vec6 wrench;
    wrench << load.force, load.moment;
    const Solution<N> s = test::solved<Derivatives::none>(robot, q, load);
    EXPECT_EQ(s.status, Status::ok);
    EXPECT_LT((test::difference({Mat3::Identity(), {0, 0, L}}, s.pose()) - C * wrench).norm(), 1e-13);
  }
}

TYPED_TEST(ClosedForm, StraightTubesSagUnderTheirWeight) {
  constexpr int N = TypeParam::N;
  Random random(4);
  for (int n = 0; n < test::cases(30); ++n) {
    Robot<N> robot = beam<N>(random);
    const double L = uniform(random, 0.02, robot.tubes[N - 1].length);
    double EI = 0, mass = 0;
    for (const Tube& tube : robot.tubes) EI += tube.EI(), mass += tube.mass_per_length();
    robot.gravity = Vec3(0, -1e-4, 0);
    const double weight = mass * 1e-4;
    const Solution<N> s = test::solved<Derivatives::none>(robot, flush(robot, L), {}, 2);
    EXPECT_NEAR(s.position.y(), -weight * std::pow(L, 4) / (8 * EI), 1e-12);
    EXPECT_NEAR(rotation_vector(s.rotation).x(), weight * std::pow(L, 3) / (6 * EI), 1e-11);
  }
}

}  // namespace closed_form_test
}  // namespace ctcr
