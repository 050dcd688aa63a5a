#include "ctcr/math/lanes.hpp"

#include <gtest/gtest.h>

namespace ctcr {
namespace lanes_test {

TEST(Lanes, ComputeLaneByLane) {
  const Lanes a{1, -2, 3, 0.5}, b{4, 5, -6, 7};
  const Lanes sum = a + b, difference = a - b, product = a * b, minus = -a, scaled = 2.0 * a, scaled_too = a * 2.0;
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(sum[i], a[i] + b[i]);
    EXPECT_EQ(difference[i], a[i] - b[i]);
    EXPECT_EQ(product[i], a[i] * b[i]);
    EXPECT_EQ(minus[i], -a[i]);
    EXPECT_EQ(scaled[i], 2 * a[i]);
    EXPECT_EQ(scaled_too[i], 2 * a[i]);
  }
}

TEST(Lanes, UpdateInPlaceAndByLane) {
  Lanes a{};
  a += Lanes{1, 2, 3, 4};
  a *= Lanes{2, 2, 2, 2};
  a[2] = -1;
  EXPECT_EQ(a[0] + a[1] + a[2] + a[3], 2 + 4 - 1 + 8);
}

TEST(Lanes, GroupsHoldAllValues) {
  EXPECT_EQ(lane_groups(0), 0);
  EXPECT_EQ(lane_groups(1), 1);
  EXPECT_EQ(lane_groups(4), 1);
  EXPECT_EQ(lane_groups(5), 2);
}

}  // namespace lanes_test
}  // namespace ctcr
