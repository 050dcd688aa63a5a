#include "readings_of.hpp"

CTCR_READINGS_OF(2)
