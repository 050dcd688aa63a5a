#pragma once
// The solver of the standard model, compiled once for all files of this module: its instances are long to compile.
// Those declared here stand in solver_of_N.cpp.
#include <ctcr/ctcr.hpp>
#include <ctcr/derivatives/parameters.hpp>

#define CTCR_SOLVE(kind, function, D, N)                                                                               \
  kind Status function<Derivatives::D, MagnusRk4, N>(const Model<N>&, const Joints<N>&, const TipLoad&, Workspace<N>&, \
                                                     Solution<N>&, const Settings&) noexcept;
#define CTCR_EVALUATION(kind, D, N)                                                      \
  kind void evaluate<Derivatives::D, Loading::weight, MagnusRk4, N>(                     \
      const Coefficients<N>&, const Joints<N>&, const TipLoad&, const TipGuess<N>&, int, \
      Evaluation<N, Loading::weight, Derivatives::D>&) noexcept;
#define CTCR_SOLVER_OF(kind, N)                                                                                     \
  CTCR_EVALUATION(kind, none, N)                                                                                    \
  CTCR_EVALUATION(kind, jacobian, N)                                                                                \
  CTCR_EVALUATION(kind, compliance, N)                                                                              \
  CTCR_SOLVE(kind, solve, none, N)                                                                                  \
  CTCR_SOLVE(kind, solve, jacobian, N)                                                                              \
  CTCR_SOLVE(kind, solve, compliance, N)                                                                            \
  CTCR_SOLVE(kind, step, jacobian, N)                                                                               \
  CTCR_SOLVE(kind, step, compliance, N)                                                                             \
  kind Status differentiate_tip<MagnusRk4, N>(const Model<N>&, const Workspace<N>&, int, TipDerivatives<N>&,        \
                                              const Settings&) noexcept;                                            \
  kind Status differentiate_tip<MagnusRk4, N>(const Model<N>&, const Workspace<N>&, int, TipDerivatives<N>&, Mat6&, \
                                              const Settings&) noexcept;

namespace ctcr {
CTCR_SOLVER_OF(extern template, 1)
CTCR_SOLVER_OF(extern template, 2)
CTCR_SOLVER_OF(extern template, 3)
CTCR_SOLVER_OF(extern template, 4)
}  // namespace ctcr
