// Effects that follow a motion period by period are those of the recorded rows.
#include "ctcr/control/live_effects.hpp"

#include <gtest/gtest.h>

#include "ctcr/control/closed_loop.hpp"
#include "ctcr/control/polyline.hpp"
#include "ctcr/effects/backlash.hpp"
#include "ctcr/effects/delay.hpp"
#include "ctcr/effects/friction.hpp"
#include "ctcr/friction/frictionless_torsion.hpp"
#include "ctcr/friction/solve_friction.hpp"
#include "ctcr/simulation/simulated_robot.hpp"
#include "random_control.hpp"
#include "support/no_alloc.hpp"

namespace ctcr {
namespace live_effects_test {

using Path3 = EffectList<Friction, BacklashRotation, Delay>;

TEST(LiveEffects, RememberWhatRecordedRowsDo) {
  test::Random random(41);
  Path3::On<3> effects;
  std::get<0>(effects.list).values = {0.03, 0.02, 0.05, 0.008, 0.3, 0.4};
  std::get<1>(effects.list).values = {0.01, 0.02, 0.015};
  std::get<2>(effects.list).values = {0.06};
  const System<3, Path3> system{{1, 1, Vec3::Zero(), Vec3::Zero()}, Model<3, Path3>(test::paper_robot(), effects), {}};
  std::vector<RecordedRow<3>> rows;
  Joints<3> q{{-0.3, -0.2, -0.1}, Vec3::Zero()};
  for (int k = 0; k < 200; ++k) {
    for (int i = 0; i < 3; ++i) {
      q.beta[i] += test::uniform(random, -1e-3, 1e-3);
      q.alpha[i] += test::uniform(random, -0.05, 0.05);
    }
    rows.push_back({{q.beta, q.alpha}, {}, {.time = 0.025 * k}});
  }
  rows.front().radius = ContactRadii<3>(system.model.robot());
  const auto recorded = histories(system, std::span<const RecordedRow<3>>(rows));
  LiveEffects<3, Path3> live(system.model);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    (void)live.advance({rows[k].theta.translation, rows[k].theta.rotation}, rows[k].at.time);
    const auto check = [&]<std::size_t I>(std::integral_constant<std::size_t, I>) {
      const auto& now = std::get<I>(live.effects().list).history.state;
      const auto& then = std::get<I>(recorded[k]).state;
      for (std::size_t i = 0; i < now.size(); ++i)
        EXPECT_NEAR(now[i], then[i], 1e-12) << "effect " << I << " row " << k;
    };
    check(std::integral_constant<std::size_t, 0>{});
    check(std::integral_constant<std::size_t, 1>{});
    check(std::integral_constant<std::size_t, 2>{});
  }
}

using Rubbing = EffectList<Friction>;

/// Friction whose feedback by the torsion is so strong that the torsion of the period before would change sides each period.
System<3, Rubbing> rubbing_robot(double coefficient = 0.02) {
  Rubbing::On<3> effects;
  std::get<0>(effects.list).values = {coefficient, coefficient, coefficient, 0, 0.1, 1, 0};
  return {{2e-3 / (2 * std::numbers::pi), -1, {-0.298, -0.2205, -0.145}, Vec3::Zero()},
          Model<3, Rubbing>(test::paper_robot(), effects),
          {}};
}

TEST(LiveEffects, WindTubesUpAsRecordedRowsDo) {
  const System<3, Rubbing> system = rubbing_robot();
  test::Random random(42);
  std::vector<RecordedRow<3>> rows;
  Joints<3> q{{-0.298, -0.2205, -0.145}, Vec3::Zero()};
  for (int k = 0; k < 200; ++k) {
    for (int i = 0; i < 3; ++i) {
      q.beta[i] += test::uniform(random, -1e-4, 1e-4);
      q.alpha[i] += test::uniform(random, -0.03, 0.05);
    }
    rows.push_back({motor_angles(system.transmission, q), {}, {.time = 0.025 * k}});
  }
  set_frictionless_torsion<3>({system.transmission, Model<3>(system.model.robot()), {}, system.settings}, rows);
  ThreadPool pool(1);
  EXPECT_GT(solve_friction(system, std::span(rows), pool), 0.05);
  const auto recorded = histories(system, std::span<const RecordedRow<3>>(rows));
  LiveEffects<3, Rubbing> live(system.model);
  Workspace<3> ws;
  Solution<3> solution;
  Model<3, Rubbing> model = system.model;
  const auto equilibrium = [&](const auto& effects, const Joints<3>& tubes) {
    model = Model<3, Rubbing>(system.model.robot(), effects);
    const bool has = solve<Derivatives::none>(model, tubes, {}, ws, solution, system.settings) == Status::ok;
    return has ? &model : nullptr;
  };
  for (std::size_t k = 0; k < rows.size(); ++k) {
    (void)live.advance(joints(system.transmission, rows[k].theta), rows[k].at.time, ws, equilibrium);
    const auto& now = std::get<0>(live.effects().list).history.state;
    for (std::size_t i = 0; i < now.size(); ++i)
      EXPECT_NEAR(now[i], std::get<0>(recorded[k]).state[i], 5e-3) << "row " << k;
  }
}

/// Friction, backlash and delay after joints that the model refuses are those without them.
TEST(LiveEffects, RefusedJointsLeaveNoTrace) {
  System<3, Path3> system = {{2e-3 / (2 * std::numbers::pi), -1, {-0.298, -0.2205, -0.145}, Vec3::Zero()},
                             Model<3, Path3>(test::paper_robot()),
                             {}};
  Path3::On<3> effects;
  std::get<0>(effects.list).values = {0.02, 0.02, 0.02, 0.005, 0.1, 1, 0};
  std::get<1>(effects.list).values = {0.01, 0.02, 0.015};
  std::get<2>(effects.list).values = {0.06};
  system.model = Model<3, Path3>(test::paper_robot(), effects);
  const Joints<3> home{{-0.298, -0.2205, -0.145}, {0.2, 0.9, -1.4}};
  const auto motors = [&](int k) {
    const double s = std::sin(0.1 * k);
    return motor_angles(system.transmission, Joints<3>{home.beta + 1e-3 * Vec3(s, -s, s), home.alpha + Vec3(s, s, -s)});
  };
  for (const double bad : {std::nan(""), HUGE_VAL, 1e9, -1e9})
    for (const bool turns : {false, true}) {
      Controller<3, PaperTasks, Path3> controller(system, {}, 0.025), other = controller;
      MotorAngles<3> v, w;
      const Reference reference{{Mat3::Identity(), {0.01, 0, 0.15}}};
      for (int k = 0; k < 90; ++k) {
        const Measurement<3> good{motors(k), {Mat3::Identity(), {0.01, 0, 0.15}}};
        if (k % 40 == 5) {
          Measurement<3> wrong = good;
          (turns ? wrong.theta.rotation : wrong.theta.translation)[1] += bad;
          EXPECT_NE(controller.advance(wrong, reference, {}, v).status, Status::ok);
          EXPECT_EQ(v.translation.norm() + v.rotation.norm(), 0);
        }
        ASSERT_EQ(controller.advance(good, reference, {}, v).status, Status::ok) << "period " << k;
        ASSERT_EQ(other.advance(good, reference, {}, w).status, Status::ok);
      }
      // Solved from another start, and delayed by times that differ by two periods.
      EXPECT_LT((controller.solution().position - other.solution().position).norm(), 1e-6);
    }
}

TEST(LiveEffects, KnownFrictionInClosedLoop) {
  constexpr double period = 0.025;
  const System<3, Rubbing> real = rubbing_robot();
  const MotorAngles<3> start = motor_angles(real.transmission, Joints<3>{{-0.298, -0.2205, -0.145}, {0.2, 0.9, -1.4}});
  double mean[2];
  for (const bool known : {false, true}) {
    SimulatedRobot<3, Rubbing> robot(real, start, {});
    Controller<3, PaperTasks, Rubbing> controller(known ? real : rubbing_robot(0), {}, period);
    const Vec3 at = robot.tip().position, side(8e-3, 0, 0), up(0, 0, 8e-3);
    const Polyline path(std::vector<Vec3>{at, at + side, at, at + up, at}, 10e-3, 60e-3);
    double sum = 0, last = 0, largest_jump = 0;
    long count = 0;
    const test::HeapGuard guard;
    const Status status = run(controller, robot, path, period, {}, [&](const auto& row) {
      const double error = (robot.tip().position - row.reference.pose.position).norm();
      if (count > 0) largest_jump = std::max(largest_jump, std::abs(error - last));
      sum += last = error;
      ++count;
      return true;
    });
    EXPECT_EQ(guard.uses(), 0);
    EXPECT_EQ(status, Status::ok);
    EXPECT_LT(largest_jump, 0.25e-3) << "a robot that moves by 0.25 mm a period does not leap";
    mean[known] = sum / double(count);
  }
  EXPECT_LT(mean[true], mean[false]);
  EXPECT_LT(mean[true], 0.1e-3);
}

/// Readings that are two periods old, beside motor angles of now.
struct Late {
  SimulatedRobot<3, Rubbing>& robot;
  std::array<Pose, 3> readings{};
  int count = 0;

