#pragma once
// Young's modulus of a tube from how far it deflects when it is clamped at one end and loaded across.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "ctcr/calibration/procedures/elastica.hpp"
#include "ctcr/calibration/procedures/notice.hpp"
#include "ctcr/calibration/procedures/propagation.hpp"
#include "ctcr/calibration/statistics.hpp"
#include "ctcr/robot/tube.hpp"

namespace ctcr {

/// One load on the straight part of a tube, and how far it moved the free end along the load, from where the end is
/// without that load: so the tube's own weight does not count. Load and deflection share their sign.
struct Deflection {
  double load;               ///< [N]
  double deflection;         ///< [m]
  double free_length;        ///< from the clamp to where the deflection is read [m]
  double load_distance = 0;  ///< from the clamp along the tube to the load [m]; 0: where the deflection is read
};

struct CantileverOptions {
  double inner_diameter = 0, outer_diameter = 0;  ///< [m]
  double deflection_sd = 0;   ///< of one deflection [m]; 0: from the residuals, which needs two rows or more
  double free_length_sd = 0;  ///< an error that all rows share [m]
  double diameter_sd = 0;     ///< of either diameter [m]
  bool fit_zero = false;      ///< all deflections are off by one constant, found as well
};

enum class CantileverNotice {
  load_dependent,    ///< figure: relative change of the modulus from the least to the largest load
  deflection_small,  ///< figure: relative sd of the modulus from the readings alone
  residuals_large,   ///< figure: sd of the residuals [m], above the one stated
};

/// The notice's name.
constexpr const char* to_string(CantileverNotice kind) {
  return std::array{"load_dependent", "deflection_small", "residuals_large"}.at(std::size_t(kind));
}

struct Cantilever {
  double youngs_modulus, youngs_modulus_sd;        ///< E [Pa]
  double bending_stiffness, bending_stiffness_sd;  ///< EI [N m^2]
  double zero, zero_sd;                            ///< constant error of the deflections [m]; 0 if not fitted
  double rms;                                      ///< of the residuals [m]
  std::vector<double> residuals;                   ///< measured - elastica [m]
  std::vector<double> end_angle;                   ///< of the tube where the deflection is read [rad]
  std::vector<double> row_modulus;                 ///< E from each row alone, zero taken off [Pa]
  Notices<CantileverNotice> notices;
};

namespace cantilever {

/// Deflection and angle of a row's tube with bending stiffness EI: beyond the load it is straight.
struct End {
  double deflection, angle;
};
inline End end_of(const Deflection& row, double EI) {
  const double a = row.load_distance > 0 ? row.load_distance : row.free_length;
  const Elastica rod = elastica_under(std::abs(row.load) * a * a / EI);
  const double deflection = a * rod.deflection + (row.free_length - a) * std::sin(rod.angle);
  return {std::copysign(deflection, row.load), std::copysign(rod.angle, row.load)};
}

/// Derivative of the deflection by ln EI: a smooth function of it, so a difference of fourth order is exact to 1e-10.
inline double slope_of(const Deflection& row, double EI) {
  constexpr double h = 5e-3;
  const auto d = [&](double t) { return end_of(row, EI * std::exp(t)).deflection; };
  return (8 * (d(h) - d(-h)) - (d(2 * h) - d(-2 * h))) / (12 * h);
}

/// EI at which one row's deflection is `wanted`: falls as EI grows, so Newton in logarithms from small deflections.
inline double stiffness_for(const Deflection& row, double wanted) {
  const double a = row.load_distance > 0 ? row.load_distance : row.free_length;
  double log_EI = std::log(std::abs(row.load) * a * a * (3 * row.free_length - a) / (6 * std::abs(wanted)));
  for (int k = 0; k < 60; ++k) {
    const double d = end_of(row, std::exp(log_EI)).deflection;
    const double step = std::log(wanted / d) * d / slope_of(row, std::exp(log_EI));
    log_EI += std::clamp(step, -1.0, 1.0);
    if (std::abs(step) < 1e-13) break;
  }
  return std::exp(log_EI);
}

inline void check(std::span<const Deflection> rows, const CantileverOptions& options) {
  require(!rows.empty(), "no load is given");
  require(options.outer_diameter > options.inner_diameter && options.inner_diameter >= 0,
          "the outer diameter [m] must be larger than the inner one, and that not negative");
  require(options.deflection_sd >= 0 && options.free_length_sd >= 0 && options.diameter_sd >= 0,
          "standard deviations must not be negative");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Deflection& row = rows[i];
    const std::size_t n = i + 1;
    require(std::isfinite(row.load) && std::isfinite(row.deflection) && std::isfinite(row.free_length) &&
                std::isfinite(row.load_distance),
            "row %zu: a value is not a finite number", n);
    require(row.load != 0, "row %zu: a load of 0 N says nothing of stiffness", n);
    require(row.free_length > 0, "row %zu: the free length must be positive [m]", n);
    require(row.load_distance >= 0 && row.load_distance <= row.free_length,
            "row %zu: the load must act between the clamp and where the deflection is read", n);
    require(row.deflection * row.load > 0, "row %zu: the tube must deflect along the load: both of one sign, and not 0",
            n);
    require(std::abs(row.deflection) < 0.95 * row.free_length,
            "row %zu: a deflection of %.1f mm is no less than the free length allows: is the unit m?", n,
            1e3 * std::abs(row.deflection));
  }
  const std::size_t unknowns = options.fit_zero ? 2 : 1;
  require(rows.size() >= unknowns, "two loads or more are needed to find the zero as well");
  require(rows.size() > unknowns || options.deflection_sd > 0,
          "so few rows have no scatter: give the standard deviation of a deflection, or more loads");
}

}  // namespace cantilever

