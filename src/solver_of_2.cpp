// The solver for robots of 2 tubes without effects: see ctcr/mechanics/solver_instances.hpp.
#include "ctcr/mechanics/solver_instances.hpp"

namespace ctcr {
CTCR_SOLVER(template, 2)
}  // namespace ctcr
