// One Newton step with what the paper's Table I computes, ours (step/3/..) and the rival (rival/3/..) in one binary.
#include <benchmark/benchmark.h>

#include <string>

#include "support/cases.hpp"

namespace {

using namespace bench;

template <class Case>
void ours(benchmark::State& state) {
  const auto& solved = Solved<Case::loaded>::instance();
  if (!solved.all_solved) return state.SkipWithError("a configuration was not solved");
  if (!derivatives_are_right<Case>()) return state.SkipWithError("J or C is wrong");
  auto workspaces = solved.workspaces;
  ctcr::Solution<3> solution;
  double worst = 0;
  std::size_t i = 0;
  for (auto _ : state) {
    const Configuration& c = solved.configurations[i];
    const ctcr::Status status =
        ctcr::step<Case::derivatives>(solved.model, c.joints, c.load, workspaces[i], solution, {});
    benchmark::DoNotOptimize(solution);
    const double error = (solution.position - solved.solutions[i].position).norm();
    if (status != ctcr::Status::ok || !(error < 1e-8)) return state.SkipWithError("a step went wrong");
    worst = std::max(worst, solution.residual);
    i = i + 1 < solved.configurations.size() ? i + 1 : 0;
  }
  state.counters["steps/s"] = benchmark::Counter(double(state.iterations()), benchmark::Counter::kIsRate);
  state.counters["worst_residual"] = worst;
}

template <class Case, template <int, bool> class Equations>
void rivals(benchmark::State& state) {
  const auto& solved = RivalSolved<Case::loaded>::instance();
  if (!solved.agrees()) return state.SkipWithError("rival and model disagree");
  using Rival = rival::Rival<3, Case::loaded, Equations>;
  const Rival rival(table_ii());
  typename Rival::Solution solution;
  double worst = 0;
  std::size_t i = 0;
  for (auto _ : state) {
    const Configuration& c = solved.configurations[i];
    auto unknowns = solved.unknowns[i];
    rival.template step<Case::rival_outputs>(c.joints, c.load, unknowns, solution);
    benchmark::DoNotOptimize(solution);
    if (!(solution.residual < 1e-9)) return state.SkipWithError("a step went wrong");
    worst = std::max(worst, solution.residual);
    i = i + 1 < solved.configurations.size() ? i + 1 : 0;
  }
  state.counters["steps/s"] = benchmark::Counter(double(state.iterations()), benchmark::Counter::kIsRate);
  state.counters["worst_residual"] = worst;
  state.counters["ivps"] = Rival::ivps(Case::rival_outputs);
}

const bool registered = [] {
  for_each_case([](auto row) {
    using Case = decltype(row);
    const std::string name = Case::name;
    benchmark::RegisterBenchmark(("step/3/" + name).c_str(), ours<Case>);
    benchmark::RegisterBenchmark(("rival/3/" + name).c_str(), rivals<Case, rival::MatrixForm>);
    benchmark::RegisterBenchmark(("rival_by_hand/3/" + name).c_str(), rivals<Case, rival::ScalarForm>);
  });
  return true;
}();

}  // namespace

BENCHMARK_MAIN();
