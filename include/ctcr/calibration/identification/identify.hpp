#pragma once
// The joint fit of parameters to a table of readings: the maximum a posteriori (MAP) estimate under Gaussian priors and
// the tracker's noise, its covariance, and the combinations of parameters that the readings do not determine.
#include <numbers>
#include <random>

#include "ctcr/calibration/identification/descent.hpp"
#include "ctcr/calibration/identification/fitted_rows.hpp"
#include "ctcr/calibration/identification/messages.hpp"
#include "ctcr/calibration/identification/outliers.hpp"

namespace ctcr {
namespace detail {

/// 1 where a row's position (rotation) was measured, else 0.
inline RowWeights measured(const Eigen::VectorXd& residual) {
  RowWeights use(residual.size() / 6, 2);
  for (Eigen::Index i = 0; i < use.rows(); ++i)
    for (int kind = 0; kind < 2; ++kind) use(i, kind) = residual.segment<3>(6 * i + 3 * kind).allFinite();
  return use;
}

/// Number of rows, an outlier counted by its inlier fraction.
inline double inlier_rows(const RowWeights& weights, int kind) {
  return weights.col(kind).array().min(1.0).sqrt().sum();
}

/// The field error at the positions (rows, 3) of a table, with a rank that is high enough for its noise.
inline SmoothField field_at(const Eigen::MatrixX3d& positions, const Noise& noise) {
  if (!(noise.position_field > 0 || noise.rotation_field > 0))
    return {Eigen::MatrixXd(positions.rows(), 0), Eigen::VectorXd::Zero(positions.rows())};
  constexpr double negligible = 0.01;  // of the jitter's variance
  const auto tolerance = [](double jitter, double field) { return negligible * jitter * jitter / (field * field); };
  return smooth_field(positions, noise.correlation_length,
                      std::min(tolerance(noise.position_jitter, noise.position_field),
                               tolerance(noise.rotation_jitter, noise.rotation_field)));
}

/// The prediction at the starting values, and which rows it can be compared with.
struct FirstPrediction {
  Eigen::VectorXd x, residual;
  Eigen::MatrixXd jacobian;
  RowWeights use;  ///< of all rows: 0 where nothing was measured, or the caller leaves a row out

  FirstPrediction(const Predictor& predict, const std::vector<FreeParameter>& parameters, Eigen::Index rows,
                  const IdentifyOptions& options)
    : x(Eigen::Index(parameters.size())) {
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      const FreeParameter& p = parameters[std::size_t(k)];
      x[k] = std::clamp(options.start ? (*options.start)[k] : p.mean, p.low, p.high);
    }
    if (!predict(x, residual, &jacobian))
      throw std::invalid_argument("the readings cannot be predicted at the starting values");
    if (residual.size() != 6 * rows || jacobian.rows() != residual.size() || jacobian.cols() != x.size())
      throw std::invalid_argument("the predictor, the parameters and the positions do not fit together");
    use = measured(residual);
    if (options.weights) use = use.cwiseProduct(*options.weights);
    if (!(use.array() > 0).any())
      throw std::invalid_argument("no reading is left to fit: nothing was measured or solved");
  }
};

/// A joint fit: the posterior in scaled parameters z, and the row weights and jitter inflation that belong to it.
class JointFit {
public:
  JointFit(const Predictor& predict, const std::vector<FreeParameter>& parameters, const Noise& noise,
           const Eigen::MatrixX3d& positions, const IdentifyOptions& options, FirstPrediction first)
    : parameters_(parameters),
      noise_(noise),
      options_(options),
      finds_weights_(options.robust && !options.weights),
      finds_inflation_(options.admit_model_error && !options.inflation),
      rows_(first.use),
      predict_(rows_.predictor(predict)),
      use_(rows_.weights(first.use)),
      weights_(use_),
      inflation_(options.inflation.value_or(Eigen::Array2d::Ones())),
      field_everywhere_(field_at(positions, noise)),
      field_(rows_.field(field_everywhere_)),
      scale_(scale_for(rows_.of(first.jacobian))),
      objective_(predict_, parameters, scale_, prior_precision(parameters, options.correlations)),
      bounds_(parameters, options.within, scale_),
      z_(objective_.z(first.x)) {
    objective_.know(z_, rows_.of(first.residual), rows_.of(first.jacobian));
    if (finds_weights_ && options.first_weights) weights_ = use_.cwiseProduct(rows_.weights(*options.first_weights));
    // The first descent takes all misfit at the start for noise: far from the solution, details mislead.
    if (finds_inflation_) set_inflation(objective_.at(z_)->residual);
    objective_.set_whitening(whitening());
  }

