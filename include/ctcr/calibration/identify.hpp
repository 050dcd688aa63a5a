#pragma once
// Parameters identified together from a table of readings: the most probable values given Gaussian priors and the noise
// of the tracker, how certain they are, and what the readings cannot say.
#include <ceres/ceres.h>

#include <functional>
#include <numbers>
#include <optional>
#include <random>
#include <stdexcept>

#include "ctcr/calibration/outliers.hpp"
#include "ctcr/calibration/posterior.hpp"

namespace ctcr {

/// Residuals (6 rows) at parameters x: measured - predicted position [m] and rotation vector [rad] of each row,
/// interleaved, NaN where not measured (at the same places for every x); and, unless null, their derivatives
/// (6 rows, parameters). Both are resized. Returns false where the prediction fails at x: the step is then shortened.
using Predictor = std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian)>;

struct IdentifyOptions {
  bool robust = true;                     ///< outliers count for little; else every reading counts
  std::optional<RowWeights> weights;      ///< frozen; a weight of 0 leaves a position or a rotation out
  std::optional<Eigen::VectorXd> start;   ///< where to start; the prior means otherwise
  int starts = 3;                         ///< the first and others drawn from the prior, compared at the end
  int max_iterations = 50;                ///< of each descent
  std::vector<KnownDirection> known;      ///< directions that deserve their own words where they are undetermined
  double strong_correlation = 0.9;        ///< correlations beyond it are listed
};

/// Two parameters that the readings hardly tell apart.
struct Correlation {
  int first, second;
  double coefficient;
};

/// Where one of several starts led.
struct Start {
  double cost;      ///< -log posterior density there, up to the constant that all starts share
  double distance;  ///< to the result, in posterior sd (root of the Mahalanobis square)
  bool converged;
};

struct Identification {
  bool converged = false;
  std::string status;                 ///< in words
  std::vector<std::string> warnings;  ///< whole sentences
  Eigen::VectorXd values, sd;         ///< in the parameters' units; sd infinite: not determined
  Eigen::VectorXd shift;              ///< (value - mean) / prior sd; NaN without a prior
  Eigen::VectorXd ratio;              ///< posterior / prior sd; NaN without a prior
  Eigen::MatrixXd covariance;         ///< in the parameters' units
  std::vector<Correlation> correlations;
  std::vector<Direction> directions;  ///< undetermined ones

  double chi_square = 0;            ///< of the whitened residuals
  double shift_square = 0;          ///< sum of the squared shifts; chi_square + this has `observations` degrees of freedom
  Eigen::Index observations = 0;    ///< numbers fitted
  double effective_parameters = 0;  ///< trace of the hat matrix: how many the readings determine rather than the prior
  double reduced_chi_square = 0;    ///< chi_square / (observations - effective_parameters)
  double log_evidence = 0;          ///< Laplace approximation; NaN where a prior is infinite

  RowWeights weights;
  Whitening whitening;   ///< of the fit
  std::vector<Start> starts;
  int iterations = 0, evaluations = 0;
};

/// What a fit says of every row that its predictor answers, rows that were not fitted included.
struct RowReport {
  Eigen::VectorXd residual;  ///< (6 rows)
  Eigen::MatrixXd jacobian;  ///< (6 rows, parameters)
  Eigen::VectorXd field;     ///< (6 rows) posterior mean of the tracker's field error, which is part of the residual
  /// (rows, 2) expected squared length of the position [m^2] and rotation residual [rad^2]: noise, less what the fit has
  /// swallowed of it at fitted rows; noise and uncertainty of the parameters, less the field error that both share, at
  /// others. The root of its mean is the noise floor.
  Eigen::MatrixX2d expected_square;
};

namespace detail {

/// A posterior in scaled parameters z, x = origin + scale z.
class Objective final : public ceres::CostFunction {
 public:
  Objective(const Predictor& predict, const std::vector<FreeParameter>& parameters, Eigen::VectorXd scale,
            Eigen::Index rows)
    : predict_(predict), scale_(std::move(scale)), origin_(scale_.size()), prior_(scale_.size()) {
    for (Eigen::Index k = 0; k < scale_.size(); ++k) {
      const FreeParameter& p = parameters[std::size_t(k)];
      origin_[k] = p.mean;
      prior_[k] = std::isfinite(p.sd);
    }
    set_num_residuals(int(6 * rows + scale_.size()));
    mutable_parameter_block_sizes()->push_back(int(scale_.size()));
  }

