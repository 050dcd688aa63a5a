#pragma once
// Messages of a joint fit: the input that it refuses, and warnings about its result.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "ctcr/calibration/identification/identification.hpp"

namespace ctcr {
namespace detail {

inline std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

inline std::string listed(const std::vector<std::string>& names) {
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return all;
}

/// Refuses input with which a fit is impossible. @throws std::invalid_argument with one sentence a line
inline void check(const std::vector<FreeParameter>& parameters, const Noise& noise, const Eigen::MatrixX3d& positions,
                  const IdentifyOptions& options) {
  std::string faults;
  const auto require = [&](bool condition, const std::string& text) {
    if (!condition) faults += (faults.empty() ? "" : "\n") + text;
  };
  require(!parameters.empty(), "nothing is free: name at least one parameter");
  for (const FreeParameter& p : parameters) {
    require(std::isfinite(p.mean), p.name + ": its prior mean is not finite");
    require(p.sd > 0, p.name + ": its prior standard deviation is " + number(p.sd) +
                          ", but must be above 0; leave a parameter that is known exactly out of the fit");
    require(p.low < p.high && p.low <= p.mean && p.mean <= p.high, p.name + ": its prior mean " + number(p.mean) +
                                                                       " lies outside its bounds " + number(p.low) +
                                                                       " and " + number(p.high));
  }
  require(noise.position_jitter > 0 && noise.rotation_jitter > 0,
          "the jitter of the tracker must be above 0, both in position and in rotation");
  require(noise.position_field >= 0 && noise.rotation_field >= 0 && noise.correlation_length > 0,
          "the tracker's field error must not be negative, and its correlation length must be above 0");
  require(!options.weights || (options.weights->rows() == positions.rows() && options.weights->allFinite() &&
                               options.weights->minCoeff() >= 0),
          "weights must be two numbers, not negative, for each row");
  const auto n = Eigen::Index(parameters.size());
  require(!options.correlations || (options.correlations->rows() == n && options.correlations->cols() == n &&
                                    options.correlations->allFinite() &&
                                    Eigen::LLT<Eigen::MatrixXd>(*options.correlations).info() == Eigen::Success),
          "the correlations of the priors must be a positive definite matrix, one row a parameter");
  require(!options.inflation || (options.inflation->allFinite() && options.inflation->minCoeff() > 0),
          "the inflation of the jitter must be above 0");
  require(!options.start || options.start->size() == Eigen::Index(parameters.size()),
          "the start must hold one value for each parameter");
  for (const LinearBound& bound : options.within)
    require(bound.change.size() == Eigen::Index(parameters.size()) && bound.change.allFinite() && bound.low <= 0,
            "a bound of a sum of parameters (" + bound.text +
                ") needs one number a parameter, and to hold at the prior "
                "means");
  if (!faults.empty()) throw std::invalid_argument(faults);
}

constexpr Eigen::Index few_per_parameter = 5;

inline void add_warnings(const std::vector<FreeParameter>& parameters, const Posterior& posterior,
                         const Eigen::VectorXd& information, const std::vector<std::string>& reached,
                         const RowWeights& use, Identification& out) {
  const auto warn = [&](const std::string& text) { out.warnings.push_back(text); };
  const auto n = Eigen::Index(parameters.size());
  if (out.observations < few_per_parameter * n)
    warn("only " + std::to_string(out.observations) + " numbers were measured for " + std::to_string(n) +
         (n == 1 ? " parameter: " : " parameters: ") +
         (out.observations < n ? "the prior decides" : "few are left to tell a wrong model from a right one"));
  std::vector<std::string> idle, open, moved, stopped;
  for (Eigen::Index k = 0; k < n; ++k) {
    const FreeParameter& p = parameters[std::size_t(k)];
    if (!(information[k] > 0))
      idle.push_back(p.name);
    else if (!std::isfinite(out.sd[k]))
      open.push_back(p.name);
    if (std::abs(out.shift[k]) > 2) moved.push_back(p.name + " (" + number(out.shift[k]) + ")");
    const double margin = 1e-6 * out.sd[k];
    if (out.values[k] <= p.low + margin || out.values[k] >= p.high - margin)
      stopped.push_back(p.name + " (" + number(out.values[k]) + ")");
  }
  const auto warn_of = [&](const std::vector<std::string>& names, const std::string& text) {
    if (!names.empty()) warn(text + ": " + listed(names));
  };
  warn_of(idle, "without effect on these readings and left as it was");
  warn_of(open, "determined neither by these readings nor by a prior: give it one or leave it out");
  warn_of(
      moved,
      "moved by more than 2 prior standard deviations (the prior is too narrow, or the value makes up for an error of "
      "the model)");
  warn_of(stopped, "stopped at a bound");
  for (const std::string& text : reached) warn("the fit stopped where " + text);
  if (posterior.singular() && out.sd.allFinite()) warn("some combination of the parameters is not determined");
  for (int kind = 0; kind < 2; ++kind)
    if (out.inflation[kind] > 1)
      warn("the noise does not explain the " + std::string(kind ? "rotations" : "positions") +
           ": something is missing in the model, and the fit had to take the jitter for " +
           number(out.inflation[kind]) + " times as large as stated");
  for (int kind = 0; kind < 2; ++kind) {
    const auto used = (use.col(kind).array() > 0).count();
    const auto low = used - (out.weights.col(kind).array() > 0.5 * use.col(kind).array()).count();
    if (double(low) > 0.02 * double(used))
      warn(std::to_string(low) + " of " + std::to_string(used) + (kind ? " rotations" : " positions") +
           (low == 1 ? " is an outlier and counts for little" : " are outliers and count for little"));
  }
}

}  // namespace detail

}  // namespace ctcr
