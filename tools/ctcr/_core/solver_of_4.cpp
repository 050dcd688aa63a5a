#include "solver_of.hpp"

namespace ctcr {
CTCR_SOLVER_OF(template, 4)
}  // namespace ctcr
