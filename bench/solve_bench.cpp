// Whole solves: from nothing, and one control cycle after another along a path.
#include <benchmark/benchmark.h>

#include <vector>

#include "support/cases.hpp"
#include "support/timing.hpp"

namespace {

using namespace bench;
using ctcr::Derivatives;
using ctcr::Status;

/// solve/3/cold: to ||b|| < 1e-10 from the straight robot, J and C included.
template <bool Loaded>
void cold(benchmark::State& state) {
  const ctcr::Robot<3> robot = table_ii();
  const ctcr::Model<3> model(robot);
  const auto configurations = random_configurations(robot, Loaded, n_configurations, 2);
  constexpr Derivatives wanted = Loaded ? Derivatives::compliance : Derivatives::jacobian;
  ctcr::Solution<3> solution;
  double iterations = 0, unconverged = 0;
  std::size_t i = 0;
  for (auto _ : state) {
    ctcr::Workspace<3> workspace;
    const Status status =
        ctcr::solve<wanted>(model, configurations[i].joints, configurations[i].load, workspace, solution, {});
    benchmark::DoNotOptimize(solution);
    unconverged += status != Status::ok;
    iterations += solution.iterations;
    i = i + 1 < configurations.size() ? i + 1 : 0;
  }
  if (unconverged > 2e-3 * double(state.iterations()))
    return state.SkipWithError("more than 2 in 1000 cold starts did not converge");
  state.counters["iterations"] = benchmark::Counter(iterations, benchmark::Counter::kAvgIterations);
}

/// Joints on a smooth path through random configurations, `cycle` 1 mm and 1 degree (at most, per joint) apart.
std::vector<Configuration> control_path(const ctcr::Robot<3>& robot, int cycles) {
  const auto corners = random_configurations(robot, true, 64, 3);
  std::vector<Configuration> path;
  for (std::size_t corner = 0; int(path.size()) < cycles; corner = (corner + 1) % (corners.size() - 1)) {
    const auto &from = corners[corner].joints, &to = corners[corner + 1].joints;
    const double millimetres = 1e3 * (to.beta - from.beta).cwiseAbs().maxCoeff();
    const double degrees = (to.alpha - from.alpha).cwiseAbs().maxCoeff() * 180.0 / std::numbers::pi;
    const int parts = int(std::max(millimetres, degrees)) + 1;
    for (int part = 0; part < parts && int(path.size()) < cycles; ++part) {
      const double t = double(part) / parts;
      path.push_back({{from.beta + t * (to.beta - from.beta), from.alpha + t * (to.alpha - from.alpha)},
                      {ctcr::Vec3(0.0, 0.1, 0.0), ctcr::Vec3::Zero()}});
    }
  }
  return path;
}

/// control/3/step: one evaluation with J and C per cycle from the predicted warm start; p50, p99 and worst in ns.
void control(benchmark::State& state) {
  const ctcr::Robot<3> robot = table_ii();
  const ctcr::Model<3> model(robot);
  const auto path = control_path(robot, 20000);
  std::vector<double> times;
  for (auto _ : state) {
    ctcr::Workspace<3> workspace;
    ctcr::Solution<3> solution;
    if (ctcr::solve<Derivatives::compliance>(model, path[0].joints, path[0].load, workspace, solution, {}) !=
        Status::ok)
      return state.SkipWithError("the path's start was not solved");
    for (const Configuration& c : path) {
      const double start = thread_cpu_time();
      const Status status = ctcr::step<Derivatives::compliance>(model, c.joints, c.load, workspace, solution, {});
      times.push_back(thread_cpu_time() - start);
      benchmark::DoNotOptimize(status);
    }
  }
  const double clock = [] {  // what reading the clock twice costs is not ours
    std::vector<double> idle;
    for (int i = 0; i < 1000; ++i) {
      const double start = thread_cpu_time();
      idle.push_back(thread_cpu_time() - start);
    }
    return quantile(idle, 0.5);
  }();
  state.counters["p50_ns"] = 1e9 * (quantile(times, 0.5) - clock);
  state.counters["p99_ns"] = 1e9 * (quantile(times, 0.99) - clock);
  state.counters["worst_ns"] = 1e9 * (quantile(times, 1.0) - clock);
}

const bool registered = [] {
  benchmark::RegisterBenchmark("solve/3/cold_unloaded_jacobian", cold<false>);
  benchmark::RegisterBenchmark("solve/3/cold_loaded_jacobian_compliance", cold<true>);
  benchmark::RegisterBenchmark("control/3/step", control);
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
