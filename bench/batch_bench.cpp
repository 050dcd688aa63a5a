// Cold configurations in bulk, as calibration and workspace studies ask for them: rate per core, tips only and with
// derivatives, and on all cores.
#include <benchmark/benchmark.h>

#include <vector>

#include "ctcr/parallel/batch.hpp"
#include "support/configurations.hpp"

namespace {

using ctcr::Derivatives;

template <Derivatives D>
void batch(benchmark::State& state, bool loaded, int threads) {
  const ctcr::Robot<3> robot = bench::table_ii();
  const ctcr::Model<3> model(robot);
  const auto configurations = bench::random_configurations(robot, loaded, 4096);
  ctcr::ThreadPool pool(threads);
  std::vector<ctcr::Vec3> tips(configurations.size());
  std::vector<ctcr::Status> status(configurations.size());
  for (auto _ : state) {
    ctcr::solve_batch<D>(
        model, std::ptrdiff_t(configurations.size()),
        [&](std::ptrdiff_t i) {
          const auto& [joints, load] = configurations[std::size_t(i)];
          return ctcr::Configuration<3>{joints, load};
        },
        [&](std::ptrdiff_t i, const ctcr::Solution<3>& solution) {
          tips[std::size_t(i)] = solution.position;
          status[std::size_t(i)] = solution.status;
          benchmark::DoNotOptimize(solution.jacobian);
        },
        pool);
  }
  const auto failed = std::count_if(status.begin(), status.end(), [](auto s) { return s != ctcr::Status::ok; });
  if (failed > 0) return state.SkipWithError("a configuration was not solved");
  const double done = double(state.iterations()) * double(configurations.size());
  state.counters["configurations/s"] = benchmark::Counter(done, benchmark::Counter::kIsRate);
}

const bool registered = [] {
  using enum Derivatives;
  const auto add = [](const char* name, auto function, bool loaded, int threads) {
    auto* b = benchmark::RegisterBenchmark(name, function, loaded, threads);
    b->Unit(benchmark::kMillisecond);
    if (threads != 1) b->UseRealTime();
  };
  add("batch/3/unloaded_tips_per_core", batch<none>, false, 1);
  add("batch/3/unloaded_jacobian_per_core", batch<jacobian>, false, 1);
  add("batch/3/loaded_tips_per_core", batch<none>, true, 1);
  add("batch/3/loaded_jacobian_compliance_per_core", batch<compliance>, true, 1);
  add("batch/3/loaded_tips_all_cores", batch<none>, true, 0);
  add("batch/3/loaded_jacobian_compliance_all_cores", batch<compliance>, true, 0);
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
