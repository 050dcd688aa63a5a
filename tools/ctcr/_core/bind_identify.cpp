// Joint identification: tables of readings and fits of their parameters. Use ctcr.identify, which converts and names.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <ctcr/calibration/identify_readings.hpp>
#include <ctcr/calibration/row_report.hpp>
#include <tuple>

#include "any_readings.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {
namespace {

std::unique_ptr<AnyReadings> make_any_readings(const Table& table) {
  switch (table.beta.cols()) {
    case 1: return make_readings<1>(table);
    case 2: return make_readings<2>(table);
    case 3: return make_readings<3>(table);
    case 4: return make_readings<4>(table);
  }
  throw std::invalid_argument("a robot has 1 to 4 tubes");
}

ParameterNames any_parameter_names(int tubes) {
  switch (tubes) {
    case 1: return parameter_names<1>();
    case 2: return parameter_names<2>();
    case 3: return parameter_names<3>();
    case 4: return parameter_names<4>();
  }
  throw std::invalid_argument("a robot has 1 to 4 tubes");
}

/// @throws std::invalid_argument unless the arrays fit together
std::unique_ptr<AnyReadings> make_checked_readings(const Table& table) {
  const Eigen::Index rows = table.beta.rows();
  const auto places = Eigen::Index(any_parameter_names(int(table.beta.cols())).names.size());
  const bool fits = table.alpha.rows() == rows && table.alpha.cols() == table.beta.cols() &&
                    table.force.rows() == rows && table.force.cols() == 3 && table.position.rows() == rows &&
                    table.position.cols() == 3 && table.quaternion.rows() == rows && table.quaternion.cols() == 4 &&
                    table.parameters.size() == places && table.sensor_tube >= 0 &&
                    table.sensor_tube < table.beta.cols() && table.steps >= 1;
  bool known = true;
  for (const int place : table.free) known = known && place >= 0 && place < places;
  if (!fits || !known) throw std::invalid_argument("the arrays of a table of readings do not fit together");
  return make_any_readings(table);
}

/// A Python function x -> (residual, jacobian), or None where the prediction fails, as a Predictor.
Predictor predictor_of(nb::callable function) {
  return [function](const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
    const nb::gil_scoped_acquire locked;
    const nb::object answer = function(x, jacobian != nullptr);
    if (answer.is_none()) return false;
    const auto both = nb::cast<nb::tuple>(answer);
    residual = nb::cast<Eigen::VectorXd>(both[0]);
    if (jacobian) *jacobian = nb::cast<Eigen::MatrixXd>(both[1]);
    return true;
  };
}

std::vector<FreeParameter> free_parameters(const std::vector<std::string>& names, const Eigen::VectorXd& mean,
                                           const Eigen::VectorXd& sd, const Eigen::VectorXd& low,
                                           const Eigen::VectorXd& high) {
  const auto n = Eigen::Index(names.size());
  if (mean.size() != n || sd.size() != n || low.size() != n || high.size() != n)
    throw std::invalid_argument("every parameter needs a mean, a standard deviation and two bounds");
  std::vector<FreeParameter> parameters;
  for (Eigen::Index k = 0; k < n; ++k) parameters.push_back({names[std::size_t(k)], mean[k], sd[k], low[k], high[k]});
  return parameters;
}

using Known = std::vector<std::pair<std::string, Eigen::VectorXd>>;
using Within = std::vector<std::tuple<std::string, Eigen::VectorXd, double>>;

Identification identify_any(const nb::object& predict, const std::vector<std::string>& names,
                            const Eigen::VectorXd& mean, const Eigen::VectorXd& sd, const Eigen::VectorXd& low,
                            const Eigen::VectorXd& high, const Noise& noise, const Eigen::MatrixX3d& places,
                            bool robust, bool admit_model_error, const std::optional<Eigen::MatrixX2d>& weights,
                            const std::optional<Eigen::Vector2d>& inflation,
                            const std::optional<Eigen::VectorXd>& start, int starts, const Known& known,
                            const Within& within, std::vector<int>& excluded) {
  const std::vector<FreeParameter> parameters = free_parameters(names, mean, sd, low, high);
  IdentifyOptions options;
  options.robust = robust;
  options.admit_model_error = admit_model_error;
  options.weights = weights;
  if (inflation) options.inflation = inflation->array();
  options.start = start;
  options.starts = starts;
  for (const auto& [text, change] : known) {
    if (change.size() != mean.size()) throw std::invalid_argument("a known direction needs one number a parameter");
    options.known.push_back({text, change});
  }
  for (const auto& [text, change, least] : within) options.within.push_back({text, change, least});
  if (nb::isinstance<BoundReadings>(predict)) {
    AnyReadings& readings = **nb::cast<BoundReadings*>(predict);
    const nb::gil_scoped_release released;
    return identify_readings(readings, parameters, noise, places, options, excluded);
  }
  return identify(predictor_of(nb::cast<nb::callable>(predict)), parameters, noise, places, options);
}

RowReport report_any(const Identification& fit, const nb::object& predict) {
  if (nb::isinstance<BoundReadings>(predict)) {
    AnyReadings& readings = **nb::cast<BoundReadings*>(predict);
    const nb::gil_scoped_release released;
    return report_rows(fit, std::ref(readings));
  }
  return report_rows(fit, predictor_of(nb::cast<nb::callable>(predict)));
}

}  // namespace

