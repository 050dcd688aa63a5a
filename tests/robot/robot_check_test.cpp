#include "ctcr/robot/robot_check.hpp"

#include <gtest/gtest.h>

#include "support/random_robots.hpp"

namespace ctcr {
namespace robot_check_test {

constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();

Status of_change(double Tube::* field, double value, std::size_t tube = 1) {
  Robot<3> robot = test::paper_robot();
  robot.tubes[tube].*field = value;
  return check_robot(robot);
}

TEST(CheckRobot, TakesThoseThatCanExist) {
  EXPECT_EQ(check_robot(test::paper_robot()), Status::ok);
  test::Random random(1);
  for (int n = 0; n < 1000; ++n) {
    Robot<4> robot = test::random_robot<4>(random);
    EXPECT_EQ(check_robot(robot), Status::ok);
    for (std::size_t i = 1; i < 4; ++i) robot.tubes[i].inner_diameter = robot.tubes[i - 1].outer_diameter;
    EXPECT_EQ(check_robot(robot), Status::ok) << "nested exactly";
  }
}

TEST(CheckRobot, RefusesWhatIsNoNumber) {
  for (double Tube::* field :
       {&Tube::youngs_modulus, &Tube::poisson_ratio, &Tube::density, &Tube::inner_diameter, &Tube::outer_diameter,
        &Tube::length, &Tube::curved_length, &Tube::curvature, &Tube::bending_stiffness})
    for (const double bad : {nan, infinity, -infinity}) EXPECT_EQ(of_change(field, bad), Status::invalid_robot) << bad;
  Robot<3> robot = test::paper_robot();
  robot.gravity[1] = nan;
  EXPECT_EQ(check_robot(robot), Status::invalid_robot);
}

TEST(CheckRobot, RefusesWhatCannotBe) {
  EXPECT_EQ(of_change(&Tube::youngs_modulus, 0), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::youngs_modulus, -58e9), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::bending_stiffness, -1), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::poisson_ratio, 0.5), Status::ok);
  EXPECT_EQ(of_change(&Tube::poisson_ratio, 0.51), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::poisson_ratio, -1), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::density, 0), Status::ok);
  EXPECT_EQ(of_change(&Tube::density, -1), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::inner_diameter, 0, 0), Status::ok) << "a rod";
  EXPECT_EQ(of_change(&Tube::inner_diameter, 1.8e-3), Status::invalid_robot) << "no wall";
  EXPECT_EQ(of_change(&Tube::inner_diameter, -1e-3), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::length, 0), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::curved_length, 0), Status::ok);
  EXPECT_EQ(of_change(&Tube::curved_length, -1e-3), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::curved_length, 0.3305), Status::ok);
  EXPECT_EQ(of_change(&Tube::curved_length, 0.35), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::outer_diameter, 1.70e-3, 0), Status::ok) << "up to the middle of the wall around it";
  EXPECT_EQ(of_change(&Tube::outer_diameter, 1.72e-3, 0), Status::invalid_robot);
}

TEST(CheckRobot, RefusesWhatOverflows) {
  for (double Tube::* field : {&Tube::youngs_modulus, &Tube::curvature, &Tube::bending_stiffness, &Tube::length,
                               &Tube::density, &Tube::outer_diameter})
    EXPECT_EQ(of_change(field, 1e300), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::outer_diameter, 1e300, 2), Status::invalid_robot);
  EXPECT_EQ(of_change(&Tube::youngs_modulus, 1e-320, 0), Status::invalid_robot);
}

TEST(CheckRobot, NeedsNoDiametersWhereTheStiffnessIsGiven) {
  Robot<2> robot;
  robot.tubes = {Tube{.length = 0.2, .bending_stiffness = 0.01}, Tube{.length = 0.1, .bending_stiffness = 0.02}};
  EXPECT_EQ(check_robot(robot), Status::ok);
  robot.tubes[0].inner_diameter = 1e-3;
  robot.tubes[0].density = 6450;
  EXPECT_EQ(check_robot(robot), Status::ok) << "the outer diameter is unknown";
  robot.gravity[2] = -9.8;
  EXPECT_EQ(check_robot(robot), Status::invalid_robot) << "and so is the weight";
}

}  // namespace robot_check_test
}  // namespace ctcr
