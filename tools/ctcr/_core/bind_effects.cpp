// The catalogue of effects. Use ctcr.effects, which converts.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <ctcr/effects/catalogue.hpp>
#include <ctcr/effects/metal_distortion.hpp>
#include <iterator>
#include <map>
#include <span>

#include "any_recording.hpp"
#include "with_tubes.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {
namespace {

template <class Effect>
std::vector<std::string> acts_on_of() {
  constexpr ActsOn on = acts_on<Effect, double, 1>;
  std::vector<std::string> out;
  if (on.joints) out.emplace_back("joints");
  if (on.rod) out.emplace_back("rod");
  if (on.tip) out.emplace_back("tip");
  if (on.reading) out.emplace_back("reading");
  return out;
}

/// Names of the parameters of each variant; those of all amplitudes where an effect has no variants.
std::vector<std::vector<std::string>> variants_of(const EffectInfo& info, std::span<const EffectParameter> parameters) {
  std::vector<std::vector<std::string>> out;
  for (const Variant& variant : info.variants) {
    if (variant.first.empty()) continue;
    const auto first = std::ranges::find(parameters, variant.first, &EffectParameter::name);
    const auto last = std::ranges::find(first, parameters.end(), variant.last, &EffectParameter::name);
    std::ranges::transform(first, std::next(last), std::back_inserter(out.emplace_back()),
                           [](const EffectParameter& p) { return std::string(p.name); });
  }
  if (!out.empty()) return out;
  out.emplace_back();
  for (const EffectParameter& p : parameters)
    if (p.role == Role::amplitude) out.back().emplace_back(p.name);
  return out;
}

std::vector<std::map<std::string, double>> starts_of(const EffectInfo& info) {
  std::vector<std::map<std::string, double>> out;
  for (const auto& start : info.starts) {
    if (start[0].parameter.empty()) continue;
    auto& values = out.emplace_back();
    for (const StartValue& one : start)
      if (!one.parameter.empty()) values.emplace(one.parameter, one.value);
  }
  return out;
}

std::vector<CatalogueEntry> catalogue() {
  std::vector<CatalogueEntry> out;
  Catalogue::On<1>{}.for_each([&]<class Effect>(const Effect& effect, int) {
    const EffectInfo& i = effect.info;
    out.push_back({std::string(i.id), std::string(i.title), std::string(i.physics), std::string(i.signature),
                   std::string(i.measure), std::string(i.look_alikes), std::string(i.reference), i.needs.order,
                   i.needs.time, i.needs.orientation, i.needs.loads, i.needs.gravity, i.form_error,
                   acts_on_of<Effect>(), variants_of(i, effect.parameters), starts_of(i)});
  });
  return out;
}

RowMajor metal_distortion(const RowMajor& positions, const Eigen::Vector3d& metal) {
  RowMajor off(positions.rows(), 6);
  for (Eigen::Index i = 0; i < positions.rows(); ++i) {
    const auto at = ctcr::metal_distortion<double>({positions(i, 0), positions(i, 1), positions(i, 2)},
                                                   {metal[0], metal[1], metal[2]}, 1.0);
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
      .def_ro("gravity", &CatalogueEntry::gravity)
      .def_ro("form_error", &CatalogueEntry::form_error, "Part of its signal by which its form errs.")
      .def_ro("acts_on", &CatalogueEntry::acts_on, "Of joints, rod, tip, reading: where its hooks act.")
      .def_ro("variants", &CatalogueEntry::variants,
              "Names of the parameters of each way in which it may act; at least one.")
      .def_ro("starts", &CatalogueEntry::starts,
              "Values by name of details, shapes and choices from which a fit must start as well.");
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
      .def_ro("kind", &CatalogueParameter::kind, "amplitude, detail, shape or choice.")
      .def_ro("quantity", &CatalogueParameter::quantity,
              "other, tip_force, lag, moment, surface, source, screw_pitch or gear_ratio; see effects/effect.hpp.")
      .def_ro("first", &CatalogueParameter::first);
  m.def("effect_catalogue", &catalogue, "All effects in words.");
  m.def(
      "effect_parameters",
      [](int tubes) { return with_tubes(tubes, [](auto n) { return catalogue_parameters<n>(); }); }, "tubes"_a,
      "Parameters of all effects; `first` is the index of a parameter's value among those of the catalogue.");
  m.def("metal_distortion", &metal_distortion, "positions"_a, "metal"_a,
        "(M, 6) error of readings [m], [rad] at positions (M, 3) [m], for each m^3 of metal at the position (3,) [m]; "
        "tracker frame.");
}

}  // namespace ctcr::python
