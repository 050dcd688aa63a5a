// The catalogue of effects, and recordings of robots that have some. Use ctcr.effects and ctcr.recording, which convert
// and name.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <ctcr/effects/catalogue.hpp>
#include <tuple>

#include "any_recording.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {
namespace {

/// Calls f with N as a constant. @throws std::invalid_argument for other numbers of tubes
template <class F>
auto with_tubes(Eigen::Index tubes, const F& f) {
  switch (tubes) {
    case 1: return f(std::integral_constant<int, 1>{});
    case 2: return f(std::integral_constant<int, 2>{});
    case 3: return f(std::integral_constant<int, 3>{});
    case 4: return f(std::integral_constant<int, 4>{});
  }
  throw std::invalid_argument("a robot has 1 to 4 tubes");
}

class BoundRecording : public BoundReadings {
public:
  using BoundReadings::BoundReadings;
  [[nodiscard]] const AnyRecording& recording() const { return static_cast<const AnyRecording&>(**this); }
};

std::unique_ptr<AnyRecording> make_any_recording(const RecordedTable& table) {
  const Eigen::Index rows = table.beta.rows(), tubes = table.beta.cols();
  return with_tubes(tubes, [&](auto n) {
    const auto places = Eigen::Index(system_parameter_names<n>().size());
    const bool fits = table.alpha.rows() == rows && table.alpha.cols() == tubes && table.force.rows() == rows &&
                      table.force.cols() == 3 && table.position.rows() == rows && table.position.cols() == 3 &&
                      table.quaternion.rows() == rows && table.quaternion.cols() == 4 && table.time.size() == rows &&
                      table.part.size() == rows && table.run.size() == rows &&
                      table.parameters.size() + table.effects.size() == places && table.sensor_tube >= 0 &&
                      table.sensor_tube < tubes && table.steps >= 1 &&
                      (table.profiles.size() == 0 || table.profiles.cols() == 3 * tubes);
    bool known = true;
    for (const int place : table.free) known = known && place >= 0 && place < places;
    if (!fits || !known) throw std::invalid_argument("the arrays of a recording do not fit together");
    return make_recording<n>(table);
  });
}

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
      .def_ro("shape", &CatalogueParameter::shape)
      .def_ro("first", &CatalogueParameter::first);
  m.def("effect_catalogue", &catalogue, "All effects in words.");
  m.def(
      "effect_parameters",
      [](int tubes) { return with_tubes(tubes, [](auto n) { return catalogue_parameters<n>(); }); }, "tubes"_a,
      "Parameters of all effects; `first` is the place of a parameter's value among those of the catalogue.");
  m.def(
      "system_parameter_names",
      [](int tubes) { return with_tubes(tubes, [](auto n) { return system_parameter_names<n>(); }); }, "tubes"_a,
      "Names of all parameters of a robot and of the catalogue of effects.");

  nb::class_<BoundRecording, BoundReadings>(m, "Recording", "As Readings, with effects and the path behind each row.")
      .def(
          "__init__",
          [](BoundRecording* self, const Eigen::VectorXd& parameters, const Eigen::VectorXd& effects, int sensor_tube,
             const RowMajor& beta, const RowMajor& alpha, const RowMajor& force, const RowMajor& position,
             const RowMajor& quaternion, const Eigen::VectorXd& time, const Eigen::VectorXd& part,
             const Eigen::VectorXi& run, const Eigen::Vector3d& centre, const std::vector<int>& free, int steps,
             int threads, const std::optional<RowMajor>& profiles) {
            RecordedTable table{
                {parameters, sensor_tube, beta, alpha, force, position, quaternion, free, steps, threads},
                effects,
                time,
                run,
                centre,
                part,
                profiles.value_or(RowMajor())};
            new (self) BoundRecording(make_any_recording(table));
          },
          nb::kw_only(), "parameters"_a, "effects"_a, "sensor_tube"_a, "beta"_a, "alpha"_a, "force"_a, "position"_a,
          "quaternion"_a, "time"_a, "part"_a, "run"_a, "centre"_a, "free"_a, "steps"_a = 2, "threads"_a = 0,
          "profiles"_a.none() = nb::none())
      .def(
          "predicted",
          [](const BoundRecording& self) {
            RowMajor position, quaternion;
            self.recording().predicted(position, quaternion);
            return std::tuple(std::move(position), std::move(quaternion));
          },
          "T_tracker_sensor of all rows at the last call: position (rows, 3) [m], quaternion (rows, 4) w first.");
}

}  // namespace ctcr::python