  Eigen::VectorXd x(const Eigen::VectorXd& z) const { return origin_ + scale_.cwiseProduct(z); }
  Eigen::VectorXd z(const Eigen::VectorXd& x) const { return (x - origin_).cwiseQuotient(scale_); }
  const Eigen::VectorXd& scale() const { return scale_; }
  const Eigen::VectorXd& prior() const { return prior_; }
  int evaluations() const { return evaluations_; }

  void set_whitening(const Whitening& whitening) { whitening_ = &whitening; }

  /// Residual as predicted.
  bool predict(const Eigen::VectorXd& z, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) const {
    ++evaluations_;
    return predict_(x(z), residual, jacobian);
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Index n = scale_.size(), count = num_residuals() - n;
    const Eigen::VectorXd z = Eigen::Map<const Eigen::VectorXd>(parameters[0], n);
    Eigen::MatrixXd* jacobian = jacobians && jacobians[0] ? &jacobian_ : nullptr;
    if (!predict(z, residual_, jacobian)) return false;
    whitening_->apply(residual_);
    Eigen::Map<Eigen::VectorXd> out(residuals, num_residuals());
    out.head(count) = residual_;
    out.tail(n) = prior_.cwiseProduct(z);
    if (jacobian) {
      whitening_->apply(jacobian_);
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      Eigen::Map<RowMajor> J(jacobians[0], num_residuals(), n);
      J.topRows(count).noalias() = jacobian_ * scale_.asDiagonal();
      J.bottomRows(n) = prior_.asDiagonal();
    }
    return out.allFinite();
  }

