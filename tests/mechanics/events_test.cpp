#include "ctcr/mechanics/events.hpp"

#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace events_test {

using test::Random;

template <class T>
struct EventOrder : testing::Test {};
TYPED_TEST_SUITE(EventOrder, test::TubeCounts);

TYPED_TEST(EventOrder, DescendsAndNamesEachEventOnce) {
  constexpr int N = TypeParam::N;
  Random random(71);
  for (int n = 0; n < test::cases(200); ++n) {
    const Robot<N> robot = test::random_robot<N>(random);
    const Joints<N> q = test::random_joints(robot, random, 0.3);
    const Events<N> events = sort_events(make_coefficients(robot), q.beta);
    std::array<int, 2 * N> seen{};
    for (std::size_t e = 0; e < 2 * N; ++e) {
      const int id = events.id[e];
      ++seen[std::size_t(id)];
      const Tube& tube = robot.tubes[std::size_t(id % N)];
      const double tip = tube.length + q.beta[id % N];
      if (id < N || tube.curvature != 0) {
        EXPECT_NEAR(events.s[e], id < N ? tip : tip - tube.curved_length, 1e-15);
      }
      EXPECT_LE(events.s[e], events.s[e == 0 ? 0 : e - 1]);
    }
    for (const int count : seen) EXPECT_EQ(count, 1);
    EXPECT_EQ(events.id[0], 0) << "the robot tip is tube 1's, also where tips are flush";
  }
}

/// At equal arc lengths tips come before curved starts, and inner tubes before outer ones.
TEST(Events, OrderOfTies) {
  Robot<3> robot = test::paper_robot();
  for (Tube& tube : robot.tubes) tube.length = 0.2, tube.curved_length = 0.2;
  const Events<3> flush = sort_events(make_coefficients(robot), VecN<3>(-0.1, -0.1, -0.1));
  EXPECT_EQ(flush.id, (std::array<int, 6>{0, 1, 2, 3, 4, 5}));
  // Tube 2 ends exactly where tube 1's curve starts.
  robot = test::paper_robot();
  robot.tubes[0].length = 0.4;
  robot.tubes[0].curved_length = robot.tubes[1].curved_length = 0.125;
  robot.tubes[1].length = 0.275;
  const Events<3> shared = sort_events(make_coefficients(robot), VecN<3>(-0.125, -0.125, -0.1));
  EXPECT_EQ(shared.s[1], shared.s[2]);
  EXPECT_EQ(shared.id[1], 1);
  EXPECT_EQ(shared.id[2], 3);
}

TEST(Events, AStraightTubeHasNoCurvedStart) {
  Robot<3> robot = test::paper_robot();
  robot.tubes[1].curvature = 0;
  robot.tubes[2].curved_length = 0;
  const Events<3> events = sort_events(make_coefficients(robot), VecN<3>(-0.3, -0.2, -0.1));
  for (std::size_t e = 0; e < 6; ++e) EXPECT_EQ(events.s[e] < 0, events.id[e] == 4 || events.id[e] == 5);
}

}  // namespace events_test
}  // namespace ctcr
