#include "solver_of.hpp"

namespace ctcr {
CTCR_SOLVER_OF(template, 2)
}  // namespace ctcr
