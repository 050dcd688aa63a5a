#include "control_of.hpp"

template ctcr::python::LoopResult ctcr::python::closed_loop<2>(const LoopRequest&);
template ctcr::python::SensitivityResult ctcr::python::sensitivity<2>(const SensitivityRequest&);
