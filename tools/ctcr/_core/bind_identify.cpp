// Joint identification: parameters fitted to a recording. Use ctcr.fit.joint, which converts and names.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <ctcr/calibration/identification/identify_with_exclusions.hpp>
#include <ctcr/calibration/identification/row_report.hpp>
#include <tuple>

#include "any_recording.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {
namespace {

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

std::pair<Identification, std::vector<int>> identify_any(
    const nb::object& predict, const std::vector<std::string>& names, const Eigen::VectorXd& mean,
    const Eigen::VectorXd& sd, const Eigen::VectorXd& low, const Eigen::VectorXd& high, const Noise& noise,
    const Eigen::MatrixX3d& positions, const std::optional<Eigen::MatrixX2d>& weights,
    const std::optional<Eigen::Vector2d>& inflation, const std::optional<Eigen::VectorXd>& start,
    const std::optional<Eigen::MatrixX2d>& first_weights, int starts, int max_iterations, double tolerance,
    const Known& known, const Within& within, const std::optional<Eigen::MatrixXd>& correlations) {
  const std::vector<FreeParameter> parameters = free_parameters(names, mean, sd, low, high);
  IdentifyOptions options;
  options.weights = weights;
  if (inflation) options.inflation = inflation->array();
  options.correlations = correlations;
  options.start = start;
  options.first_weights = first_weights;
  options.starts = starts;
  options.max_iterations = max_iterations;
  options.tolerance = tolerance;
  for (const auto& [text, change] : known) {
    if (change.size() != mean.size()) throw std::invalid_argument("a known direction needs one number a parameter");
    options.known.push_back({text, change});
  }
  for (const auto& [text, change, least] : within) options.within.push_back({text, change, least});
  if (nb::isinstance<AnyRecording>(predict)) {
    AnyRecording& recording = nb::cast<AnyRecording&>(predict);
    const nb::gil_scoped_release released;
    std::vector<int> excluded;
    Identification fit = identify_with_exclusions(recording, parameters, noise, positions, options, excluded);
    return {std::move(fit), std::move(excluded)};
  }
  return {identify(predictor_of(nb::cast<nb::callable>(predict)), parameters, noise, positions, options), {}};
}

RowReport report_any(const Identification& fit, const nb::object& predict) {
  if (nb::isinstance<AnyRecording>(predict)) {
    AnyRecording& recording = nb::cast<AnyRecording&>(predict);
    const nb::gil_scoped_release released;
    return report_rows(fit, std::ref(recording));
  }
  return report_rows(fit, predictor_of(nb::cast<nb::callable>(predict)));
}

}  // namespace

void bind_identify(nb::module_& m) {
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
  m.def("field_of_accuracy", &field_of_accuracy, "accuracy_95"_a, "jitter"_a,
        "Sd per axis of the field error that a 95 % accuracy leaves beside the jitter, in their unit.");

  nb::class_<Correlation>(m, "Correlation", "Two parameters that the readings hardly distinguish.")
      .def_ro("first", &Correlation::first)
      .def_ro("second", &Correlation::second)
      .def_ro("coefficient", &Correlation::coefficient);
  nb::class_<Direction>(m, "Direction", "A combination of parameters that the readings do not determine.")
      .def_ro("text", &Direction::text)
      .def_ro("ratio", &Direction::ratio, "Posterior / prior standard deviation along it.")
      .def_ro("coefficients", &Direction::coefficients, "Unit vector in prior standard deviations.");
  nb::class_<Start>(m, "Start", "The minimum that another start led to.")
      .def_ro("cost", &Start::cost, "-log posterior density, up to a constant that all starts share.")
      .def_ro("distance", &Start::distance, "To the result, in posterior sd.")
      .def_ro("converged", &Start::converged);

  nb::class_<Identification>(m, "Identification", "A fit; arrays are copies.")
      .def_ro("converged", &Identification::converged)
      .def_ro("status", &Identification::status, "In words.")
      .def_ro("warnings", &Identification::warnings, "Whole sentences.")
      .def_ro("values", &Identification::values, "In the units of the parameters.")
      .def_ro("sd", &Identification::sd, "Of the values; inf: not determined.")
      .def_ro("shift", &Identification::shift, "(value - prior mean) / prior sd; NaN without a prior.")
      .def_ro("ratio", &Identification::ratio, "Posterior / prior sd; NaN without a prior.")
      .def_ro("covariance", &Identification::covariance, "In the units of the parameters.")
      .def_ro("correlations", &Identification::correlations, "Strong ones.")
      .def_ro("directions", &Identification::directions, "Undetermined ones.")
      .def_ro("chi_square", &Identification::chi_square,
              "Of the residuals under the noise as stated, outliers with less weight.")
      .def_ro("admitted_chi_square", &Identification::admitted_chi_square, "Under the inflated noise.")
      .def_ro("shift_square", &Identification::shift_square, "Sum of the squared shifts.")
      .def_ro("observations", &Identification::observations, "Numbers fitted.")
      .def_ro("bulk_observations", &Identification::bulk_observations, "Numbers fitted without the outliers.")
      .def_prop_ro(
          "inflation", [](const Identification& self) { return Eigen::Vector2d(self.inflation); },
          "Factor on the sd of the jitter of positions and rotations that the fit had to admit.")
      .def_ro("effective_parameters", &Identification::effective_parameters, "Trace of the hat matrix.")
      .def_ro("reduced_chi_square", &Identification::reduced_chi_square,
              "chi_square / (bulk_observations - effective_parameters).")
      .def_ro("log_evidence", &Identification::log_evidence,
              "Log marginal likelihood by the Laplace approximation; NaN where a prior is infinite.")
      .def_ro("weights", &Identification::weights, "(rows, 2) of positions and rotations.")
      .def_ro("starts", &Identification::starts, "Minima that other starts led to.")
      .def_ro("iterations", &Identification::iterations)
      .def_ro("evaluations", &Identification::evaluations, "Predictions made.")
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
      "identify", &identify_any, nb::kw_only(), "predict"_a, "names"_a, "mean"_a, "sd"_a, "low"_a, "high"_a, "noise"_a,
      "positions"_a, "weights"_a.none() = nb::none(), "inflation"_a.none() = nb::none(), "start"_a.none() = nb::none(),
      "first_weights"_a.none() = nb::none(), "starts"_a = 3, "max_iterations"_a = 50, "tolerance"_a = 0.02,
      "known"_a = Known{}, "within"_a = Within{}, "correlations"_a.none() = nb::none(),
      "Fits a Recording, or a function (x, derivatives) -> (residual, jacobian) or None. Returns the fit and the rows "
      "left out because they could not be solved. Raises ValueError where no fit is possible.");
}

}  // namespace ctcr::python
