// The solver for robots of 1 tube without effects: see ctcr/mechanics/solver_instances.hpp.
#include "ctcr/mechanics/solver_instances.hpp"

namespace ctcr {
CTCR_SOLVER(template, 1)
}  // namespace ctcr
