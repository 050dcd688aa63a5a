// Runs one case of the step benchmark PASSES times over all configurations, for callgrind (count_instructions.py).
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include "ctcr/effects/catalogue.hpp"
#include "support/cases.hpp"

#if defined(__GNUC__) && defined(__x86_64__)
// Valgrind (3.19) does not know the shorter of two encodings of vmovq between registers; this asks for the other.
asm(".macro vmovq operands:vararg\n {load} vmovq \\operands\n.endm");
#endif

namespace {

using namespace bench;

/// The paper's Newton step: residual, B_u, and with them J and C.
template <class Case>
bool run_newton(int passes) {
  constexpr auto loading = Case::loaded ? ctcr::Loading::force : ctcr::Loading::none;
  const auto& solved = Solved<Case::loaded>::instance();
  ctcr::Evaluation<3, loading, Case::derivatives> evaluation;
  bool good = solved.all_solved;
  for (int pass = 0; pass < passes; ++pass)
    for (std::size_t i = 0; i < solved.configurations.size(); ++i) {
      const Configuration& c = solved.configurations[i];
      ctcr::evaluate<Case::derivatives, loading, ctcr::MagnusRk4>(solved.model.coefficients(), c.joints, c.load,
                                                                  solved.workspaces[i].guess,
                                                                  solved.workspaces[i].steps, evaluation);
      good = good && evaluation.residual < 1e-9;
    }
  return good;
}

/// Every effect of the catalogue at work: each parameter one standard deviation from neutral, history included.
ctcr::Catalogue::On<3> all_effects() {
  ctcr::Catalogue::On<3> effects;
  effects.for_each([](auto& effect, int) {
    for (int k = 0; k < int(effect.parameters.size()); ++k)
      for (int i = 0; i < effect.size(k); ++i)
        effect.values[std::size_t(effect.index(k, i))] += effect.parameters[std::size_t(k)].sigma;
  });
  std::get<ctcr::Friction<3>>(effects.list).history.state = {0.8, -0.6, 0.4};
  return effects;
}

/// The Newton step of the robot with all of them.
bool run_effects(int passes) {
  constexpr auto all = ctcr::Derivatives::compliance;
  const auto configurations = random_configurations(table_ii(), true, n_configurations);
  const ctcr::Model<3, ctcr::Catalogue> model(table_ii(), all_effects());
  std::vector<ctcr::Workspace<3>> workspaces(n_configurations);
  ctcr::Solution<3> solution;
  for (std::size_t i = 0; i < n_configurations; ++i)
    (void)ctcr::solve(model, configurations[i].joints, configurations[i].load, workspaces[i], solution, {});
  ctcr::Evaluation<3, ctcr::Loading::weight, all> evaluation;
  int converged = 0;
  for (int pass = 0; pass < passes; ++pass)
    for (std::size_t i = 0; i < n_configurations; ++i) {
      const Configuration& c = configurations[i];
      ctcr::evaluate<all, ctcr::Loading::weight, ctcr::MagnusRk4>(model.coefficients(), c.joints, c.load,
                                                                  workspaces[i].guess, workspaces[i].steps, evaluation);
      converged += evaluation.residual < 1e-9;
    }
  return converged >= passes * n_configurations * 97 / 100;
}

/// The whole control step around it: checks, prediction, outputs.
template <class Case>
bool run_step(int passes) {
  const auto& solved = Solved<Case::loaded>::instance();
  auto workspaces = solved.workspaces;
  ctcr::Solution<3> solution;
  bool good = solved.all_solved;
  for (int pass = 0; pass < passes; ++pass)
    for (std::size_t i = 0; i < solved.configurations.size(); ++i) {
      const Configuration& c = solved.configurations[i];
      const auto status = ctcr::step<Case::derivatives>(solved.model, c.joints, c.load, workspaces[i], solution, {});
      good = good && status == ctcr::Status::ok;
    }
  return good;
}

template <class Case>
bool run_rival(int passes) {
  const auto& solved = RivalSolved<Case::loaded>::instance();
  typename RivalSolved<Case::loaded>::Rival::Solution solution;
  bool good = solved.agrees();
  for (int pass = 0; pass < passes; ++pass)
    for (std::size_t i = 0; i < solved.configurations.size(); ++i) {
      const Configuration& c = solved.configurations[i];
      auto unknowns = solved.unknowns[i];
      solved.rival.template step<Case::rival_outputs>(c.joints, c.load, unknowns, solution);
      good = good && solution.residual < 1e-9;
    }
  return good;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::strcmp(argv[1], "--about") == 0) {
#if defined(__AVX2__) && defined(__FMA__)
    std::puts("g++ " __VERSION__ ", AVX2");
#else
    std::puts("g++ " __VERSION__ ", no AVX2");
#endif
    return 0;
  }
  if (argc != 3) return std::fputs("usage: count_driver --about | CASE PASSES\n", stderr), 2;
  const int passes = std::atoi(argv[2]);
  bool found = false, good = false;
  for_each_case([&](auto row) {
    using Case = decltype(row);
    if (argv[1] == std::string(Case::name)) found = true, good = run_newton<Case>(passes);
    if (argv[1] == "step/" + std::string(Case::name)) found = true, good = run_step<Case>(passes);
    if (argv[1] == "rival/" + std::string(Case::name)) found = true, good = run_rival<Case>(passes);
  });
  if (argv[1] == std::string("effects")) found = true, good = run_effects(passes);
  if (!found) return std::fputs("no such case\n", stderr), 2;
  if (!good) return std::fputs("a step went wrong\n", stderr), 1;
  return 0;
}
