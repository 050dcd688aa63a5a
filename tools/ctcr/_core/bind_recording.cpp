// Recordings, with or without effects. Use ctcr.recording, which converts and names.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <tuple>

#include "any_recording.hpp"
#include "with_tubes.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {

void bind_recording(nb::module_& m) {
  m.def(
      "parameter_names",
      [](int tubes) {
        const ParameterNames p = with_tubes(tubes, [](auto n) { return parameter_names<n>(); });
        return std::pair(p.names, p.units);
      },
      "tubes"_a, "Names and units of all parameters of a robot.");

  nb::class_<BoundRecording>(m, "Recording", "Residuals of a recording as functions of chosen parameters.")
      .def(
          "__init__",
          [](BoundRecording* self, const Eigen::VectorXd& parameters, const Eigen::VectorXd& effects, int sensor_tube,
             const RowMajor& beta, const RowMajor& alpha, const RowMajor& force, const RowMajor& position,
             const RowMajor& quaternion, const Eigen::VectorXd& time, const Eigen::VectorXd& part,
             const Eigen::VectorXi& run, const Eigen::Vector3d& centre, const std::vector<int>& free, int steps,
             int threads, bool from_home, const std::optional<RowMajor>& profiles) {
            const Table table{parameters,
                              effects,
                              sensor_tube,
                              beta,
                              alpha,
                              force,
                              position,
                              quaternion,
                              time,
                              part,
                              run,
                              centre,
                              free,
                              steps,
                              threads,
                              from_home,
                              profiles.value_or(RowMajor())};
            new (self) BoundRecording(with_tubes(beta.cols(), [&](auto n) { return make_recording<n>(table); }));
          },
          nb::kw_only(), "parameters"_a, "effects"_a, "sensor_tube"_a, "beta"_a, "alpha"_a, "force"_a, "position"_a,
          "quaternion"_a, "time"_a, "part"_a, "run"_a, "centre"_a, "free"_a, "steps"_a, "threads"_a = 0,
          "from_home"_a = true, "profiles"_a.none() = nb::none())
      .def(
          "nominal", [](const BoundRecording& self) { return (*self).nominal(); }, "Values of the free parameters.")
      .def(
          "activate",
          [](const BoundRecording& self, const std::vector<bool>& rows) {
            if (rows.size() != (*self).active().size()) throw std::invalid_argument("activate needs one flag a row");
            (*self).activate(rows);
          },
          "rows"_a, "Rows to solve from now on.")
      .def(
          "wind_up", [](const BoundRecording& self, const Eigen::VectorXd& x) { return (*self).wind_up(x); }, "x"_a,
          "Lets tubes that rub wind each other up as they do at x; returns the largest change of a twist [rad].")
      .def_prop_ro(
          "is_wound", [](const BoundRecording& self) { return (*self).is_wound(); },
          "Whether tubes have wound each other up.")
      .def(
          "begin_at", [](const BoundRecording& self, const BoundRecording& other) { (*self).begin_at(*other); },
          "other"_a, "Takes over how another recording of the same table is wound up.")
      .def("active", [](const BoundRecording& self) { return (*self).active(); })
      .def(
          "unsolved", [](const BoundRecording& self) { return (*self).unsolved(); },
          "Rows that could not be solved at the last call.")
      .def(
          "residual",
          [](const BoundRecording& self, const Eigen::VectorXd& x, bool derivatives) {
            if (x.size() != (*self).nominal().size()) throw std::invalid_argument("x needs one value a free parameter");
            Eigen::VectorXd residual;
            Eigen::MatrixXd jacobian;
            bool solved;
            {
              const nb::gil_scoped_release released;
              solved = (*self)(x, residual, derivatives ? &jacobian : nullptr);
            }
            return std::tuple(std::move(residual), std::move(jacobian), solved);
          },
          "x"_a, "derivatives"_a = false,
          "(residual (6 rows,), jacobian (6 rows, n) or empty, whether all rows were solved)")
      .def(
          "predicted",
          [](const BoundRecording& self) {
            RowMajor position, quaternion;
            (*self).predicted(position, quaternion);
            return std::tuple(std::move(position), std::move(quaternion));
          },
          "T_tracker_sensor of all rows at the last call: position (rows, 3) [m], quaternion (rows, 4) w first.");
}

}  // namespace ctcr::python
