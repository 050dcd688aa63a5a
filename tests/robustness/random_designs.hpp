#pragma once
// Robots, joints and loads of three kinds: such as people build, harder than that, and what cannot exist.
#include <cmath>

#include "support/garbage.hpp"
#include "support/laws.hpp"

namespace ctcr::test {

/// As people build them: nitinol or steel, bent up to 6 % strain, loads that bend them as far as F L^2 / EI = 3 or
/// up to 1 N; in half of the cases gravity, in a third a moment at the tip. All this times the hardness.
template <int N>
Case<N> case_of_hardness(double hardness, Random& random) {
  Case<N> c;
  const double clearance = uniform(random, 0.02e-3, 0.2e-3);
  double diameter = uniform(random, 0.3e-3, 1.5e-3);
  for (Tube& tube : c.robot.tubes) {
    tube.youngs_modulus = chance(random, 0.2) ? uniform(random, 180e9, 210e9) : uniform(random, 30e9, 80e9);
    tube.poisson_ratio = uniform(random, 0.2, 0.4);
    tube.density = uniform(random, 6000, 8000);
    tube.inner_diameter = diameter;
    tube.outer_diameter = diameter += uniform(random, 0.1e-3, 0.5e-3);
    diameter += clearance;
  }
  double length = uniform(random, 0.03, 0.3);
  for (std::size_t i = N; i-- > 0;) {
    Tube& tube = c.robot.tubes[i];
    tube.length = length;
    length += chance(random, 0.1) ? 0 : uniform(random, 0.01, 0.2);
    const double kind = uniform(random, 0, 1);
    tube.curved_length = kind < 0.1    ? 0
                         : kind < 0.25 ? tube.length
                                       : uniform(random, 0, 1) * std::min(tube.length, 0.15);
    const double strongest =
        std::min(0.06 / (0.5 * tube.outer_diameter), 2 * std::numbers::pi / (tube.curved_length + 0.02));
    tube.curvature = hardness * strongest * (chance(random, 0.1) ? 0 : std::pow(uniform(random, 0, 1), 2)) / 2;
  }
  if (chance(random, 0.5)) c.robot.gravity = random_vector(random, 1e-3) * 9.81e3;
  c.q = random_joints(c.robot, random, 0.15);
  const double reach = c.robot.tubes[0].length + c.q.beta[0], stiffness = c.robot.tubes[0].EI();
  const double strongest = std::min(1.0, 3 * stiffness / (reach * reach + 1e-4));
  if (chance(random, 0.75)) c.load.force = hardness * random_vector(random, strongest);
  if (chance(random, 0.33))
    c.load.moment = hardness * random_vector(random, std::min(0.02, stiffness / (reach + 1e-2)));
  return c;
}

template <int N>
Case<N> sane_case(Random& random) {
  return case_of_hardness<N>(1, random);
}

/// Harder: three times the curvatures, ten times the loads.
template <int N>
Case<N> wide_case(Random& random) {
  Case<N> c = case_of_hardness<N>(3, random);
  c.load = {3 * c.load.force, 3 * c.load.moment};
  return c;
}

/// Numbers that nobody should give: of the robot, the joints, the load, or of all.
template <int N>
Case<N> garbage_case(Random& random) {
  Case<N> c = sane_case<N>(random);
  const double probability = std::pow(10, uniform(random, -2, -0.3));
  if (chance(random, 0.6)) spoil_tubes(c.robot, probability, random);
  if (chance(random, 0.6)) {
    for (Vec3* vector : {&c.robot.gravity, &c.load.force, &c.load.moment}) spoil_each(*vector, probability, random);
    for (VecN<N>* joints : {&c.q.beta, &c.q.alpha}) spoil_each(*joints, probability, random);
  }
  return c;
}

}  // namespace ctcr::test