 private:
  const Predictor& predict_;
  Eigen::VectorXd scale_, origin_, prior_;
  const Whitening* whitening_ = nullptr;
  mutable Eigen::VectorXd residual_;
  mutable Eigen::MatrixXd jacobian_;
  mutable int evaluations_ = 0;
};

/// Ends a descent that is about to arrive where another one has been.
class Arrival final : public ceres::IterationCallback {
 public:
  Arrival(const Eigen::VectorXd& z, const Eigen::VectorXd& goal, const Eigen::MatrixXd& precision)
    : z_(z), goal_(goal), precision_(precision) {}
  double distance() const { return std::sqrt(std::max(0.0, (z_ - goal_).dot(precision_ * (z_ - goal_)))); }
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return distance() < 0.1 ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  const Eigen::VectorXd &z_, &goal_;
  const Eigen::MatrixXd& precision_;
};

struct Descent {
  double cost = std::numeric_limits<double>::infinity();
  bool converged = false;
  int iterations = 0;
};

/// Goes down from z to the nearest minimum.
inline Descent descend(Objective& objective, const std::vector<FreeParameter>& parameters, int max_iterations,
                       Eigen::VectorXd& z, ceres::IterationCallback* callback = nullptr) {
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  problem.AddResidualBlock(&objective, nullptr, z.data());
  for (Eigen::Index k = 0; k < z.size(); ++k) {
    const FreeParameter& p = parameters[std::size_t(k)];
    const double scale = objective.scale()[k];
    if (std::isfinite(p.low)) problem.SetParameterLowerBound(z.data(), int(k), (p.low - p.mean) / scale);
    if (std::isfinite(p.high)) problem.SetParameterUpperBound(z.data(), int(k), (p.high - p.mean) / scale);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = max_iterations;
  options.gradient_tolerance = 1e-3;  // of a parameter in prior sd: a thousandth of the posterior sd at most
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-10;
  options.max_num_consecutive_invalid_steps = 10;
  options.logging_type = ceres::SILENT;
  options.update_state_every_iteration = callback != nullptr;
  if (callback) options.callbacks.push_back(callback);
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return {summary.final_cost,
          summary.termination_type == ceres::CONVERGENCE || summary.termination_type == ceres::USER_SUCCESS,
          int(summary.iterations.size())};
}

inline std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

/// All that makes a fit impossible. @throws std::invalid_argument with one sentence a line
inline void check(const std::vector<FreeParameter>& parameters, const Noise& noise, const Eigen::MatrixX3d& places,
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
    require(p.low < p.high && p.low <= p.mean && p.mean <= p.high,
            p.name + ": its prior mean " + number(p.mean) + " lies outside its bounds " + number(p.low) + " and " +
                number(p.high));
  }
  require(noise.position_jitter > 0 && noise.rotation_jitter > 0,
          "the jitter of the tracker must be above 0, both in position and in rotation");
  require(noise.position_field >= 0 && noise.rotation_field >= 0 && noise.correlation_length > 0,
          "the tracker's field error must not be negative, and its correlation length must be above 0");
  require(!options.weights || (options.weights->rows() == places.rows() && options.weights->allFinite() &&
                               options.weights->minCoeff() >= 0),
          "weights must be two numbers, not negative, for each row");
  require(!options.start || options.start->size() == Eigen::Index(parameters.size()),
          "the start must hold one value for each parameter");
  if (!faults.empty()) throw std::invalid_argument(faults);
}

/// 1 where a row's position (rotation) was measured, else 0.
inline RowWeights measured(const Eigen::VectorXd& residual) {
  RowWeights use(residual.size() / 6, 2);
  for (Eigen::Index i = 0; i < use.rows(); ++i)
    for (int kind = 0; kind < 2; ++kind) use(i, kind) = residual.segment<3>(6 * i + 3 * kind).allFinite();
  return use;
}

/// The factor of the field error at the places of a table, fine enough for its noise.
inline SmoothField field_at(const Eigen::MatrixX3d& places, const Noise& noise) {
  constexpr double negligible = 0.01;  // of the jitter's variance
  const auto tolerance = [](double jitter, double field) { return negligible * jitter * jitter / (field * field); };
  return smooth_field(places, noise.correlation_length,
                      std::min(tolerance(noise.position_jitter, noise.position_field),
                               tolerance(noise.rotation_jitter, noise.rotation_field)));
}

inline void add_warnings(const std::vector<FreeParameter>& parameters, const Posterior& posterior,
                         const Eigen::VectorXd& information, const RowWeights& use, Identification& out) {
  const auto warn = [&](const std::string& text) { out.warnings.push_back(text); };
  const auto n = Eigen::Index(parameters.size());
  if (out.observations < n)
    warn("only " + std::to_string(out.observations) + " numbers were measured for " + std::to_string(n) +
         " parameters: the prior decides");
  for (Eigen::Index k = 0; k < n; ++k) {
    const FreeParameter& p = parameters[std::size_t(k)];
    if (!(information[k] > 0))
      warn(p.name + " has no effect on these readings: it stays where it was");
    else if (!std::isfinite(out.sd[k]))
      warn(p.name + " is not determined by these readings, and no prior says what it is: give it one or leave it out");
    if (std::abs(out.shift[k]) > 2)
      warn(p.name + " moved by " + number(out.shift[k]) +
           " prior standard deviations: its prior is too narrow, or it stands in for something else");
    const double margin = 1e-6 * out.sd[k];
    if (out.values[k] <= p.low + margin || out.values[k] >= p.high - margin)
      warn(p.name + " stopped at its bound " + number(out.values[k]));
  }
  if (posterior.singular() && out.sd.allFinite()) warn("some combination of the parameters is not determined");
  for (int kind = 0; kind < 2; ++kind) {
    const auto used = (use.col(kind).array() > 0).count();
    const auto low = used - (out.weights.col(kind).array() > 0.5 * use.col(kind).array()).count();
    if (low > 0.02 * double(used))
      warn(std::to_string(low) + " of " + std::to_string(used) + (kind ? " rotations" : " positions") +
           " are outliers and count for little");
  }
}

}  // namespace detail

