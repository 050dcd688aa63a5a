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

std::array<Mat3, 5> no_rotations() {
  const Vec3 mirror(1, 1, -1);
  return {Mat3::Constant(std::nan("")), Mat3::Zero(), mirror.asDiagonal(), 2 * Mat3::Identity(),
          Eigen::Quaterniond(1, 0.5, 0, 0).toRotationMatrix()};
}

/// Whether orientation is tracked or not: what is not a rotation tells that the rest is wrong, too.
TEST(Controller, RefusesRotationsThatAreNone) {
  for (const double weight : {0.0, 1e5}) {
    Loop loop;
    Controller<3> controller(loop.system, {}, period);
    controller.tip_force = TipForce::estimated;
    controller.tasks.get<Tracking>().weight.rotation = weight;
    SimulatedRobot<3> robot(loop.system, loop.start, {.force = {0, -0.1, 0}});
    Measurement<3> good;
    ASSERT_EQ(robot.measure(good), Status::ok);
    for (const Mat3& none : no_rotations()) {
      Measurement<3> bad = good;
      bad.reading.rotation = none;
      Reference nowhere;
      nowhere.pose.rotation = none;
      for (const auto& [measured, reference] : {std::pair{bad, Reference{}}, {good, nowhere}}) {
        MotorAngles<3> v{Vec3::Ones(), Vec3::Ones()};
        const test::HeapGuard guard;
        const Status status = controller.advance(measured, reference, {}, v).status;
        EXPECT_EQ(guard.uses(), 0);
        EXPECT_EQ(status, Status::not_finite);
        EXPECT_EQ(v.translation.norm() + v.rotation.norm(), 0);
      }
    }
    EXPECT_EQ(controller.estimate.force.norm(), 0) << "what is refused leaves no trace";
    MotorAngles<3> v;
    EXPECT_EQ(controller.advance(good, {robot.tip()}, {}, v).status, Status::ok);
  }
}

TEST(Controller, SettingsThatMeanNothingAreRefused) {
  Loop loop;
  const Measurement<3> measured{loop.start, {Mat3::Identity(), loop.at}};
  const auto expect_refused = [&](const Limits<3>& limits, double of) {
    Controller<3> controller(loop.system, limits, of);
    MotorAngles<3> v{Vec3::Ones(), Vec3::Ones()};
    EXPECT_EQ(controller.check_start(loop.start), Status::invalid_settings);
    EXPECT_EQ(controller.advance(measured, {}, {}, v).status, Status::invalid_settings);
    EXPECT_EQ(v.translation.norm() + v.rotation.norm(), 0);
  };
  for (const double bad : {std::nan(""), -1.0}) {
    expect_refused({.translation_speed = bad}, period);
    expect_refused({.rotation_speed = bad}, period);
    expect_refused({.base_gap = bad}, period);
    expect_refused({}, bad);
  }
  expect_refused({.beta_low = Vec3(-1, std::nan(""), -1)}, period);
  expect_refused({.beta_high = Vec3(std::nan(""), 0, 0)}, period);
  expect_refused({}, 0);
  expect_refused({}, HUGE_VAL);
  expect_refused({.base_gap = 0.2}, period);  // allows no joints at all
  expect_refused({.beta_low = Vec3(-0.1, -1, -1), .beta_high = Vec3(-0.2, 0, 0)}, period);
  for (double Transmission<3>::* const ratio :
       {&Transmission<3>::translation_ratio, &Transmission<3>::rotation_ratio}) {
    const Transmission<3> good = loop.system.transmission;
    loop.system.transmission.*ratio = 0;
    expect_refused({}, period);
    loop.system.transmission = good;
  }
  const PoseSensor good = loop.system.sensor;
  for (const int tube : {-1, 1, 3}) {
    loop.system.sensor.tube = tube;
    expect_refused({}, period);
  }
  for (Pose PoseSensor::* const frame : {&PoseSensor::T_tracker_base, &PoseSensor::T_tip_sensor}) {
    for (const Mat3& none : no_rotations()) {
      loop.system.sensor = good;
      (loop.system.sensor.*frame).rotation = none;
      expect_refused({}, period);
    }
    loop.system.sensor = good;
    (loop.system.sensor.*frame).position[2] = std::nan("");
    expect_refused({}, period);
  }
}

