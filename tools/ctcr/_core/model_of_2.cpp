#include "model_of.hpp"

template std::unique_ptr<ctcr::python::AnyModel> ctcr::python::make_model<2>(std::span<const Tube>, const Vec3&);
