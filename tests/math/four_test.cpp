// Four cases at once are what each of them is alone.
#include "ctcr/math/four.hpp"

#include <gtest/gtest.h>

#include <random>

#include "support/cases.hpp"

namespace ctcr {
namespace four_test {

using Random = std::mt19937_64;

Four any(Random& random, double range) {
  std::uniform_real_distribution<double> number(-range, range);
  return four([&](int) { return number(random); });
}

TEST(Four, ComputesCaseByCase) {
  Random random(1);
  for (int n = 0; n < test::cases(2000); ++n) {
    const Four a = any(random, 3), b = any(random, 3);
    Four s, c, sum = a;
    sincos(a, s, c);
    sum += b;
    for (int i = 0; i < lane_count; ++i) {
      EXPECT_EQ(sum[i], a[i] + b[i]);
      EXPECT_EQ((a - b)[i], a[i] - b[i]);
      EXPECT_EQ((-a * b)[i], -a[i] * b[i]);
      EXPECT_EQ((2.0 * a)[i], 2.0 * a[i]);
      EXPECT_EQ(inverse(a)[i], 1.0 / a[i]);
      EXPECT_NEAR(s[i], std::sin(a[i]), 2.3e-16);
      EXPECT_NEAR(c[i], std::cos(a[i]), 2.3e-16);
    }
    EXPECT_EQ(value(a), a[0]);
  }
}

TEST(Four, FramesMoveAsOne) {
  Random random(2);
  for (const double turn : {1e-9, 0.3, 3.0})
    for (int n = 0; n < test::cases(200); ++n) {
      Frame<Four> together;
      std::array<Frame<double>, lane_count> alone;
      for (int step = 0; step < 3; ++step) {
        const Four o[3] = {any(random, turn), any(random, turn), any(random, turn)};
        const Four vx = any(random, 0.1), vy = any(random, 0.1), vz = any(random, 0.1);
        move_by_exponential(together, o, vx, vy, vz);
        move_along(together, vz);
        for (int i = 0; i < lane_count; ++i) {
          Frame<double>& g = alone[std::size_t(i)];
          move_by_exponential(g, {o[0][i], o[1][i], o[2][i]}, vx[i], vy[i], vz[i]);
          move_along(g, vz[i]);
        }
      }
      for (int i = 0; i < lane_count; ++i)
        for (std::size_t k = 0; k < 3; ++k) {
          const Frame<double>& g = alone[std::size_t(i)];
          EXPECT_NEAR(together.x[k][i], g.x[k], 1e-14);
          EXPECT_NEAR(together.y[k][i], g.y[k], 1e-14);
          EXPECT_NEAR(together.z[k][i], g.z[k], 1e-14);
          EXPECT_NEAR(together.p[k][i], g.p[k], 1e-14);
        }
    }
}

}  // namespace four_test
}  // namespace ctcr
