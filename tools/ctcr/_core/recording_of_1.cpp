#include "recording_of.hpp"

CTCR_RECORDING_OF(1)
