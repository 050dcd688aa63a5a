// A controller at work on simulated robots.
#include <gtest/gtest.h>

#include "ctcr/control/closed_loop.hpp"
#include "ctcr/control/polyline.hpp"
#include "ctcr/simulation/simulated_robot.hpp"
#include "random_control.hpp"
#include "support/no_alloc.hpp"
#include "support/solver.hpp"

namespace ctcr {
namespace controller_test {

constexpr double period = 0.025;
const Joints<3> home{{-0.298, -0.2205, -0.145}, {0.2, 0.9, -1.4}};

System<3> paper_system() {
  return {{2e-3 / (2 * std::numbers::pi), -1, {-0.298, -0.2205, -0.145}, {0.1, 0.2, 0.3}},
          Model<3>(test::paper_robot()),
          {{rotation_matrix({0, 1.2, 0.3}), {-0.06, 0.02, -0.18}}}};
}

struct Loop {
  System<3> system = paper_system();
  MotorAngles<3> start = motor_angles(system.transmission, home);
  Vec3 at;  ///< the tip without load
  Loop() {
    Workspace<3> ws;
    Solution<3> s;
    (void)solve<Derivatives::jacobian>(system.model, home, TipLoad{}, ws, s);
    at = s.position;
  }
  /// Distance to the path's end once the robot rests there.
  double error_after(const Polyline& path, Controller<3>& controller, SimulatedRobot<3>& robot, const TipLoad& load) {
    EXPECT_EQ(run(controller, robot, path, period, load, [](const auto&) { return true; }), Status::ok);
    const Polyline rest(std::vector<Vec3>{path.at(path.duration()).pose.position}, 1, 1);
    for (int k = 0; k < 200; ++k)
      EXPECT_EQ(run(controller, robot, rest, period, load, [](const auto&) { return true; }), Status::ok);
    return (robot.tip().position - path.at(path.duration()).pose.position).norm();
  }
};

TEST(Controller, ReachesATargetWhateverTheForce) {
  for (const auto what : {TipForce::unknown, TipForce::known, TipForce::estimated}) {
    Loop loop;
    const TipLoad load{.force = {0, -0.1, 0.02}};
    Controller<3> controller(loop.system, {}, period);
    controller.tip_force = what;
    controller.tasks.get<LimitAvoidance>().weight = {};
    SimulatedRobot<3> robot(loop.system, loop.start, load);
    const Polyline path(std::vector<Vec3>{loop.at, loop.at + Vec3(5e-3, 4e-3, -3e-3)}, 5e-3, 2.5e-3);
    EXPECT_LT(loop.error_after(path, controller, robot, load), 2e-6);
    if (what == TipForce::estimated) {
      // As far as the tip shows it: a force along which the robot hardly yields stays unknown.
      Workspace<3> ws;
      Solution<3> s;
      const Joints<3> q = joints(loop.system.transmission, robot.motor_angles());
      ASSERT_EQ(solve<Derivatives::compliance>(loop.system.model, q, load, ws, s), Status::ok);
      const Vec3 wrong = controller.estimate.force - load.force;
      EXPECT_LT((s.compliance.topLeftCorner<3, 3>() * wrong).norm(), 5e-5);
      EXPECT_LT(wrong.norm(), 0.5 * load.force.norm());
    }
  }
}

TEST(Controller, ReachesAFullPose) {
  Loop loop;
  Joints<3> there = home;
  there.beta += Vec3(3e-3, -5e-3, 4e-3);
  there.alpha += Vec3(0.3, -0.25, 0.35);
  const SimulatedRobot<3> goal(loop.system, motor_angles(loop.system.transmission, there), {});
  Controller<3> controller(loop.system, {}, period);
  controller.tasks.get<Tracking>().weight = {1e7, 1e5};
  controller.tasks.get<LimitAvoidance>().weight = {};
  SimulatedRobot<3> robot(loop.system, loop.start, {});
  Measurement<3> measured;
  MotorAngles<3> v;
  for (int k = 0; k < 1200; ++k) {
    ASSERT_EQ(robot.measure(measured), Status::ok);
    ASSERT_EQ(controller.advance(measured, {goal.tip()}, {}, v).status, Status::ok);
    ASSERT_EQ(robot.move(v, period), Status::ok);
  }
  EXPECT_LT((robot.tip().position - goal.tip().position).norm(), 1e-7);
  EXPECT_LT(rotation_vector(goal.tip().rotation * robot.tip().rotation.transpose()).norm(), 1e-6);
}

TEST(Controller, StandsStillOnWhatItCannotUse) {
  Loop loop;
  Controller<3> controller(loop.system, {}, period);
  Measurement<3> measured{loop.start, {Mat3::Identity(), Vec3::Constant(std::nan(""))}};
  MotorAngles<3> v;
  EXPECT_EQ(controller.advance(measured, {}, {}, v).status, Status::not_finite);
  EXPECT_EQ(v.translation.norm() + v.rotation.norm(), 0);
  measured.theta.translation[0] = std::nan("");
  measured.reading = {};
  EXPECT_EQ(controller.advance(measured, {}, {}, v).status, Status::not_finite);
  EXPECT_EQ(v.translation.norm() + v.rotation.norm(), 0);
}

TEST(Controller, LimitsThatExcludeTheStartAreRefused) {
  Loop loop;
  const Controller<3> wide(loop.system, {}, period), narrow(loop.system, {.base_gap = 0.09}, period),
      none(loop.system, {.base_gap = 0.2}, period);
  EXPECT_EQ(wide.check_start(loop.start), Status::ok);
  EXPECT_EQ(narrow.check_start(loop.start), Status::joints_out_of_order);
  EXPECT_EQ(none.check_start(loop.start), Status::joints_out_of_order);
}

/// On the way to a reference out of reach it keeps its limits and reports them.
TEST(Controller, KeepsItsLimits) {
  for (const auto at_limits : {AtLimits::hold, AtLimits::redistribute}) {
    Loop loop;
    const Limits<3> limits{.base_gap = 20e-3, .tip_gap = 10e-3};
    Controller<3> controller(loop.system, limits, period);
    controller.at_limits = at_limits;
    SimulatedRobot<3> robot(loop.system, loop.start, {});
    const Polyline path(std::vector<Vec3>{loop.at, loop.at + Vec3(0, 0, 0.5)}, 50e-3, 0.1);
    int held = 0, gave_way = 0;
    const Status status = run(controller, robot, path, period, {}, [&](const auto& row) {
      const Gaps<3> g = gaps(loop.system.model.robot(), joints(loop.system.transmission, row.measured.theta).beta);
      EXPECT_GE(g.bases.minCoeff(), limits.base_gap - 1e-9);
      EXPECT_GE(g.tips.minCoeff(), limits.tip_gap - 1e-9);
      held += row.report.limits.any();
      gave_way += row.report.gave_way() & 1;
      return true;
    });
    EXPECT_EQ(status, Status::ok);
    EXPECT_GT(held, 50);
    EXPECT_GT(gave_way, 50);
  }
}

TEST(Controller, DoesNotAllocateNorThrow) {
  Loop loop;
  Controller<3, TaskList<Tracking, Damping, LimitAvoidance, ObstacleAvoidance, StabilityMargin, Posture<3>>> controller(
      loop.system, {}, period);
  controller.tasks.get<StabilityMargin>() = {.weight = {1, 1}, .wanted = 2};
  controller.tasks.get<ObstacleAvoidance>().obstacle = {loop.at, 1e-3};
  SimulatedRobot<3> robot(loop.system, loop.start, {}, {35e-6, 1e-3});
  Measurement<3> measured;
  MotorAngles<3> v;
  const Reference still;
  const TipLoad none;
  static_assert(noexcept(controller.advance(measured, still, none, v)));
  static_assert(noexcept(robot.move(v, period)));
  static_assert(noexcept(robot.measure(measured)));
  static_assert(Device<SimulatedRobot<3>, 3>);
  for (const auto what : {TipForce::unknown, TipForce::estimated})
    for (const auto at_limits : {AtLimits::hold, AtLimits::redistribute}) {
      controller.tip_force = what;
      controller.at_limits = at_limits;
      const test::HeapGuard guard;
      for (int k = 0; k < 20; ++k) {
        (void)robot.measure(measured);
        (void)controller.advance(measured, {{Mat3::Identity(), loop.at + Vec3(0, 0.01, 0)}}, {}, v);
        (void)robot.move(v, period);
      }
      EXPECT_EQ(guard.uses(), 0);
    }
}

TEST(SimulatedRobot, IsItsModelPlusNoise) {
  Loop loop;
  SimulatedRobot<3> robot(loop.system, loop.start, {}, {35e-6, 1e-3}, 5),
      again(loop.system, loop.start, {}, {35e-6, 1e-3}, 5);
  EXPECT_LT((robot.tip().position - loop.at).norm(), 1e-9);
  Measurement<3> a, b;
  double squares = 0;
  constexpr int count = 4000;
  for (int k = 0; k < count; ++k) {
    ASSERT_EQ(robot.measure(a), Status::ok);
    ASSERT_EQ(again.measure(b), Status::ok);
    EXPECT_EQ(a.reading.position, b.reading.position);
    squares += (a.reading.position - robot.exact_reading().position).squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(squares / (3 * count)), 35e-6, 1.5e-6);
}

}  // namespace controller_test
}  // namespace ctcr