/// Bending stiffness and Young's modulus by least squares on the deflections, with the elastica's large deflections.
/// @throws std::invalid_argument naming the row and what is wrong. Real time: no.
[[nodiscard]] inline Cantilever fit_cantilever(std::span<const Deflection> rows, const CantileverOptions& options) {
  using namespace cantilever;
  check(rows, options);
  const Eigen::Index n = Eigen::Index(rows.size()), unknowns = options.fit_zero ? 2 : 1;
  // Gauss-Newton by (ln EI, zero) from the mean over the fits of each row.
  Cantilever result{};
  double log_EI = 0;
  for (const Deflection& row : rows) log_EI += std::log(stiffness_for(row, row.deflection)) / double(n);
  Eigen::MatrixXd J = Eigen::MatrixXd::Ones(n, unknowns);
  Eigen::VectorXd error(n);
  const auto evaluate = [&] {
    for (Eigen::Index i = 0; i < n; ++i) {
      const Deflection& row = rows[std::size_t(i)];
      J(i, 0) = slope_of(row, std::exp(log_EI));
      error[i] = row.deflection - result.zero - end_of(row, std::exp(log_EI)).deflection;
    }
  };
  for (int k = 0; k < 50; ++k) {
    evaluate();
    const Eigen::VectorXd step = least_squares(J, error);
    log_EI += std::clamp(step[0], -0.5, 0.5);
    if (options.fit_zero) result.zero += step[1];
    if (std::abs(step[0]) < 1e-13) break;
  }
  evaluate();

  const double EI = std::exp(log_EI), degrees = double(n - unknowns), sum = error.squaredNorm();
  const double stated = options.deflection_sd * options.deflection_sd;
  const double variance = degrees > 0 ? std::max(stated, sum / degrees) : stated;
  const Eigen::MatrixXd G = gain(J), covariance = propagated(G, variance, {});
  require(G.size() > 0 && covariance(0, 0) < 100,
          "the loads do not tell the zero from the stiffness: use loads that differ more");
  // Effect of a common error of the lengths, as a relative change of EI.
  Eigen::VectorXd by_length(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double h = 1e-4 * rows[std::size_t(i)].free_length;
    Deflection longer = rows[std::size_t(i)], shorter = longer;
    // The clamp moves: the load goes with the end.
    for (auto [row, change] : {std::pair{&longer, h}, std::pair{&shorter, -h}}) {
      row->free_length += change;
      if (row->load_distance > 0) row->load_distance += change;
    }
    by_length[i] = (end_of(longer, EI).deflection - end_of(shorter, EI).deflection) / (2 * h);
  }
  const double length_part = G.row(0).dot(by_length) * options.free_length_sd;
  const Tube tube{.inner_diameter = options.inner_diameter, .outer_diameter = options.outer_diameter};
  const double I = tube.second_moment();
  const double di3 = std::pow(options.inner_diameter, 3), do3 = std::pow(options.outer_diameter, 3);
  const double section_part = std::numbers::pi / 16 * std::hypot(di3, do3) / I * options.diameter_sd;
  const double relative_sd = std::hypot(std::sqrt(covariance(0, 0)), length_part);
  result.bending_stiffness = EI;
  result.bending_stiffness_sd = EI * relative_sd;
  result.youngs_modulus = EI / I;
  result.youngs_modulus_sd = EI / I * std::hypot(relative_sd, section_part);
  result.zero_sd = options.fit_zero ? std::sqrt(covariance(1, 1)) : 0;
  result.rms = std::sqrt(sum / double(n));
  Eigen::MatrixXd wide(n, unknowns + 1);  // and a modulus that changes with the load
  double least = std::numeric_limits<double>::infinity(), largest = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Deflection& row = rows[std::size_t(i)];
    const double wanted = row.deflection - result.zero, load = std::abs(row.load);
    result.residuals.push_back(error[i]);
    result.end_angle.push_back(end_of(row, EI).angle);
    result.row_modulus.push_back(wanted * row.load > 0 ? stiffness_for(row, wanted) / I
                                                       : std::numeric_limits<double>::quiet_NaN());
    wide.row(i) << J.row(i), J(i, 0) * load;
    least = std::min(least, load);
    largest = std::max(largest, load);
  }

  using enum CantileverNotice;
  const double readings_sd = std::sqrt(covariance(0, 0));
  if (readings_sd > 0.1)
    result.notices.add(
        deflection_small, readings_sd, 0.1,
        "the deflections are small for their error: %.0f %% of the modulus; use a longer piece or more load",
        100 * readings_sd);
  if (stated > 0 && degrees > 0 && chi_square_score(sum / stated, degrees) > surprising)
    result.notices.add(residuals_large, std::sqrt(sum / degrees), options.deflection_sd,
                       "deflections scatter by %.3f mm about the elastica, more than the %.3f mm stated",
                       1e3 * std::sqrt(sum / degrees), 1e3 * options.deflection_sd);
  if (degrees < 3 || !(largest > 1.01 * least)) return result;
  const Eigen::VectorXd x = least_squares(wide, error);
  const double remaining = (error - wide * x).squaredNorm(), saved = sum - remaining;
  const double floor = 1e-20 * double(error.size()) * std::pow(rows.front().free_length, 2);
  const double score = stated > 0
                           ? chi_square_score(saved / stated, 1)
                           : variance_ratio_score(saved / std::max(remaining / (degrees - 1), floor), 1, degrees - 1);
  const double change = x[unknowns] * (largest - least);
  if (score > surprising && std::abs(change) > 0.02)
    result.notices.add(
        load_dependent, change, 0.02,
        "the modulus changes by %.0f %% from the least to the largest load: the material is not linear, or a "
        "length or the zero is wrong",
        100 * change);
  return result;
}

}  // namespace ctcr
