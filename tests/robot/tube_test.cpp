#include "ctcr/robot/tube.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/random_robots.hpp"

namespace ctcr {
namespace tube_test {

TEST(Tube, StiffnessAndMassOfAnAnnulus) {
  const Tube tube = test::paper_robot().tubes[0];
  const double pi = 3.14159265358979, outer = 1.52e-3, inner = 1.30e-3;
  const double second_moment = pi / 64 * (std::pow(outer, 4) - std::pow(inner, 4));
  EXPECT_NEAR(tube.second_moment(), second_moment, 1e-12 * second_moment);
  EXPECT_NEAR(tube.EI(), 58e9 * second_moment, 1e-12);
  EXPECT_NEAR(tube.mass_per_length(), 6450 * pi / 4 * (outer * outer - inner * inner), 1e-12);
}

/// From shear modulus and polar moment.
TEST(Tube, TorsionalStiffness) {
  test::Random random(1);
  for (int n = 0; n < 20; ++n) {
    const Tube tube = test::random_robot<1>(random).tubes[0];
    const double shear_modulus = tube.youngs_modulus / (2 * (1 + tube.poisson_ratio));
    EXPECT_NEAR(tube.GJ(), shear_modulus * 2 * tube.second_moment(), 1e-12);
  }
}

TEST(Tube, KnownStiffnessOverridesDiameters) {
  Tube tube = test::paper_robot().tubes[0];
  tube.bending_stiffness = 0.123;
  EXPECT_EQ(tube.EI(), 0.123);
  EXPECT_EQ(tube.GJ(), 0.123 / 1.3);
}

}  // namespace tube_test
}  // namespace ctcr
