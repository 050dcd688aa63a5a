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

namespace ctcr {
namespace test {
/// Settings::accuracy with which solves integrate in the steps they are told to: for laws of the discrete map.
inline constexpr double as_told = std::numeric_limits<double>::infinity();
}  // namespace test

CTCR_SOLVER_WITH(extern template, compliance, 5)
CTCR_TEST_DIRECT(extern template, none, 2)
CTCR_TEST_DIRECT(extern template, jacobian, 2)
CTCR_TEST_DIRECT(extern template, compliance, 2)
CTCR_TEST_DIRECT(extern template, none, 3)
CTCR_TEST_DIRECT(extern template, jacobian, 3)
CTCR_TEST_DIRECT(extern template, compliance, 3)
CTCR_TEST_PARAMETERS(extern template, all, 1)
CTCR_TEST_PARAMETERS(extern template, all, 2)
CTCR_TEST_PARAMETERS(extern template, all, 3)
}  // namespace ctcr
