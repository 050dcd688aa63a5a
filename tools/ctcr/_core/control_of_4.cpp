#include "control_of.hpp"

template ctcr::python::LoopResult ctcr::python::closed_loop<4>(const LoopRequest&);
template ctcr::python::SensitivityResult ctcr::python::sensitivity<4>(const SensitivityRequest&);
