// One whole control step: model with J, tasks, least squares, limits; p50, p99 and worst, and the jitter between them.
#include <benchmark/benchmark.h>

#include <ctcr/control/closed_loop.hpp>
#include <ctcr/control/polyline.hpp>
#include <ctcr/effects/friction.hpp>
#include <ctcr/simulation/simulated_robot.hpp>
#include <vector>

#include "support/configurations.hpp"
#include "support/timing.hpp"

namespace {

using namespace bench;
using ctcr::Status, ctcr::TipForce, ctcr::Vec3;

using Rubbing = ctcr::EffectList<ctcr::Friction>;

Rubbing::On<3> rubbing() {
  Rubbing::On<3> effects;
  std::get<0>(effects.list).values = {0.02, 0.02, 0.02, 0, 0.1, 1, 0};
  return effects;
}

/// control_step/3: the paper's scenario on the simulated robot; only Controller::advance() is timed. With friction the tubes
/// wind each other up, which takes several equilibria a period, and the controller looks one period ahead.
template <TipForce Knowledge, class Fx = ctcr::Standard>
void control_step(benchmark::State& state, const typename Fx::template On<3>& effects = {}) {
  constexpr double period = 0.025;
  const ctcr::System<3, Fx> system{{}, ctcr::Model<3, Fx>(table_ii(), effects), {}};
  const ctcr::Joints<3> start{{-0.298, -0.2205, -0.145}, {0.2, 0.9, -1.4}};
  const ctcr::TipLoad load{{0, -0.15, 0}, Vec3::Zero()};
  std::vector<double> times;
  for (auto _ : state) {
    ctcr::Controller<3, ctcr::PaperTasks, Fx> controller(system, {}, period);
    controller.tip_force = Knowledge;
    controller.at_limits = ctcr::AtLimits::redistribute;
    ctcr::SimulatedRobot<3, Fx> robot(system, motor_angles(system.transmission, start), load, {35e-6, 0});
    const Vec3 tip = robot.tip().position;
    controller.tasks.template get<ctcr::ObstacleAvoidance>().obstacle = {tip + Vec3(0, 0.02, 0), 5e-3};
    const ctcr::Polyline path(
        std::vector<Vec3>{tip, tip + Vec3(0.02, 0, 0), tip + Vec3(0.02, 0.02, 0), tip + Vec3(0.02, 0.02, -0.02), tip},
        5e-3, 2.5e-3);
    ctcr::Measurement<3> measured;
    ctcr::MotorAngles<3> velocity;
    for (double t = 0; t < path.duration(); t += period) {
      if (robot.measure(measured) != Status::ok) return state.SkipWithError("the simulated robot was not solved");
      const ctcr::Reference reference = path.at(t);
      const double before = thread_cpu_time();
      const auto report = controller.advance(measured, reference, load, velocity);
      times.push_back(thread_cpu_time() - before);
      if (report.status != Status::ok) return state.SkipWithError("a control step failed");
      if (robot.move(velocity, period) != Status::ok) return state.SkipWithError("the robot left its range");
    }
    if ((robot.tip().position - tip).norm() > 1e-3) return state.SkipWithError("the path was not followed");
  }
  state.counters["p50_ns"] = 1e9 * quantile(times, 0.5);
  state.counters["p99_ns"] = 1e9 * quantile(times, 0.99);
  state.counters["worst_ns"] = 1e9 * quantile(times, 1.0);
  state.counters["jitter_ns"] = 1e9 * (quantile(times, 0.99) - quantile(times, 0.5));
  state.counters["of_a_period_p99"] = quantile(times, 0.99) / period;
}

const bool registered = [] {
  const auto add = [](const char* name, auto step) { benchmark::RegisterBenchmark(name, step); };
  add("control_step/3/unknown_force", [](auto& state) { control_step<TipForce::unknown>(state); });
  add("control_step/3/known_force", [](auto& state) { control_step<TipForce::known>(state); });
  add("control_step/3/estimated_force", [](auto& state) { control_step<TipForce::estimated>(state); });
  add("control_step/3/friction", [](auto& state) { control_step<TipForce::known, Rubbing>(state, rubbing()); });
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