  /// Descends to the nearest minimum; weights and inflation are updated between descents until they stay the same.
  void descend_reweighted() {
    constexpr int rounds = 8;
    const double coarse = std::max(0.5, options_.tolerance);
    bool settled = false;
    for (int round = 0; (finds_weights_ || finds_inflation_) && round < rounds && !settled; ++round) {
      descend(coarse);
      settled = !objective_.at(z_) || !reweight();
    }
    if (!settled || options_.tolerance < coarse) descend(options_.tolerance);
    linearise();
  }

  /// Descends from starts drawn from the prior, under the weights found; goes on from there where the cost is lower.
  void try_other_starts() {
    std::mt19937_64 random(1);
    for (int start = 1; start < options_.starts; ++start) {
      Eigen::VectorXd other = drawn_from_prior(random);
      for (int halving = 0; halving < 5 && !objective_.at(other); ++halving) other = 0.5 * (other + z_);
      if (!objective_.at(other)) continue;
      const Goal goal{z_, here_.hessian};
      const Descent there =
          detail::descend(objective_, bounds_, options_.max_iterations, options_.tolerance, other, &goal);
      iterations_ += there.iterations;
      starts_.push_back({there.cost, goal.distance(other), there.converged});
      if (there.cost < descent_.cost - 0.5 && goal.distance(other) > 0.5) {
        warnings_.push_back("a start drawn from the prior led to a better minimum than the first one");
        z_ = other;
        descend_reweighted();
      }
    }
  }

  /// The Laplace approximation of the posterior at the minimum, in the parameters' units.
  [[nodiscard]] Identification result() {
    const Posterior posterior(here_.information, objective_.prior());
    Identification out;
    out.starts = starts_, out.warnings = warnings_;
    out.weights = weights_, out.inflation = inflation_;
    report_estimate(posterior, out);
    report_goodness(posterior, out);
    report_convergence(out);
    add_warnings(parameters_, posterior, here_.information.diagonal(), bounds_.reached(z_), use_, out);
    const Eigen::Index rows = field_everywhere_.factor.rows();
    out.weights = rows_.expanded(rows, weights_);
    out.whitening = Whitening(noise_, field_everywhere_, rows_.expanded(rows, inflated_weights()));
    return out;
  }

private:
  [[nodiscard]] RowWeights inflated_weights() const {
    RowWeights weights = weights_;
    for (int kind = 0; kind < 2; ++kind) weights.col(kind) /= inflation_[kind] * inflation_[kind];
    return weights;
  }
  [[nodiscard]] Whitening whitening() const { return {noise_, field_, inflated_weights()}; }

  /// Prior sd of each parameter; without a prior, the sd that the readings alone would give it at the start.
  [[nodiscard]] Eigen::VectorXd scale_for(const Eigen::MatrixXd& jacobian) const {
    const Whitening first = whitening();
    Eigen::VectorXd scale(jacobian.cols());
    for (Eigen::Index k = 0; k < scale.size(); ++k) {
      scale[k] = parameters_[std::size_t(k)].sd;
      if (std::isfinite(scale[k])) continue;
      Eigen::VectorXd column = jacobian.col(k);
      first.apply(column);
      scale[k] = column.norm() > 0 ? 1 / column.norm() : 1.0;
    }
    return scale;
  }

