#include "ctcr/actuation/transmission.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "support/random_robots.hpp"

namespace transmission_test {

using namespace ctcr;

template <int N>
Transmission<N> random_transmission(test::Random& random) {
  Transmission<N> t;
  t.translation_ratio = test::uniform(random, 1e-4, 1e-3) * (test::chance(random, 0.5) ? 1 : -1);
  t.rotation_ratio = test::uniform(random, 0.1, 2) * (test::chance(random, 0.5) ? 1 : -1);
  t.home_translation = -0.3 * VecN<N>::Random().cwiseAbs();
  t.home_rotation = VecN<N>::Random();
  return t;
}

TEST(Transmission, IsInvertible) {
  test::Random random(1);
  for (int n = 0; n < 100; ++n) {
    const Transmission<3> t = random_transmission<3>(random);
    const MotorAngles<3> theta{100 * VecN<3>::Random(), 10 * VecN<3>::Random()};
    const MotorAngles<3> back = motor_angles(t, joints(t, theta));
    EXPECT_LE((back.translation - theta.translation).norm(), 1e-9);
    EXPECT_LE((back.rotation - theta.rotation).norm(), 1e-12);
  }
}

TEST(Transmission, IsRefusedWhereItMovesNothing) {
  test::Random random(3);
  const Transmission<3> good = random_transmission<3>(random);
  EXPECT_EQ(check_transmission(good), Status::ok);
  for (double Transmission<3>::* const ratio : {&Transmission<3>::translation_ratio, &Transmission<3>::rotation_ratio})
    for (const double bad : {0.0, 5e-324, std::nan(""), HUGE_VAL}) {
      Transmission<3> t = good;
      t.*ratio = bad;
      EXPECT_EQ(check_transmission(t), Status::invalid_settings);
    }
  for (VecN<3> Transmission<3>::* const home : {&Transmission<3>::home_translation, &Transmission<3>::home_rotation})
    for (const double bad : {std::nan(""), -HUGE_VAL}) {
      Transmission<3> t = good;
      (t.*home)[1] = bad;
      EXPECT_EQ(check_transmission(t), Status::invalid_settings);
    }
}

TEST(Transmission, MotorsAtZeroHoldTheHome) {
  test::Random random(2);
  const Transmission<4> t = random_transmission<4>(random);
  const Joints<4> q = joints(t, MotorAngles<4>{});
  EXPECT_EQ(q.beta, t.home_translation);
  EXPECT_EQ(q.alpha, t.home_rotation);
}

TEST(Transmission, OneTurnMovesOneAxisByItsRatio) {
  constexpr double turn = 2 * std::numbers::pi;
  const Transmission<2> t{2e-3 / turn, -0.5, {-0.1, -0.05}, {0, 1}};  // 2 mm and -1/2 rev for a turn of the motor
  const Joints<2> q = joints(t, MotorAngles<2>{{turn, 0}, {0, turn}});
  EXPECT_NEAR(q.beta[0], -0.098, 1e-15);
  EXPECT_NEAR(q.beta[1], -0.05, 1e-15);
  EXPECT_NEAR(q.alpha[0], 0, 1e-15);
  EXPECT_NEAR(q.alpha[1], 1 - std::numbers::pi, 1e-15);
}

}  // namespace transmission_test