/// Finds the most probable parameters given readings, priors and the tracker's noise.
///
/// Damped Gauss-Newton on the whitened residuals and the prior, repeated with lower weights for outliers; then from
/// other starts. Linear in the rows; memory for two matrices of 6 rows x parameters and the field's factors.
/// Deterministic for a deterministic predictor.
/// @param places  (rows, 3) where the sensor was, tracker frame [m]: field errors are alike where places are near
/// @throws std::invalid_argument where no fit is possible, in words, one sentence a line. Real time: no.
/// Ref: effects of the prior and of the noise as in Tarantola, "Inverse Problem Theory", 2005, sect. 3.
inline Identification identify(const Predictor& predict, const std::vector<FreeParameter>& parameters,
                               const Noise& noise, const Eigen::MatrixX3d& places, const IdentifyOptions& options = {}) {
  detail::check(parameters, noise, places, options);
  const auto n = Eigen::Index(parameters.size());
  Eigen::VectorXd x(n), sd(n), residual;
  Eigen::MatrixXd jacobian;
  for (Eigen::Index k = 0; k < n; ++k) {
    const FreeParameter& p = parameters[std::size_t(k)];
    x[k] = std::clamp(options.start ? (*options.start)[k] : p.mean, p.low, p.high);
    sd[k] = p.sd;
  }
  if (!predict(x, residual, &jacobian))
    throw std::invalid_argument("the readings cannot be predicted at the starting values");
  if (residual.size() != 6 * places.rows() || jacobian.rows() != residual.size() || jacobian.cols() != n)
    throw std::invalid_argument("the predictor, the parameters and the places do not fit together");
  const RowWeights is_measured = detail::measured(residual);
  const RowWeights use = options.weights ? is_measured.cwiseProduct(*options.weights) : is_measured;
  if (!(use.array() > 0).any()) throw std::invalid_argument("no reading is left to fit: nothing was measured or solved");

  const bool smooth = noise.position_field > 0 || noise.rotation_field > 0;
  const SmoothField field = smooth ? detail::field_at(places, noise)
                                   : SmoothField{Eigen::MatrixXd(places.rows(), 0), Eigen::VectorXd::Zero(places.rows())};
  Identification out;
  out.weights = use;
  out.whitening = Whitening(noise, field, use);
  // Without a prior a parameter is scaled by what the readings say of it.
  out.whitening.apply(jacobian);
  for (Eigen::Index k = 0; k < n; ++k)
    if (!std::isfinite(sd[k])) sd[k] = jacobian.col(k).norm() > 0 ? 1 / jacobian.col(k).norm() : 1.0;
  detail::Objective objective(predict, parameters, sd, places.rows());
  objective.set_whitening(out.whitening);

  Eigen::VectorXd z = objective.z(x);
  detail::Descent best;
  const auto descend_robustly = [&] {
    constexpr int rounds = 6;
    constexpr double settled = 0.02;
    for (int round = 0; round < rounds; ++round) {
      best = detail::descend(objective, parameters, options.max_iterations, z);
      out.iterations += best.iterations;
      if (!options.robust || options.weights || round + 1 == rounds || !objective.predict(z, residual, nullptr)) return;
      const RowWeights weights = outlier_weights(noise, out.whitening, residual, use);
      if ((weights - out.weights).cwiseAbs().maxCoeff() < settled) return;
      out.weights = weights;
      out.whitening = Whitening(noise, field, weights);
    }
  };
  Eigen::MatrixXd information;
  const auto linearise = [&] {
    if (!objective.predict(z, residual, &jacobian))
      throw std::invalid_argument("the readings cannot be predicted at the fitted values");
    out.whitening.apply(residual);
    out.whitening.apply(jacobian);
    jacobian *= sd.asDiagonal();
    information = Eigen::MatrixXd::Zero(n, n);
    information.selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose());
    information = information.selfadjointView<Eigen::Lower>();
  };
  descend_robustly();
  linearise();

  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (int start = 1; start < options.starts; ++start) {
    Eigen::VectorXd other = z;
    for (Eigen::Index k = 0; k < n; ++k) {
      const FreeParameter& p = parameters[std::size_t(k)];
      const double drawn = normal(random);
      if (std::isfinite(p.sd)) other[k] = (std::clamp(p.mean + p.sd * drawn, p.low, p.high) - p.mean) / p.sd;
    }
    Eigen::VectorXd unused;
    bool solved = objective.predict(other, unused, nullptr);
    for (int halving = 0; halving < 5 && !solved; ++halving) {
      other = 0.5 * (other + z);
      solved = objective.predict(other, unused, nullptr);
    }
    if (!solved) continue;
    const Eigen::MatrixXd precision = information + Eigen::MatrixXd(objective.prior().asDiagonal());
    detail::Arrival arrival(other, z, precision);
    const detail::Descent there = detail::descend(objective, parameters, options.max_iterations, other, &arrival);
    out.iterations += there.iterations;
    out.starts.push_back({there.cost, arrival.distance(), there.converged});
    if (there.cost < best.cost - 0.5 && arrival.distance() > 0.5) {
      out.warnings.push_back("a start drawn from the prior led to a better place than the first one");
      z = other;
      descend_robustly();
      linearise();
    }
  }

  const Posterior posterior(information, objective.prior());
  out.values = objective.x(z);
  out.sd = sd.cwiseProduct(posterior.sd());
  out.covariance = sd.asDiagonal() * posterior.covariance() * sd.asDiagonal();
  out.shift = out.ratio = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN());
  for (Eigen::Index k = 0; k < n; ++k)
    if (objective.prior()[k] > 0) out.shift[k] = z[k], out.ratio[k] = posterior.sd()[k];
  for (Eigen::Index a = 0; a < n; ++a)
    for (Eigen::Index b = a + 1; b < n; ++b) {
      const double r = posterior.covariance()(a, b) / (posterior.sd()[a] * posterior.sd()[b]);
      if (std::abs(r) > options.strong_correlation) out.correlations.push_back({int(a), int(b), r});
    }
  std::sort(out.correlations.begin(), out.correlations.end(), [](const Correlation& a, const Correlation& b) {
    return std::abs(a.coefficient) > std::abs(b.coefficient);
  });
  out.directions = undetermined_directions(posterior, parameters, options.known);

  out.chi_square = residual.squaredNorm();
  out.shift_square = z.cwiseProduct(objective.prior()).squaredNorm();
  out.observations = out.whitening.observations();
  out.effective_parameters = posterior.effective_parameters();
  out.reduced_chi_square = out.chi_square / (double(out.observations) - out.effective_parameters);
  out.log_evidence = -0.5 * (out.chi_square + out.shift_square + posterior.log_determinant() +
                             out.whitening.log_determinant() +
                             double(out.observations) * std::log(2 * std::numbers::pi));
  if ((objective.prior().array() == 0).any()) out.log_evidence = std::numeric_limits<double>::quiet_NaN();

  // The length of the step still to be done, in posterior sd.
  const Eigen::VectorXd gradient = jacobian.transpose() * residual + objective.prior().cwiseProduct(z);
  const double left = std::sqrt(std::max(0.0, gradient.dot(posterior.covariance() * gradient)));
  out.converged = best.converged || left < 0.05;
  out.evaluations = objective.evaluations() + 1;
  out.status = out.converged
                   ? "converged"
                   : "not converged after " + std::to_string(best.iterations) + " iterations: a step of " +
                         detail::number(left) + " standard deviations is left";
  detail::add_warnings(parameters, posterior, information.diagonal(), use, out);
  return out;
}