  void descend(double tolerance) {
    descent_ = detail::descend(objective_, bounds_, options_.max_iterations, tolerance, z_);
    iterations_ += descent_.iterations;
  }
  void linearise() {
    if (!objective_.linearise(z_, here_))
      throw std::invalid_argument("the readings cannot be predicted at the fitted values");
  }

  /// The inflation with which a residual would have the chi-square that its inliers should have.
  void set_inflation(const Eigen::VectorXd& residual) {
    const Whitening stated(noise_, field_, weights_);
    for (int kind = 0; kind < 2; ++kind) {
      const double expected = 3 * inlier_rows(weights_, kind);
      inflation_[kind] = std::sqrt(stated.axes(kind).inflation(Whitening::gathered(residual, kind), expected));
    }
  }

  /// Iterates weights and inflation together with the minimum of the model linearised at z, which needs no predictions.
  /// @return whether they changed
  bool reweight() {
    constexpr int rounds = 20;
    const double settled = std::max(0.5, 1e-3 * double(field_everywhere_.factor.rows()));  // rows
    for (int round = 0; round < rounds; ++round) {
      linearise();
      const auto* point = objective_.at(z_);
      const Eigen::VectorXd step = bounds_.step(z_, here_.gradient, here_.hessian);
      const Eigen::VectorXd residual = point->residual + point->jacobian * scale_.cwiseProduct(step);
      const RowWeights weights = weights_;
      const Eigen::Array2d inflation = inflation_;
      if (finds_weights_) weights_ = outlier_weights(noise_, inflation_, objective_.whitening(), residual, use_);
      if (finds_inflation_) set_inflation(residual);
      const double changed = (weights - weights_).cwiseAbs().sum();
      if (changed < settled && (inflation_ / inflation).log().abs().maxCoeff() < 0.02) {
        weights_ = weights, inflation_ = inflation;  // those that the objective's whitening has
        return round > 0;
      }
      objective_.set_whitening(whitening());
    }
    return true;
  }

  /// The current z with new values of the parameters that have a prior, within the bounds.
  Eigen::VectorXd drawn_from_prior(std::mt19937_64& random) {
    Eigen::VectorXd other = z_, drawn(z_.size());
    for (double& value : drawn) value = normal_(random);
    if (options_.correlations) drawn = options_.correlations->llt().matrixL() * drawn.eval();
    for (Eigen::Index k = 0; k < other.size(); ++k) {
      const FreeParameter& p = parameters_[std::size_t(k)];
      if (std::isfinite(p.sd)) other[k] = (std::clamp(p.mean + p.sd * drawn[k], p.low, p.high) - p.mean) / p.sd;
    }
    return bounds_.clamped(other);
  }

  void report_estimate(const Posterior& posterior, Identification& out) const {
    out.values = objective_.x(z_);
    out.sd = scale_.cwiseProduct(posterior.sd());
    out.covariance = scale_.asDiagonal() * posterior.covariance() * scale_.asDiagonal();
    const Eigen::VectorXd precision = objective_.prior().diagonal();
    const auto has_prior = precision.array() > 0;
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    out.shift = has_prior.select(z_, nan);
    out.ratio = has_prior.select(posterior.sd(), nan);
    out.correlations = strong_correlations(posterior, options_.strong_correlation);
    out.directions = undetermined_directions(posterior, parameters_, options_.known, options_.correlations);
  }

