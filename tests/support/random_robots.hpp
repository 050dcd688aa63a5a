#pragma once
// Random robots, joints and loads for tests of laws. Seed the generator yourself, so that a failing case can be told.
#include <algorithm>
#include <cstddef>
#include <numbers>
#include <random>

#include "ctcr/robot/joints.hpp"
#include "ctcr/robot/robot.hpp"
#include "ctcr/robot/tip_load.hpp"

namespace ctcr::test {

using Random = std::mt19937_64;

inline double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

inline bool chance(Random& random, double probability) { return uniform(random, 0, 1) < probability; }

/// Vector of random direction and of length uniform in [0, max_norm].
inline Vec3 random_vector(Random& random, double max_norm) {
  std::normal_distribution<double> normal;
  const Vec3 direction(normal(random), normal(random), normal(random));
  return direction.normalized() * uniform(random, 0, max_norm);
}

/// The calibrated robot, weightless. Ref: Boyer et al., Table II.
inline Robot<3> paper_robot() {
  Robot<3> robot;
  const double inner_diameter[] = {1.30e-3, 1.62e-3, 2.03e-3};
  const double outer_diameter[] = {1.52e-3, 1.80e-3, 2.35e-3};
  const double length[] = {0.463, 0.3305, 0.199};
  const double curvature[] = {10, 5, 7};
  for (std::size_t i = 0; i < 3; ++i)
    robot.tubes[i] = {.youngs_modulus = 58e9,
                      .poisson_ratio = 0.3,
                      .density = 6450,
                      .inner_diameter = inner_diameter[i],
                      .outer_diameter = outer_diameter[i],
                      .length = length[i],
                      .curved_length = 0.05,
                      .curvature = curvature[i]};
  return robot;
}

/// Nested nitinol tubes, each longer than the one around it. One in eight is straight, one in eight curved from end to
/// end. Weightless: set `gravity` where it matters.
template <int N>
Robot<N> random_robot(Random& random) {
  Robot<N> robot;
  double diameter = uniform(random, 0.6e-3, 1.2e-3);
  for (Tube& tube : robot.tubes) {
    tube.youngs_modulus = uniform(random, 41e9, 75e9);
    tube.poisson_ratio = uniform(random, 0.2, 0.4);
    tube.density = 6450;
    tube.inner_diameter = diameter;
    tube.outer_diameter = diameter += uniform(random, 0.2e-3, 0.35e-3);
    diameter += uniform(random, 0.05e-3, 0.15e-3);
  }
  double length = uniform(random, 0.1, 0.2);
  for (std::size_t i = N; i-- > 0;) {
    Tube& tube = robot.tubes[i];
    tube.length = length;
    length += uniform(random, 0.05, 0.15);
    const bool straight = chance(random, 0.125), all_curved = chance(random, 0.125);
    tube.curved_length = all_curved ? tube.length : uniform(random, 0.02, 0.08);
    tube.curvature = straight ? 0 : all_curved ? uniform(random, 0.5, 3) : uniform(random, 2, 10);
  }
  return robot;
}

/// Joints anywhere in their range: ordered, every tip in front of the plate, any angle.
/// @param flush  probability of each gap between neighbouring bases or tips (and before the plate) being exactly closed
template <int N>
Joints<N> random_joints(const Robot<N>& robot, Random& random, double flush = 0) {
  Joints<N> q;
  // From the outside in: grasped behind the next tube (or the plate), reaching beyond it.
  double base = 0, tip = 0;
  for (int i = N - 1; i >= 0; --i) {
    const double length = robot.tubes[static_cast<std::size_t>(i)].length;
    // Where tubes are flush, rounding may put one limit beyond the other.
    const double highest = base, lowest = std::min(tip - length, highest);
    q.beta[i] = !chance(random, flush) ? uniform(random, lowest, highest) : chance(random, 0.5) ? lowest : highest;
    q.alpha[i] = uniform(random, -std::numbers::pi, std::numbers::pi);
    base = q.beta[i];
    tip = length + base;
  }
  return q;
}

/// Tip force up to `max_force` [N] and tip moment up to `max_moment` [N m], each in a random direction.
inline TipLoad random_load(Random& random, double max_force = 0.3, double max_moment = 0) {
  return {random_vector(random, max_force), random_vector(random, max_moment)};
}

}  // namespace ctcr::test
