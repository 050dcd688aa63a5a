#include "ctcr/math/dual.hpp"

#include <gtest/gtest.h>

#include <random>

#include "support/cases.hpp"

namespace ctcr {
namespace dual_test {

using D = Dual<2>;
using Tail = TailDual<2, 1>;
constexpr int directions = 8;

template <class X>
double derivative(const X& x, int lane) {
  return length_tangent<2>(x, lane / 4)[std::size_t(lane % 4)];
}

D variable(double v, int lane) {
  D x(v);
  x.d[lane / 4][std::size_t(lane % 4)] = 1;
  return x;
}

/// Every operation on a random line through the arguments: the dual must carry the slope of the values.
template <class F>
void expect_slopes(const F& f) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(0.3, 1.7);
  for (int n = 0; n < test::cases(100); ++n) {
    const double a = uniform(random), b = uniform(random), h = 1e-4;
    const D y = f(variable(a, 1), variable(b, 6));
    EXPECT_DOUBLE_EQ(y.v, f(D(a), D(b)).v);
    const auto slope = [&](double da, double db) {
      const auto at = [&](double t) { return f(D(a + t * da), D(b + t * db)).v; };
      return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
    };
    for (int lane = 0; lane < directions; ++lane)
      EXPECT_NEAR(derivative(y, lane), lane == 1 ? slope(1, 0) : lane == 6 ? slope(0, 1) : 0.0, 1e-10);
  }
}

TEST(Dual, Arithmetic) {
  expect_slopes([](D a, D b) { return a + b; });
  expect_slopes([](D a, D b) { return a - b; });
  expect_slopes([](D a, D b) { return a * b; });
  expect_slopes([](D a, D b) { return -(a * a) * b; });
  expect_slopes([](D a, D b) { return 2.0 * a + b * 3.0; });
  expect_slopes([](D a, D b) { return (1.0 + a) * (b + 2.0); });
  expect_slopes([](D a, D b) { return (1.0 - a) * (b - 2.0); });
  expect_slopes([](D a, D b) { return a * inverse(b); });
  expect_slopes([](D a, D b) { return a += b * b; });
}

TEST(Dual, SineAndCosine) {
  expect_slopes([](D a, D b) {
    D s, c;
    sincos(a * b, s, c);
    return s + 2.0 * c;
  });
}

/// Lengths with derivatives in the last groups only.
TEST(Dual, TailLengths) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto full = [](const Tail& x) {
    D y(x.v);
    y.d[1] = x.d[0];
    return y;
  };
  const auto expect_same = [&](const auto& x, const D& y) {
    EXPECT_DOUBLE_EQ(value(x), y.v);
    for (int lane = 0; lane < directions; ++lane) EXPECT_NEAR(derivative(x, lane), derivative(y, lane), 1e-15);
  };
  for (int n = 0; n < test::cases(100); ++n) {
    const auto number = [&] { return uniform(random); };
    const auto lanes = [&] { return Lanes{number(), number(), number(), number()}; };
    const Tail a{number(), {lanes()}}, b{number(), {lanes()}};
    D x(number());
    x.d[0] = lanes(), x.d[1] = lanes();
    expect_same(a * b, full(a) * full(b));
    expect_same(a - b, full(a) - full(b));
    expect_same(1.7 * a, 1.7 * full(a));
    expect_same(a * x, full(a) * x);
  }
  static_assert(!has_length_tangent<Tail, 0> && has_length_tangent<Tail, 1> && !has_length_tangent<double, 0>);
}

}  // namespace dual_test
}  // namespace ctcr
