#include "control_of.hpp"

template ctcr::python::LoopResult ctcr::python::closed_loop<1>(const LoopRequest&);
template ctcr::python::SensitivityResult ctcr::python::sensitivity<1>(const SensitivityRequest&);