/// What the fit says of each row that `predict` answers; they are the rows of the fit, more of them may be answered.
/// @throws std::invalid_argument where the rows are not those of the fit. Real time: no.
inline RowReport report_rows(const Identification& fit, const Predictor& predict) {
  RowReport out;
  (void)predict(fit.values, out.residual, &out.jacobian);
  const Eigen::Index rows = fit.weights.rows(), n = fit.values.size();
  if (out.residual.size() != 6 * rows || out.jacobian.cols() != n)
    throw std::invalid_argument("these are not the rows or the parameters of the fit");
  Eigen::VectorXd fitted = out.residual;
  out.field = fit.whitening.field(fitted);
  out.expected_square.resize(rows, 2);
  for (int kind = 0; kind < 2; ++kind) {
    const detail::ThreeAxes& axes = fit.whitening.axes(kind);
    const Eigen::MatrixXd J = Whitening::gathered(out.jacobian, kind);
    // Change of the parameters that a unit of the field at a row brings with it.
    const Eigen::MatrixXd shared = axes.field_mean(J);
    for (Eigen::Index i = 0; i < rows; ++i) {
      Eigen::Matrix<double, Eigen::Dynamic, 3> j(n, 3), s(n, 3);
      for (Eigen::Index k = 0; k < n; ++k) j.row(k) = J.row(i).segment<3>(3 * k), s.row(k) = shared.row(i).segment<3>(3 * k);
      const Eigen::Matrix<double, Eigen::Dynamic, 3> Cj = fit.covariance * j;
      const double parameters = Cj.cwiseProduct(j).sum(), common = Cj.cwiseProduct(s).sum();
      const bool was_fitted = fit.weights(i, kind) > 0;
      out.expected_square(i, kind) = 3 * axes.variance() + (was_fitted ? -parameters : parameters - 2 * common);
    }
  }
  return out;
}

}  // namespace ctcr