TEST(Controller, ARobotThatCannotExistIsRefusedAsSuch) {
  const Loop loop;
  Robot<3> robot = loop.system.model.robot();
  robot.tubes[0].length = 0;
  Controller<3> controller({loop.system.transmission, Model<3>(robot), loop.system.sensor}, {}, period);
  MotorAngles<3> v{Vec3::Ones(), Vec3::Ones()};
  EXPECT_EQ(controller.check_start(loop.start), Status::invalid_robot);
  EXPECT_EQ(controller.advance({loop.start, {}}, {}, {}, v).status, Status::invalid_robot);
  EXPECT_EQ(v.translation.norm() + v.rotation.norm(), 0);
}

/// NaN anywhere is not near a bifurcation, and no robot moves by it.
TEST(Controller, GoalsThatAreNoNumbersAreRefused) {
  Loop loop;
  const Measurement<3> measured{loop.start, {Mat3::Identity(), loop.at}};
  const double nan = std::nan("");
  const auto status = [&](const auto& change) {
    Controller<3, TaskList<Tracking, Damping, ObstacleAvoidance, StabilityMargin, Posture<3>>> controller(loop.system,
                                                                                                          {}, period);
    controller.tasks.template get<Posture<3>>() = {.weight = {1, 1}, .preferred = home};
    Reference reference{{Mat3::Identity(), loop.at}};
    change(controller, reference);
    MotorAngles<3> v;
    const auto report = controller.advance(measured, reference, {}, v);
    EXPECT_TRUE(v.translation.allFinite() && v.rotation.allFinite());
    if (report.status != Status::ok) {
      EXPECT_EQ(v.translation.norm() + v.rotation.norm(), 0);
    }
    return report.status;
  };
  EXPECT_EQ(status([](auto&, auto&) {}), Status::ok);
  EXPECT_EQ(status([&](auto&, auto& r) { r.pose.position[0] = nan; }), Status::not_finite);
  EXPECT_EQ(status([&](auto&, auto& r) { r.velocity[1] = nan; }), Status::not_finite);
  EXPECT_EQ(status([&](auto& c, auto&) { c.tasks.template get<Tracking>().gain = nan; }), Status::not_finite);
  EXPECT_EQ(status([&](auto& c, auto&) { c.tasks.template get<Tracking>().correction = nan; }), Status::not_finite);
  EXPECT_EQ(status([&](auto& c, auto&) { c.tasks.template get<ObstacleAvoidance>().obstacle.radius = nan; }),
            Status::not_finite);
  EXPECT_EQ(status([&](auto& c, auto&) { c.tasks.template get<Posture<3>>().preferred.beta[2] = nan; }),
            Status::not_finite);
  EXPECT_EQ(status([&](auto& c, auto&) { c.reading_age = nan; }), Status::not_finite);
  for (const auto& [bad, expected] : {std::pair{nan, Status::not_finite}, {-1.0, Status::invalid_settings}}) {
    const double weight = bad;
    EXPECT_EQ(status([&](auto& c, auto&) { c.tasks.template get<Tracking>().weight.translation = weight; }), expected);
    EXPECT_EQ(status([&](auto& c, auto&) { c.tasks.template get<Damping>().weight.rotation = weight; }), expected);
    EXPECT_EQ(status([&](auto& c, auto&) { c.tasks.template get<Posture<3>>().weight.translation = weight; }),
              expected);
  }
  ControlReport<PaperTasks> report;
  report.shortfall = {0.5, nan, 1, 2};
  EXPECT_EQ(report.gave_way(), 0b1010u) << "of a shortfall that is no number nobody knows that it is small";
}

/// Whatever is refused, the report holds numbers: a load that is none is not repeated in it.
TEST(Controller, ReportsNumbers) {
  Loop loop;
  const Measurement<3> measured{loop.start, {Mat3::Identity(), loop.at}};
  for (const TipLoad& load : {TipLoad{.force = {0, std::nan(""), 0}}, TipLoad{.force = {HUGE_VAL, 0, 0}}}) {
    Controller<3> controller(loop.system, {}, period);
    controller.tip_force = TipForce::known;
    MotorAngles<3> v;
    const auto report = controller.advance(measured, {}, load, v);
    EXPECT_EQ(report.status, Status::not_finite);
    EXPECT_TRUE(report.force.allFinite() && std::isfinite(report.stability));
  }
}