void bind_identify(nb::module_& m) {
  m.def(
      "parameter_names",
      [](int tubes) {
        const ParameterNames p = any_parameter_names(tubes);
        return std::pair(p.names, p.units);
      },
      "tubes"_a, "Names and units of all parameters of a robot.");

  nb::class_<BoundReadings>(m, "Readings", "Residuals of a table as functions of chosen parameters.")
      .def(
          "__init__",
          [](BoundReadings* self, const Eigen::VectorXd& parameters, int sensor_tube, const RowMajor& beta,
             const RowMajor& alpha, const RowMajor& force, const RowMajor& position, const RowMajor& quaternion,
             const std::vector<int>& free, int steps, int threads) {
            new (self) BoundReadings(make_checked_readings(
                {parameters, sensor_tube, beta, alpha, force, position, quaternion, free, steps, threads}));
          },
          nb::kw_only(), "parameters"_a, "sensor_tube"_a, "beta"_a, "alpha"_a, "force"_a, "position"_a, "quaternion"_a,
          "free"_a, "steps"_a = 1, "threads"_a = 0)
      .def(
          "nominal", [](const BoundReadings& self) { return (*self).nominal(); }, "Values of the free parameters.")
      .def(
          "activate",
          [](const BoundReadings& self, const std::vector<bool>& rows) {
            if (rows.size() != (*self).active().size()) throw std::invalid_argument("activate needs one flag a row");
            (*self).activate(rows);
          },
          "rows"_a, "Rows to solve from now on.")
      .def("active", [](const BoundReadings& self) { return (*self).active(); })
      .def(
          "unsolved", [](const BoundReadings& self) { return (*self).unsolved(); },
          "Rows that could not be solved at the last call.")
      .def(
          "residual",
          [](const BoundReadings& self, const Eigen::VectorXd& x, bool derivatives) {
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
          "(residual (6 rows,), jacobian (6 rows, n) or empty, whether all rows were solved)");

  nb::class_<Noise>(m, "Noise", "Sd per axis of the jitter and of the smooth field error [m], [rad].")
      .def(
          "__init__",
          [](Noise* self, double position_jitter, double rotation_jitter, double position_field, double rotation_field,
             double correlation_length) {
            new (self) Noise{position_jitter, rotation_jitter, position_field, rotation_field, correlation_length};
          },
          nb::kw_only(), "position_jitter"_a, "rotation_jitter"_a, "position_field"_a = 0.0, "rotation_field"_a = 0.0,
          "correlation_length"_a = 0.1)
      .def_ro("position_jitter", &Noise::position_jitter)
      .def_ro("rotation_jitter", &Noise::rotation_jitter)
      .def_ro("position_field", &Noise::position_field)
      .def_ro("rotation_field", &Noise::rotation_field)
      .def_ro("correlation_length", &Noise::correlation_length);
  m.def("field_of_accuracy", &field_of_accuracy, "accuracy_95"_a, "jitter"_a);

  nb::class_<Correlation>(m, "Correlation")
      .def_ro("first", &Correlation::first)
      .def_ro("second", &Correlation::second)
      .def_ro("coefficient", &Correlation::coefficient);
  nb::class_<Direction>(m, "Direction", "A combination of parameters that the readings do not determine.")
      .def_ro("text", &Direction::text)
      .def_ro("ratio", &Direction::ratio, "Posterior / prior standard deviation along it.")
      .def_ro("coefficients", &Direction::coefficients, "Unit vector in prior standard deviations.");
  nb::class_<Start>(m, "Start")
      .def_ro("cost", &Start::cost)
      .def_ro("distance", &Start::distance)
      .def_ro("converged", &Start::converged);

  nb::class_<Identification>(m, "Identification", "A fit; arrays are copies.")
      .def_ro("converged", &Identification::converged)
      .def_ro("status", &Identification::status)
      .def_ro("warnings", &Identification::warnings)
      .def_ro("values", &Identification::values)
      .def_ro("sd", &Identification::sd)
      .def_ro("shift", &Identification::shift)
      .def_ro("ratio", &Identification::ratio)
      .def_ro("covariance", &Identification::covariance)
      .def_ro("correlations", &Identification::correlations)
      .def_ro("directions", &Identification::directions)
      .def_ro("chi_square", &Identification::chi_square)
      .def_ro("shift_square", &Identification::shift_square)
      .def_ro("observations", &Identification::observations)
      .def_ro("bulk_observations", &Identification::bulk_observations)
      .def_prop_ro("inflation", [](const Identification& self) { return Eigen::Vector2d(self.inflation); })
      .def_ro("effective_parameters", &Identification::effective_parameters)
      .def_ro("reduced_chi_square", &Identification::reduced_chi_square)
      .def_ro("log_evidence", &Identification::log_evidence)
      .def_ro("weights", &Identification::weights)
      .def_ro("starts", &Identification::starts)
      .def_ro("iterations", &Identification::iterations)
      .def_ro("evaluations", &Identification::evaluations)
      .def(
          "whiten",
          [](const Identification& self, Eigen::MatrixXd columns) {
            if (columns.rows() != 6 * self.weights.rows())
              throw std::invalid_argument("columns need six entries a row");
            self.whitening.apply(columns);
            return columns;
          },
          "columns"_a, "Columns (6 rows, any) with the noise made independent and of unit variance.")
      .def(
          "report",
          [](const Identification& self, const nb::object& predict) {
            RowReport r = report_any(self, predict);
            return std::tuple(std::move(r.residual), std::move(r.jacobian), std::move(r.field),
                              std::move(r.expected_square));
          },
          "predict"_a,
          "(residual, jacobian, field, expected_square) at the fitted values, of every row that is predicted.");

  m.def(
      "identify",
      [](const nb::object& predict, const std::vector<std::string>& names, const Eigen::VectorXd& mean,
         const Eigen::VectorXd& sd, const Eigen::VectorXd& low, const Eigen::VectorXd& high, const Noise& noise,
         const Eigen::MatrixX3d& places, bool robust, bool admit_model_error,
         const std::optional<Eigen::MatrixX2d>& weights, const std::optional<Eigen::Vector2d>& inflation,
         const std::optional<Eigen::VectorXd>& start, int starts, const Known& known, const Within& within) {
        std::vector<int> excluded;
        Identification fit = identify_any(predict, names, mean, sd, low, high, noise, places, robust, admit_model_error,
                                          weights, inflation, start, starts, known, within, excluded);
        return std::pair(std::move(fit), std::move(excluded));
      },
      nb::kw_only(), "predict"_a, "names"_a, "mean"_a, "sd"_a, "low"_a, "high"_a, "noise"_a, "places"_a,
      "robust"_a = true, "admit_model_error"_a = true, "weights"_a.none() = nb::none(),
      "inflation"_a.none() = nb::none(), "start"_a.none() = nb::none(), "starts"_a = 3, "known"_a = Known{},
      "within"_a = Within{},
      "Fits Readings, or a function (x, derivatives) -> (residual, jacobian) or None. Returns the fit and excluded "
      "rows.");
}

}  // namespace ctcr::python
