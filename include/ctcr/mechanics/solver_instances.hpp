#pragma once
// The solver for robots without effects, compiled once in a program: its instantiations take a compiler most of the time.
//
// The CMake target ctcr::solver_3 adds src/solver_of_3.cpp to a program, and defines CTCR_SOLVER_3, by which solve.hpp
// declares here what that file holds; the same for 1, 2 and 4 tubes. Without CMake, compile that file with the flags of the
// program and define CTCR_SOLVER_3 for all of it.
#include "ctcr/mechanics/solve.hpp"

#define CTCR_EVALUATION(kind, D, L, Stepper, N)                                                                        \
  kind void evaluate<Derivatives::D, Loading::L, Stepper, N>(const Coefficients<N>&, const Joints<N>&, const TipLoad&, \
                                                             const TipGuess<N>&, const Steps<N>&,                      \
                                                             Evaluation<N, Loading::L, Derivatives::D>&) noexcept;
#define CTCR_LOADED_EVALUATIONS(kind, D, Stepper, N) \
  CTCR_EVALUATION(kind, D, force, Stepper, N)        \
  CTCR_EVALUATION(kind, D, weight, Stepper, N)
#define CTCR_EVALUATIONS_none(kind, Stepper, N) \
  CTCR_EVALUATION(kind, none, none, Stepper, N) \
  CTCR_LOADED_EVALUATIONS(kind, none, Stepper, N)
#define CTCR_EVALUATIONS_jacobian(kind, Stepper, N) \
  CTCR_EVALUATION(kind, jacobian, none, Stepper, N) \
  CTCR_LOADED_EVALUATIONS(kind, jacobian, Stepper, N)
#define CTCR_EVALUATIONS_compliance(kind, Stepper, N) CTCR_LOADED_EVALUATIONS(kind, compliance, Stepper, N)

/// solve() and step() with D, and all evaluations below them; `kind` is template or extern template.
#define CTCR_SOLVER_WITH(kind, D, N)                                                                                \
  kind Status solve<Derivatives::D, MagnusRk4, N>(const Model<N>&, const Joints<N>&, const TipLoad&, Workspace<N>&, \
                                                  Solution<N>&, const Settings&) noexcept;                          \
  kind Status step<Derivatives::D, MagnusRk4, N>(const Model<N>&, const Joints<N>&, const TipLoad&, Workspace<N>&,  \
                                                 Solution<N>&, const Settings&) noexcept;                           \
  CTCR_EVALUATIONS_##D(kind, MagnusRk4, N)
#define CTCR_SOLVER(kind, N) \
  CTCR_SOLVER_WITH(kind, none, N) CTCR_SOLVER_WITH(kind, jacobian, N) CTCR_SOLVER_WITH(kind, compliance, N)

namespace ctcr {
#ifdef CTCR_SOLVER_1
CTCR_SOLVER(extern template, 1)
#endif
#ifdef CTCR_SOLVER_2
CTCR_SOLVER(extern template, 2)
#endif
#ifdef CTCR_SOLVER_3
CTCR_SOLVER(extern template, 3)
#endif
#ifdef CTCR_SOLVER_4
CTCR_SOLVER(extern template, 4)
#endif
}  // namespace ctcr