/// One reading that is missing or far off, whatever is made of the force: later periods are as if it had never been.
TEST(Controller, RecoversFromAWrongReading) {
  constexpr double missing = -3.697314e28;  // a tracker's value where it sees nothing
  for (const auto what : {TipForce::unknown, TipForce::estimated})
    for (const double off : {0.02, 0.1, 0.3, 1.0, 100.0, missing, std::nan("")}) {
      Loop loop;
      Controller<3> controller(loop.system, {}, period);
      controller.tip_force = what;
      controller.reading_age = 2 * period;
      const TipLoad load{.force = {0, -0.1, 0.02}};
      SimulatedRobot<3> robot(loop.system, loop.start, load);
      const Reference there{{Mat3::Identity(), robot.tip().position}};
      Measurement<3> measured;
      MotorAngles<3> v;
      for (int k = 0; k < 400; ++k) {
        ASSERT_EQ(robot.measure(measured), Status::ok);
        if (k == 200) measured.reading.position[1] += off;
        const Status status = controller.advance(measured, there, {}, v).status;
        EXPECT_TRUE(v.translation.allFinite() && v.rotation.allFinite());
        if (k != 200) {
          EXPECT_EQ(status, Status::ok) << "period " << k << " after a reading that was off by " << off;
        } else if (!(off < 1) || off == missing) {
          EXPECT_EQ(status, Status::not_finite);
        }
        ASSERT_EQ(robot.move(v, period), Status::ok);
      }
      EXPECT_LT((robot.tip().position - there.pose.position).norm(), 1e-5) << off;
      EXPECT_LT(controller.estimate.force.norm(), 0.2) << off;
    }
}

/// A force that the model cannot bear fades.
TEST(Controller, RecoversFromAWrongForce) {
  Loop loop;
  Controller<3> controller(loop.system, {}, period);
  controller.tip_force = TipForce::estimated;
  controller.estimate.force = {300, 0, -400};
  const Measurement<3> measured{loop.start, {Mat3::Identity(), loop.at}};
  MotorAngles<3> v;
  const Reference there{{Mat3::Identity(), loop.at}};
  EXPECT_NE(controller.advance(measured, there, {}, v).status, Status::ok);
  for (int k = 0; k < 20; ++k) (void)controller.advance(measured, there, {}, v);
  for (int k = 0; k < 200; ++k) EXPECT_EQ(controller.advance(measured, there, {}, v).status, Status::ok);
  EXPECT_LE(controller.estimate.force.norm(), controller.estimate.largest);
}

TEST(ForceEstimate, IsBoundedAndTakesNoOutliers) {
  test::Random random(51);
  ForceEstimate estimate{.largest = 2};
  for (int k = 0; k < 2000; ++k) {
    const Mat3 C = 0.1 * Mat3::NullaryExpr([&] { return test::uniform(random, -1, 1); });
    const double size = std::pow(10, test::uniform(random, -3, 40));
    const Vec3 before = estimate.force;
    estimate.update(C, size * test::random_vector(random, 1));
    EXPECT_LE(estimate.force.norm(), estimate.largest * (1 + 1e-12));
    EXPECT_LE((estimate.force - before).norm(), 2 * estimate.gain * estimate.largest * (1 + 1e-12));
    estimate.update(C, Vec3::Constant(std::nan("")));
    EXPECT_TRUE(estimate.force.allFinite());
  }
}

/// Settings that mean nothing are refused while the force is estimated, and leave it as it was.
TEST(ForceEstimate, SettingsThatMeanNothingAreRefused) {
  const double nan = std::nan("");
  const auto with = [](double ForceEstimate::* const setting, double value) {
    ForceEstimate estimate;
    estimate.*setting = value;
    return estimate;
  };
  std::vector<ForceEstimate> refused{
      with(&ForceEstimate::gain, 1.1), {.force = {0, nan, 0}}, {.force = {HUGE_VAL, 0, 0}}};
  for (double ForceEstimate::* const setting : {&ForceEstimate::gain, &ForceEstimate::softest, &ForceEstimate::largest})
    for (const double bad : {nan, -1.0, HUGE_VAL}) refused.push_back(with(setting, bad));
  Loop loop;
  const Measurement<3> measured{loop.start,
                                loop.system.sensor.T_tracker_base * Pose{Mat3::Identity(), loop.at + Vec3(0, 1e-4, 0)}};
  for (const ForceEstimate& estimate : refused) {
    EXPECT_EQ(estimate.check(), Status::invalid_settings);
    ForceEstimate alone = estimate;
    alone.update(0.1 * Mat3::Identity(), Vec3::Constant(1e-3));
    if (estimate.force.allFinite()) {
      EXPECT_EQ(alone.force, estimate.force);
    }
    Controller<3> controller(loop.system, {}, period);
    controller.estimate = estimate;
    MotorAngles<3> v{Vec3::Ones(), Vec3::Ones()};
    EXPECT_EQ(controller.advance(measured, {{Mat3::Identity(), loop.at}}, {}, v).status, Status::ok)
        << "it is not used";
    controller.tip_force = TipForce::estimated;
    EXPECT_EQ(controller.advance(measured, {{Mat3::Identity(), loop.at}}, {}, v).status, Status::invalid_settings);
    EXPECT_EQ(v.translation.norm() + v.rotation.norm(), 0);
    controller.estimate = {};
    EXPECT_EQ(controller.advance(measured, {{Mat3::Identity(), loop.at}}, {}, v).status, Status::ok);
  }
}

