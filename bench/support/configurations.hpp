#pragma once
// The robot of the paper's Table II, random designs around it, and random configurations sampled as the benchmarks and
// the accuracy study need them. Fixed seeds: every run sees the same ones.
#include <cstdint>
#include <ctcr/ctcr.hpp>
#include <numbers>
#include <random>
#include <vector>

namespace bench {

struct Configuration {
  ctcr::Joints<3> joints;
  ctcr::TipLoad load;
};

/// The calibrated robot. Ref: Boyer et al., Table II.
inline ctcr::Robot<3> table_ii() {
  const auto tube = [](double inner, double outer, double length, double curvature) {
    return ctcr::Tube{.youngs_modulus = 58e9,
                      .poisson_ratio = 0.3,
                      .inner_diameter = inner,
                      .outer_diameter = outer,
                      .length = length,
                      .curved_length = 0.05,
                      .curvature = curvature};
  };
  return {
      {tube(1.30e-3, 1.52e-3, 0.463, 10.0), tube(1.62e-3, 1.80e-3, 0.3305, 5.0), tube(2.03e-3, 2.35e-3, 0.199, 7.0)},
      ctcr::Vec3::Zero()};
}

using Random = std::mt19937_64;

inline double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// Table II lengths and diameters with random curvatures, curved lengths and stiffnesses.
inline ctcr::Robot<3> random_design(Random& random) {
  ctcr::Robot<3> robot = table_ii();
  for (ctcr::Tube& tube : robot.tubes) {
    tube.curvature = uniform(random, 2.0, 12.0);
    tube.curved_length = uniform(random, 0.02, 0.08);
    tube.youngs_modulus *= uniform(random, 0.7, 1.3);
  }
  return robot;
}

/// Joints uniform where bases and tips are at least 2 mm apart, any angles; tip force of uniform magnitude up to 0.3 N
/// in a random direction, or none.
inline Configuration random_configuration(const ctcr::Robot<3>& robot, bool loaded, Random& random) {
  constexpr double margin = 2e-3;
  Configuration c;
  const auto& tubes = robot.tubes;
  ctcr::Vec3 tip;
  bool ordered = false;
  while (!ordered) {
    for (int i = 0; i < 3; ++i) {
      const double length = tubes[std::size_t(i)].length;
      c.joints.beta[i] = uniform(random, -length, 0.0);
      tip[i] = length + c.joints.beta[i];
    }
    ordered = c.joints.beta[2] <= -margin && tip[2] >= margin;
    for (int i = 0; i < 2; ++i)
      ordered = ordered && c.joints.beta[i] <= c.joints.beta[i + 1] - margin && tip[i] >= tip[i + 1] + margin;
  }
  for (double& alpha : c.joints.alpha) alpha = uniform(random, -std::numbers::pi, std::numbers::pi);
  if (loaded) {
    std::normal_distribution<double> normal;
    const double magnitude = uniform(random, 0.0, 0.3);
    for (double& component : c.load.force) component = normal(random);
    c.load.force *= magnitude / c.load.force.norm();
  }
  return c;
}

inline std::vector<Configuration> random_configurations(const ctcr::Robot<3>& robot, bool loaded, int count,
                                                        std::uint64_t seed = 1) {
  Random random(seed);
  std::vector<Configuration> result;
  while (int(result.size()) < count) result.push_back(random_configuration(robot, loaded, random));
  return result;
}

}  // namespace bench
