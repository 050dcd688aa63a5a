// Recordings, with or without effects. Use ctcr.recording, which converts and names.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <tuple>

#include "any_recording.hpp"
#include "with_tubes.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {

namespace {

std::shared_ptr<AnyRecording> new_recording(Eigen::VectorXd parameters, Eigen::VectorXd effects, int sensor_tube,
                                            RowMajor beta, RowMajor alpha, RowMajor force, RowMajor position,
                                            RowMajor quaternion, Eigen::VectorXd time, Eigen::VectorXd part,
                                            Eigen::VectorXi run, const Eigen::Vector3d& centre, std::vector<int> free,
                                            int steps, int threads, bool from_home, std::optional<RowMajor> profiles) {
  const Table table{std::move(parameters),
                    std::move(effects),
                    sensor_tube,
                    std::move(beta),
                    std::move(alpha),
                    std::move(force),
                    std::move(position),
                    std::move(quaternion),
                    std::move(time),
                    std::move(part),
                    std::move(run),
                    centre,
                    std::move(free),
                    steps,
                    threads,
                    from_home,
                    std::move(profiles).value_or(RowMajor())};
  return with_tubes(table.beta.cols(), [&](auto n) { return make_recording<n>(table); });
}

auto residual(AnyRecording& self, const Eigen::VectorXd& x, bool derivatives) {
  if (x.size() != self.nominal().size()) throw std::invalid_argument("x needs one value a free parameter");
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
  const nb::gil_scoped_release released;
  const bool solved = self(x, residual, derivatives ? &jacobian : nullptr);
  return std::tuple(std::move(residual), std::move(jacobian), solved);
}

auto predicted(const AnyRecording& self) {
  RowMajor position, quaternion;
  self.predicted(position, quaternion);
  return std::tuple(std::move(position), std::move(quaternion));
}

}  // namespace

void bind_recording(nb::module_& m) {
  nb::class_<ParameterInfo>(m, "ParameterInfo", "A named parameter of a robot.")
      .def_ro("name", &ParameterInfo::name, "Such as tubes.2.length.")
      .def_ro("kind", &ParameterInfo::kind, "Such as tubes.#.length: # for the number of a tube, * for an axis.")
      .def_ro("unit", &ParameterInfo::unit, "SI; empty: a pure number.")
      .def_ro("index", &ParameterInfo::index, "Of its tube or axis, from 0.")
      .def_ro("lowest", &ParameterInfo::lowest, "Possible value, SI.")
      .def_ro("highest", &ParameterInfo::highest, "Possible value, SI.");
  m.def(
      "robot_parameters", [](int tubes) { return with_tubes(tubes, [](auto n) { return robot_parameters<n>(); }); },
      "tubes"_a, "All parameters of a robot, in the order of vectors of parameters.");

  nb::class_<AnyRecording>(m, "Recording", "Residuals of a recording as functions of chosen parameters.")
      .def(nb::new_(&new_recording), nb::kw_only(), "parameters"_a, "effects"_a, "sensor_tube"_a, "beta"_a, "alpha"_a,
           "force"_a, "position"_a, "quaternion"_a, "time"_a, "part"_a, "run"_a, "centre"_a, "free"_a, "steps"_a,
           "threads"_a = 0, "from_home"_a = true, "profiles"_a.none() = nb::none())
      .def("nominal", &AnyRecording::nominal, "Values of the free parameters.")
      .def("activate", &AnyRecording::activate, "rows"_a, "Rows to solve from now on, one flag a row.")
      .def("solve_friction", &AnyRecording::solve_friction, "x"_a,
           "Solves friction along the recording at x; returns the largest change of a relative torsion angle [rad].")
      .def_prop_ro("friction_is_solved", &AnyRecording::friction_is_solved, "Whether friction was solved.")
      .def("begin_at", &AnyRecording::begin_at, "other"_a,
           "Takes over the equilibria and the friction of another recording of the same table.")
      .def("unsolved", &AnyRecording::unsolved, "Rows that could not be solved at the last call.")
      .def("residual", &residual, "x"_a, "derivatives"_a = false,
           "(residual (6 rows,), jacobian (6 rows, n) or empty, whether all rows were solved); releases the GIL")
      .def("predicted", &predicted,
           "T_tracker_sensor of all rows at the last call: position (rows, 3) [m], quaternion (rows, 4) w first.");
}

}  // namespace ctcr::python
