// The catalogue of effects. Use ctcr.effects, which converts.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <ctcr/effects/catalogue.hpp>
#include <ctcr/effects/metal.hpp>

#include "any_recording.hpp"
#include "with_tubes.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {
namespace {

std::vector<CatalogueEntry> catalogue() {
  std::vector<CatalogueEntry> out;
  Catalogue::On<1>{}.for_each([&](const auto& effect, int) {
    const EffectInfo& i = effect.info;
    out.push_back({std::string(i.id), std::string(i.title), std::string(i.physics), std::string(i.signature),
                   std::string(i.measure), std::string(i.look_alikes), std::string(i.reference), i.needs.order,
                   i.needs.time, i.needs.orientation, i.needs.loads, i.needs.gravity});
  });
  return out;
}

RowMajor beside_metal(const RowMajor& places, const Eigen::Vector3d& metal) {
  RowMajor off(places.rows(), 6);
  for (Eigen::Index i = 0; i < places.rows(); ++i) {
    const auto at =
        ctcr::beside_metal<double>({places(i, 0), places(i, 1), places(i, 2)}, {metal[0], metal[1], metal[2]}, 1.0);
    off.row(i) << at.shift[0], at.shift[1], at.shift[2], at.turn[0], at.turn[1], at.turn[2];
  }
  return off;
}

}  // namespace

void bind_effects(nb::module_& m) {
  nb::class_<CatalogueEntry>(m, "CatalogueEntry", "An effect in words.")
      .def_ro("id", &CatalogueEntry::id)
      .def_ro("title", &CatalogueEntry::title)
      .def_ro("physics", &CatalogueEntry::physics)
      .def_ro("signature", &CatalogueEntry::signature)
      .def_ro("measure", &CatalogueEntry::measure)
      .def_ro("look_alikes", &CatalogueEntry::look_alikes)
      .def_ro("reference", &CatalogueEntry::reference)
      .def_ro("order", &CatalogueEntry::order)
      .def_ro("time", &CatalogueEntry::time)
      .def_ro("orientation", &CatalogueEntry::orientation)
      .def_ro("loads", &CatalogueEntry::loads)
      .def_ro("gravity", &CatalogueEntry::gravity);
  nb::class_<CatalogueParameter>(m, "CatalogueParameter", "A parameter of an effect.")
      .def_ro("effect", &CatalogueParameter::effect)
      .def_ro("name", &CatalogueParameter::name)
      .def_ro("unit", &CatalogueParameter::unit)
      .def_ro("meaning", &CatalogueParameter::meaning)
      .def_ro("neutral", &CatalogueParameter::neutral)
      .def_ro("sigma", &CatalogueParameter::sigma)
      .def_ro("soft_low", &CatalogueParameter::soft_low)
      .def_ro("soft_high", &CatalogueParameter::soft_high)
      .def_ro("hard_low", &CatalogueParameter::hard_low)
      .def_ro("hard_high", &CatalogueParameter::hard_high)
      .def_ro("per_tube", &CatalogueParameter::per_tube)
      .def_ro("kind", &CatalogueParameter::kind)
      .def_ro("first", &CatalogueParameter::first);
  m.def("effect_catalogue", &catalogue, "All effects in words.");
  m.def(
      "effect_parameters",
      [](int tubes) { return with_tubes(tubes, [](auto n) { return catalogue_parameters<n>(); }); }, "tubes"_a,
      "Parameters of all effects; `first` is the place of a parameter's value among those of the catalogue.");
  m.def("beside_metal", &beside_metal, "places"_a, "metal"_a,
        "(M, 6) position [m] and rotation vector [rad] by which readings at places (M, 3) [m] are off for each m^3 of "
        "metal "
        "at a place (3,) [m]; tracker frame.");
}

}  // namespace ctcr::python