  /// Chi-square, degrees of freedom and the log marginal likelihood.
  void report_goodness(const Posterior& posterior, Identification& out) {
    Eigen::VectorXd residual = objective_.at(z_)->residual;
    Whitening(noise_, field_, weights_).apply(residual);
    const Whitening& whitening = objective_.whitening();
    out.chi_square = residual.squaredNorm();
    out.admitted_chi_square = here_.chi_square;
    out.shift_square = objective_.shift_square(z_);
    out.observations = whitening.observations();
    out.effective_parameters = posterior.effective_parameters();
    out.bulk_observations = 3 * (inlier_rows(weights_, 0) + inlier_rows(weights_, 1));
    out.reduced_chi_square = out.chi_square / (out.bulk_observations - out.effective_parameters);
    out.log_evidence = -0.5 * (here_.chi_square + out.shift_square + posterior.log_determinant() +
                               whitening.log_determinant() + double(out.observations) * std::log(2 * std::numbers::pi));
    if (options_.correlations)
      out.log_evidence -= options_.correlations->llt().matrixLLT().diagonal().array().log().sum();
    if ((objective_.prior().diagonal().array() == 0).any()) out.log_evidence = std::numeric_limits<double>::quiet_NaN();
  }

  void report_convergence(Identification& out) const {
    constexpr double close = 0.05;  // posterior sd
    const double remaining = bounds_.step_left(z_, here_.gradient, here_.hessian);
    out.converged = remaining < close || descent_.converged;
    out.iterations = iterations_;
    out.evaluations = objective_.evaluations() + 1;
    out.status = !out.converged ? "not converged after " + std::to_string(descent_.iterations) +
                                      " iterations: a step of " + number(remaining) + " standard deviations is left"
                 : descent_.at_kink && remaining >= close ? "converged, at a kink of the model"
                                                          : "converged";
  }

  const std::vector<FreeParameter>& parameters_;
  const Noise& noise_;
  const IdentifyOptions& options_;
  const bool finds_weights_, finds_inflation_;
  const FittedRows rows_;
  const Predictor predict_;  ///< of the fitted rows
  const RowWeights use_;     ///< weights before outliers are found
  RowWeights weights_;       ///< without the inflation
  Eigen::Array2d inflation_;
  const SmoothField field_everywhere_, field_;  ///< of all rows, of the fitted ones
  const Eigen::VectorXd scale_;
  Objective objective_;
  const Bounds bounds_;
  Eigen::VectorXd z_;
  Descent descent_;  ///< the last one from z
  Linearised here_;  ///< at z
  std::normal_distribution<double> normal_;
  std::vector<Start> starts_;
  std::vector<std::string> warnings_;
  int iterations_ = 0;
};

}  // namespace detail

/// Finds the most probable parameters given readings, priors and the tracker's noise.
///
/// Iteratively reweighted, damped Gauss-Newton on the whitened residuals and the prior, then the same from other starts.
/// Linear in the rows; memory for two matrices of 6 rows x parameters and the field's factors. Deterministic for a
/// deterministic predictor.
/// @param positions  (rows, 3) of the sensor, tracker frame [m], best as predicted near the result: field errors of near
///     positions are alike, and at measured positions jitter would pass for a change of the field
/// @throws std::invalid_argument where no fit is possible, with one sentence a line. Real time: no.
/// Ref: roles of the prior and of the noise as in Tarantola, "Inverse Problem Theory", 2005, sect. 3.
inline Identification identify(const Predictor& predict, const std::vector<FreeParameter>& parameters,
                               const Noise& noise, const Eigen::MatrixX3d& positions,
                               const IdentifyOptions& options = {}) {
  detail::check(parameters, noise, positions, options);
  // Predict once to find the rows that can be fitted and the scale of each parameter.
  detail::JointFit fit(predict, parameters, noise, positions, options,
                       detail::FirstPrediction(predict, parameters, positions.rows(), options));
  // Find the nearest minimum, with the weights of outliers and the inflation of the jitter that belong to it.
  fit.descend_reweighted();
  // Look for a better minimum elsewhere within the prior.
  fit.try_other_starts();
  // Approximate the posterior there: standard deviations, undetermined directions, log evidence, warnings.
  return fit.result();
}

}  // namespace ctcr
