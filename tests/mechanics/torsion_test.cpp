// Two curved tubes twist each other like a pendulum swings: theta'' = c sin(theta), theta = psi_2 - psi_1, solved by
// elliptic integrals. Ref: Dupont et al. 2010, Section V.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "support/laws.hpp"

namespace ctcr {
namespace torsion_test {

constexpr double pi = std::numbers::pi;

/// Two tubes, curved from end to end and deployed by the same length.
struct TwoTubes {
  double EI1 = 0.004, EI2 = 0.011, nu = 0.3, curvature1 = 9, curvature2 = 6, beta1 = -0.12, beta2 = -0.05;

  double GJ1() const { return EI1 / (1 + nu); }
  double GJ2() const { return EI2 / (1 + nu); }
  /// c [1/m^2].
  double coupling() const { return EI1 * EI2 * curvature1 * curvature2 / (EI1 + EI2) * (1 / GJ1() + 1 / GJ2()); }
  /// The tubes' torques balance: w_1 and w_2 from theta'.
  double w1(double rate) const { return -GJ2() / (GJ1() + GJ2()) * rate; }
  double w2(double rate) const { return GJ1() / (GJ1() + GJ2()) * rate; }
  /// alpha_2 - alpha_1 from theta and theta' at the plate: behind it the tubes only twist.
  double base_angle(double theta, double rate) const { return theta + beta2 * w2(rate) - beta1 * w1(rate); }

  Robot<2> robot(double deployed) const {
    Robot<2> robot;
    const auto tube = [&](double EI, double curvature, double beta) {
      return Tube{.poisson_ratio = nu,
                  .length = deployed - beta,
                  .curved_length = deployed - beta,
                  .curvature = curvature,
                  .bending_stiffness = EI};
    };
    robot.tubes = {tube(EI1, curvature1, beta1), tube(EI2, curvature2, beta2)};
    return robot;
  }
  Joints<2> joints(double alpha) const { return {{beta1, beta2}, {0.4, 0.4 + alpha}}; }
};

/// theta at the robot tip, as the model finds it.
double twist_at_tip(const Solution<2>& s) {
  return rotation_vector(s.tube_tips[0].rotation.transpose() * s.tube_tips[1].rotation).z();
}

TEST(Torsion, FollowsThePendulum) {
  const TwoTubes two;
  const double c = two.coupling();
  for (const double at_tip : {0.2, 1.0, 1.8, 2.4}) {
    for (const double at_plate : {at_tip + 0.05, at_tip + 0.2}) {
      // phi = pi - theta swings with amplitude phi(tip): arc length from tip to plate by the incomplete integral.
      const double k = std::sin(0.5 * (pi - at_tip));
      const double amplitude = std::asin(std::sin(0.5 * (pi - at_plate)) / k);
      const double deployed = (std::comp_ellint_1(k) - std::ellint_1(k, amplitude)) / std::sqrt(c);
      const double rate = -std::sqrt(2 * c * (std::cos(at_tip) - std::cos(at_plate)));
      const Joints<2> q = two.joints(two.base_angle(at_plate, rate));

      const Solution<2> plain = test::solved<Derivatives::none>(two.robot(deployed), q, {}, 64);
      const Solution<2> general = test::solved<Derivatives::compliance>(two.robot(deployed), q, {}, 64);
      for (const Solution<2>& s : {plain, general}) {
        EXPECT_EQ(s.status, Status::ok);
        EXPECT_NEAR(twist_at_tip(s), at_tip, 2e-9) << "deployed " << deployed;
      }
      EXPECT_NEAR(twist_at_tip(test::solved<Derivatives::none>(two.robot(deployed), q, {})), at_tip, 2e-3);
    }
  }
}

/// Stability is the derivative of the base angle by the tip angle.
TEST(Torsion, StabilityIsASlope) {
  const TwoTubes two;
  const double c = two.coupling(), root = std::sqrt(c), deployed = 0.05, x = root * deployed;
  const double transmission = two.base_angle(0, 1);  // base angle per theta' [m]
  const Robot<2> robot = two.robot(deployed);
  // Around theta = 0 the pendulum is theta_tip cosh, around pi it is a cosine.
  EXPECT_NEAR(test::solved<Derivatives::none>(robot, two.joints(0), {}, 64).stability,
              std::cosh(x) - root * transmission * std::sinh(x), 1e-7);
  const double opposed = std::cos(x) + root * transmission * std::sin(x);
  ASSERT_GT(opposed, 0.1) << "opposed tubes still stable";
  const Solution<2> s = test::solved<Derivatives::none>(robot, two.joints(pi), {}, 64);
  EXPECT_EQ(s.status, Status::ok);
  EXPECT_NEAR(s.stability, opposed, 1e-7);
}

/// Opposed tubes that must snap are never called ok.
TEST(Torsion, UnstableIsNeverOk) {
  const TwoTubes two;
  const double deployed = 0.9 * pi / std::sqrt(two.coupling());
  const Solution<2> s = test::solved<Derivatives::none>(two.robot(deployed), two.joints(pi), {}, 16);
  EXPECT_TRUE(s.status == Status::singular || (s.status == Status::ok && s.stability > 0)) << to_string(s.status);
  // A hair off the symmetry the tubes have snapped to one side.
  const Solution<2> off = test::solved<Derivatives::none>(two.robot(deployed), two.joints(pi - 0.2), {}, 16);
  EXPECT_EQ(off.status, Status::ok);
  EXPECT_GT(off.stability, 0);
  EXPECT_LT(std::abs(twist_at_tip(off)), pi - 0.5);
}

}  // namespace torsion_test
}  // namespace ctcr