  Status measure(Measurement<3>& out) noexcept {
    const Status status = robot.measure(out);
    std::copy_backward(readings.begin(), readings.end() - 1, readings.end());
    readings[0] = out.reading;
    if (count++ == 0) readings.fill(out.reading);
    out.reading = readings[2];
    return status;
  }
  Status move(const MotorAngles<3>& velocity, double by) noexcept { return robot.move(velocity, by); }
};

TEST(LiveEffects, TheModelMakesUpForLateReadings) {
  constexpr double period = 0.025;
  const System<3, Rubbing> real = rubbing_robot();
  const MotorAngles<3> start = motor_angles(real.transmission, Joints<3>{{-0.298, -0.2205, -0.145}, {0.2, 0.9, -1.4}});
  double mean[2];
  for (const bool told : {false, true}) {
    SimulatedRobot<3, Rubbing> robot(real, start, {});
    Late late{robot};
    Controller<3, PaperTasks, Rubbing> controller(real, {}, period);
    controller.tasks.get<Tracking>().gain = 12;
    controller.reading_age = told ? 2 * period : 0;
    const Vec3 at = robot.tip().position;
    const Polyline path(std::vector<Vec3>{at, at + Vec3(8e-3, 0, 0), at}, 10e-3, 60e-3);
    double sum = 0;
    long count = 0;
    const Status status = run(controller, late, path, period, {}, [&](const auto& row) {
      sum += (robot.tip().position - row.reference.pose.position).norm();
      ++count;
      return true;
    });
    EXPECT_EQ(status, Status::ok);
    mean[told] = sum / double(count);
  }
  EXPECT_LT(mean[true], 0.3 * mean[false]);
}

}  // namespace live_effects_test
}  // namespace ctcr
