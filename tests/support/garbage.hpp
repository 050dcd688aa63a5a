#pragma once
// Numbers that nobody should give.
#include <cmath>
#include <limits>

#include "support/random_robots.hpp"

namespace ctcr::test {

inline constexpr double infinity = std::numeric_limits<double>::infinity();
inline constexpr double garbage_numbers[] = {std::numeric_limits<double>::quiet_NaN(),
                                             infinity,
                                             -infinity,
                                             0,
                                             -0.0,
                                             1e300,
                                             -1e300,
                                             1e-300,
                                             5e-324,
                                             1e150,
                                             1e15,
                                             -1e9,
                                             1e6,
                                             -1,
                                             1};

/// A number left as it is, or with a probability spoilt.
inline void spoil(double& x, double probability, Random& random) {
  if (!chance(random, probability)) return;
  switch (int(uniform(random, 0, 4))) {
    case 0: x = -x; break;
    case 1: x *= std::pow(10, uniform(random, -6, 6)); break;
    default: x = garbage_numbers[std::size_t(uniform(random, 0, std::size(garbage_numbers)))];
  }
}

template <class Numbers>
void spoil_each(Numbers& numbers, double probability, Random& random) {
  for (double& x : numbers) spoil(x, probability, random);
}

template <int N>
void spoil_tubes(Robot<N>& robot, double probability, Random& random) {
  for (Tube& t : robot.tubes)
    for (double* x : {&t.youngs_modulus, &t.poisson_ratio, &t.density, &t.inner_diameter, &t.outer_diameter, &t.length,
                      &t.curved_length, &t.curvature, &t.bending_stiffness})
      spoil(*x, probability, random);
}

}  // namespace ctcr::test
