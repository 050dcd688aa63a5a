#pragma once
// What tests of the mechanics' laws share: a cold solve, differences of poses, derivatives by differences.
#include <gtest/gtest.h>

#include <algorithm>

#include "ctcr/math/se3.hpp"
#include "support/cases.hpp"
#include "support/random_robots.hpp"
#include "support/solver.hpp"

namespace ctcr::test {

/// Number of tubes as a type, for typed tests.
template <int N_>
struct TubeCount {
  static constexpr int N = N_;
};
using TubeCounts = ::testing::Types<TubeCount<1>, TubeCount<2>, TubeCount<3>, TubeCount<4>>;
using OneToFiveTubes = ::testing::Types<TubeCount<1>, TubeCount<2>, TubeCount<3>, TubeCount<4>, TubeCount<5>>;
using OneToThreeTubes = ::testing::Types<TubeCount<1>, TubeCount<2>, TubeCount<3>>;
using TwoAndThreeTubes = ::testing::Types<TubeCount<2>, TubeCount<3>>;

/// Earth's gravity in a direction that no axis shares [m/s^2].
inline const Vec3 tilted_gravity{3.0, -8.6, 3.6};

/// The solution from a cold start.
template <Derivatives D, int N>
Solution<N> solved(const Robot<N>& robot, const Joints<N>& q, const TipLoad& load, int steps = 1) {
  Workspace<N> ws;
  Solution<N> solution;
  (void)solve<D>(Model<N>(robot), q, load, ws, solution, {.steps = steps, .accuracy = as_told});
  return solution;
}

/// From pose a to pose b: translation [m] and rotation vector [rad], base axes.
inline Vec6 difference(const Pose& a, const Pose& b) {
  Vec6 d;
  d << b.position - a.position, rotation_vector(b.rotation * a.rotation.transpose());
  return d;
}

/// Turns vectors in both halves of a pose difference.
inline Mat6 twice(const Mat3& R) {
  Mat6 both = Mat6::Zero();
  both.topLeftCorner<3, 3>() = both.bottomRightCorner<3, 3>() = R;
  return both;
}

/// Smallest distance between the places where anything changes along the robot, grasps and the plate included [m]: how
/// far beta may move before the model's derivative by it jumps, or the joints are refused.
template <int N>
double smallest_gap(const Robot<N>& robot, const Joints<N>& q) {
  std::array<double, 2 * N + 1> s{};
  for (std::size_t i = 0; i < N; ++i) {
    s[i] = robot.tubes[i].length + q.beta[Eigen::Index(i)];
    s[N + i] = s[i] - robot.tubes[i].curved_length;
  }
  std::sort(s.begin(), s.end());
  double gap = 1;
  for (std::size_t i = 0; i + 1 < s.size(); ++i) gap = std::min(gap, s[i + 1] - s[i]);
  for (int i = 0; i < N; ++i) gap = std::min(gap, (i + 1 < N ? q.beta[i + 1] : 0.0) - q.beta[i]);
  return gap;
}

/// A robot in a place where everything is smooth and stable: no breakpoints closer than 2 mm, far from snapping.
template <int N>
struct Case {
  Robot<N> robot;
  Joints<N> q;
  TipLoad load;
};

template <int N>
Case<N> smooth_case(Random& random, double max_force, double max_moment, const Vec3& gravity) {
  for (;;) {
    Case<N> c{random_robot<N>(random), {}, random_load(random, max_force, max_moment)};
    c.robot.gravity = gravity;
    c.q = random_joints(c.robot, random);
    if (smallest_gap(c.robot, c.q) < 2e-3) continue;
    const Solution<N> solution = solved<Derivatives::none>(c.robot, c.q, c.load);
    if (solution.status == Status::ok && solution.stability > 0.3) return c;
  }
}

/// Slope of a pose(t) at t = 0, of fourth order.
template <class F>
Vec6 slope(const F& pose, double h) {
  const Pose at = pose(0.0);
  const auto d = [&](double t) { return difference(at, pose(t)); };
  return (8.0 * (d(h) - d(-h)) - (d(2 * h) - d(-2 * h))) / (12 * h);
}

}  // namespace ctcr::test
