#include "control_of.hpp"

template ctcr::python::LoopResult ctcr::python::closed_loop<3>(const LoopRequest&);
template ctcr::python::SensitivityResult ctcr::python::sensitivity<3>(const SensitivityRequest&);
