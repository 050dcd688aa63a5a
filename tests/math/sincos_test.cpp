#include "ctcr/math/sincos.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "support/cases.hpp"

namespace ctcr {
namespace sincos_test {

double worst_error(double x) {
  double s, c;
  sincos(x, s, c);
  return std::max(std::abs(s - std::sin(x)), std::abs(c - std::cos(x)));
}

constexpr double rounding = 2.3e-16;

TEST(Sincos, EqualsTheLibraryOverItsWholeRange) {
  std::mt19937_64 random(1);
  for (const double range : {1e-8, 1.0, 10.0, 1e3, 1e5}) {
    std::uniform_real_distribution<double> angle(-range, range);
    double worst = 0;
    for (int i = 0; i < test::cases(100000); ++i) worst = std::max(worst, worst_error(angle(random)));
    EXPECT_LT(worst, rounding) << "over +-" << range << " rad";
  }
}

TEST(Sincos, HoldsWhereTheQuadrantChanges) {
  for (int quarter = -60000; quarter <= 60000; quarter += 7)
    for (const double off : {-1e-9, 0.0, 1e-9})
      ASSERT_LT(worst_error((quarter + 0.5) * std::numbers::pi / 2 + off), rounding) << quarter;
}

TEST(Sincos, IsExactAtZeroAndOdd) {
  double s, c, minus_s, minus_c;
  sincos(0.0, s, c);
  EXPECT_EQ(s, 0.0);
  EXPECT_EQ(c, 1.0);
  sincos(1.234, s, c);
  sincos(-1.234, minus_s, minus_c);
  EXPECT_EQ(minus_s, -s);
  EXPECT_EQ(minus_c, c);
}

TEST(Sincos, OfSeveralAnglesEqualsThatOfEach) {
  std::mt19937_64 random(2);
  for (const double range : {1e-8, 1.0, 10.0, 1e5}) {
    std::uniform_real_distribution<double> angle(-range, range);
    for (int i = 0; i < test::cases(20000); ++i) {
      std::array<double, 3> x, s, c;
      for (double& a : x) a = angle(random);
      sincos(x, s, c);
      for (std::size_t j = 0; j < x.size(); ++j) {
        ASSERT_NEAR(s[j], std::sin(x[j]), rounding) << x[j];
        ASSERT_NEAR(c[j], std::cos(x[j]), rounding) << x[j];
      }
    }
  }
  const Lanes quarters = sincos_pair(0.0, std::numbers::pi);
  EXPECT_EQ(quarters[0], 0.0);
  EXPECT_EQ(quarters[1], 1.0);
  EXPECT_NEAR(quarters[2], 0.0, rounding);
  EXPECT_EQ(quarters[3], -1.0);
}

TEST(Sincos, PassesOnNaN) {
  double s, c;
  sincos(std::nan(""), s, c);
  EXPECT_TRUE(std::isnan(s) && std::isnan(c));
}

}  // namespace sincos_test
}  // namespace ctcr
