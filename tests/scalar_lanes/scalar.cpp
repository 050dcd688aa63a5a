#define CTCR_SCALAR_LANES
// The solvers that the tests share are those of the vector form.
#undef CTCR_SOLVER_3
// Another name for the namespace keeps the two builds of each inline function apart.
#define ctcr ctcr_scalar

#include "scalar.hpp"

#include "ctcr/ctcr.hpp"
#include "support/random_robots.hpp"

namespace ctcr {
#include "model_to_numbers.hpp"
}  // namespace ctcr

void ctcr_scalar_build::solve_paper_robot(const double (&joints)[6], const double (&load)[6],
                                          const double (&gravity)[3], bool with_compliance,
                                          double (&result)[result_size]) {
  static_assert(!__is_same(ctcr::Lanes, double __attribute__((vector_size(32)))));
  ctcr::solve_to_numbers(joints, load, gravity, with_compliance, result);
}