/// Equal tubes turned against each other, curved so much that they almost snap.
TEST(Controller, StandsStillBeforeASnap) {
  const auto robot_of = [](double curvature) {
    const Tube inner{.youngs_modulus = 60e9,
                     .inner_diameter = 1e-3,
                     .outer_diameter = 1.3e-3,
                     .length = 0.2,
                     .curved_length = 0.2,
                     .curvature = curvature};
    Tube outer = inner;
    outer.bending_stiffness = inner.EI();
    outer.inner_diameter = 1.4e-3, outer.outer_diameter = 1.6e-3;
    outer.length = outer.curved_length = 0.196;
    return Robot<2>{{inner, outer}};
  };
  const MotorAngles<2> start{{-0.004, -0.002}, {0, std::numbers::pi}};
  double curvature = 5;  // [1/m]
  Solution<2> s;
  for (; curvature < 15 && s.status != Status::singular; curvature += 2e-3) {
    Workspace<2> ws;
    (void)solve<Derivatives::jacobian>(Model<2>(robot_of(curvature)), {start.translation, start.rotation}, TipLoad{},
                                       ws, s);
  }
  curvature -= 2e-3;
  ASSERT_EQ(s.status, Status::singular);
  Controller<2> controller({{}, Model<2>(robot_of(curvature)), {}}, {.base_gap = 1e-3, .tip_gap = 1e-3}, period);
  MotorAngles<2> v;
  Reference moving{s.pose()};
  moving.velocity[0] = 5e-3;
  const auto report = controller.advance({start, s.pose()}, moving, {}, v);
  EXPECT_EQ(report.status, Status::singular);
  EXPECT_EQ(v.translation.norm() + v.rotation.norm(), 0);
  EXPECT_EQ(report.gave_way() & 1, 1u) << "tracking gave way";
}

TEST(Controller, ALoopWithoutAPeriodOrAPathDoesNotBegin) {
  Loop loop;
  Controller<3> controller(loop.system, {}, period);
  SimulatedRobot<3> robot(loop.system, loop.start, {});
  const auto status = [&](const auto& path, double of) {
    return run(controller, robot, path, of, {}, [](const auto&) { return false; });
  };
  const Polyline rest(std::vector<Vec3>{loop.at}, 1, 1), none({}, 1, 1);
  EXPECT_EQ(status(rest, period), Status::ok);
  EXPECT_EQ(status(none, period), Status::invalid_settings);
  for (const double bad : {0.0, -1.0, std::nan("")}) EXPECT_EQ(status(rest, bad), Status::invalid_settings);
}

TEST(Controller, LimitsThatExcludeTheStartAreRefused) {
  Loop loop;
  const Controller<3> wide(loop.system, {}, period), narrow(loop.system, {.base_gap = 0.09}, period);
  EXPECT_EQ(wide.check_start(loop.start), Status::ok);
  EXPECT_EQ(narrow.check_start(loop.start), Status::joints_out_of_order);
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

TEST(SimulatedRobot, RefusesASensorThatItCannotCarry) {
  Loop loop;
  for (const int tube : {-1, 3}) {
    loop.system.sensor.tube = tube;
    SimulatedRobot<3> robot(loop.system, loop.start, {});
    Measurement<3> measured;
    EXPECT_EQ(robot.measure(measured), Status::invalid_settings);
    EXPECT_TRUE(measured.reading.position.allFinite());
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
