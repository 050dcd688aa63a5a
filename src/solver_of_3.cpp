// The solver for robots of 3 tubes without effects: see ctcr/mechanics/solver_instances.hpp.
#include "ctcr/mechanics/solver_instances.hpp"

namespace ctcr {
CTCR_SOLVER(template, 3)
}  // namespace ctcr
