// The solver for robots of 4 tubes without effects: see ctcr/mechanics/solver_instances.hpp.
#include "ctcr/mechanics/solver_instances.hpp"

namespace ctcr {
CTCR_SOLVER(template, 4)
}  // namespace ctcr
