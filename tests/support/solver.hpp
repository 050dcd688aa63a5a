#pragma once
// The solver, compiled once for all tests: its instantiations are long, the tests of its laws are short.
// Link ctcr_test_solver (solver.cmake), which holds what is declared here.
#include <limits>

#include "ctcr/ctcr.hpp"
#include "ctcr/derivatives/parameters.hpp"
#include "ctcr/mechanics/solver_instances.hpp"

#define CTCR_TEST_DIRECT(kind, D, N) CTCR_EVALUATIONS_##D(kind, DirectMagnusRk4, N)
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

CTCR_SOLVER_WITH(extern template, compliance, 5)
CTCR_TEST_DECLARE(DIRECT, 2)
CTCR_TEST_DECLARE(DIRECT, 3)
CTCR_TEST_PARAMETERS(extern template, all, 1)
CTCR_TEST_PARAMETERS(extern template, all, 2)
CTCR_TEST_PARAMETERS(extern template, all, 3)
}  // namespace ctcr
