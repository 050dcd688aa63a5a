#pragma once
// The solver, compiled once for all tests: its instantiations are long, the tests of its laws are short.
// Link ctcr_test_solver (solver.cmake), which holds what is declared here.
#include <limits>

#include "ctcr/ctcr.hpp"
#include "ctcr/derivatives/parameters.hpp"

#define CTCR_TEST_EVALUATION(kind, D, L, Stepper, N)                                                                   \
  kind void evaluate<Derivatives::D, Loading::L, Stepper, N>(const Coefficients<N>&, const Joints<N>&, const TipLoad&, \
                                                             const TipGuess<N>&, const Steps<N>&,                      \
                                                             Evaluation<N, Loading::L, Derivatives::D>&) noexcept;
#define CTCR_TEST_LOADED_EVALUATIONS(kind, D, Stepper, N) \
  CTCR_TEST_EVALUATION(kind, D, force, Stepper, N)        \
  CTCR_TEST_EVALUATION(kind, D, weight, Stepper, N)
#define CTCR_TEST_EVALUATIONS_none(kind, Stepper, N) \
  CTCR_TEST_EVALUATION(kind, none, none, Stepper, N) \
  CTCR_TEST_LOADED_EVALUATIONS(kind, none, Stepper, N)
#define CTCR_TEST_EVALUATIONS_jacobian(kind, Stepper, N) \
  CTCR_TEST_EVALUATION(kind, jacobian, none, Stepper, N) \
  CTCR_TEST_LOADED_EVALUATIONS(kind, jacobian, Stepper, N)
#define CTCR_TEST_EVALUATIONS_compliance(kind, Stepper, N) CTCR_TEST_LOADED_EVALUATIONS(kind, compliance, Stepper, N)

#define CTCR_TEST_SOLVER(kind, D, N)                                                                                \
  kind Status solve<Derivatives::D, MagnusRk4, N>(const Model<N>&, const Joints<N>&, const TipLoad&, Workspace<N>&, \
                                                  Solution<N>&, const Settings&) noexcept;                          \
  kind Status step<Derivatives::D, MagnusRk4, N>(const Model<N>&, const Joints<N>&, const TipLoad&, Workspace<N>&,  \
                                                 Solution<N>&, const Settings&) noexcept;                           \
  CTCR_TEST_EVALUATIONS_##D(kind, MagnusRk4, N)
#define CTCR_TEST_DIRECT(kind, D, N) CTCR_TEST_EVALUATIONS_##D(kind, DirectMagnusRk4, N)
#define CTCR_TEST_PARAMETERS(kind, D, N)                                                                               \
  kind Status differentiate_tip<MagnusRk4, N>(const Model<N>&, const Workspace<N>&, int, TipDerivatives<N>&) noexcept; \
  kind Status differentiate_tip<MagnusRk4, N>(const Model<N>&, const Workspace<N>&, int, TipDerivatives<N>&,           \
                                              Mat6&) noexcept;

#define CTCR_TEST_DECLARE(KIND, N)                                                          \
  CTCR_TEST_##KIND(extern template, none, N) CTCR_TEST_##KIND(extern template, jacobian, N) \
      CTCR_TEST_##KIND(extern template, compliance, N)

namespace ctcr {
namespace test {
/// Settings::accuracy with which solves integrate in the steps they are told to: for laws of the discrete map.
inline constexpr double as_told = std::numeric_limits<double>::infinity();
}  // namespace test

CTCR_TEST_DECLARE(SOLVER, 1)
CTCR_TEST_DECLARE(SOLVER, 2)
CTCR_TEST_DECLARE(SOLVER, 3)
CTCR_TEST_DECLARE(SOLVER, 4)
CTCR_TEST_SOLVER(extern template, compliance, 5)
CTCR_TEST_DECLARE(DIRECT, 2)
CTCR_TEST_DECLARE(DIRECT, 3)
CTCR_TEST_PARAMETERS(extern template, all, 1)
CTCR_TEST_PARAMETERS(extern template, all, 2)
CTCR_TEST_PARAMETERS(extern template, all, 3)
}  // namespace ctcr
