#pragma once
// Parameters identified together from a table of readings: the most probable values given Gaussian priors and the noise
// of the tracker, how certain they are, and what the readings cannot say.
#include <numbers>
#include <random>

#include "ctcr/calibration/identification/descent.hpp"
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

/// Rows that count, an outlier by the share of it that is none.
inline double bulk_rows(const RowWeights& weights, int kind) { return weights.col(kind).array().min(1.0).sqrt().sum(); }

/// Rows of a table that are fitted, taken out of columns of six entries a row: the others may be many.
class FittedRows {
public:
  explicit FittedRows(const RowWeights& use) {
    for (Eigen::Index i = 0; i < use.rows(); ++i)
      if ((use.row(i).array() > 0).any()) rows_.push_back(i);
    for (const Eigen::Index i : rows_)
      for (Eigen::Index entry = 6 * i; entry < 6 * i + 6; ++entry) entries_.push_back(entry);
  }

  [[nodiscard]] Predictor predictor(const Predictor& predict) const {
    return [this, &predict, residual = Eigen::VectorXd(), jacobian = Eigen::MatrixXd()](
               const Eigen::VectorXd& x, Eigen::VectorXd& some, Eigen::MatrixXd* slopes) mutable {
      if (!predict(x, residual, slopes ? &jacobian : nullptr)) return false;
      some = of(residual);
      if (slopes) *slopes = of(jacobian);
      return true;
    };
  }
  [[nodiscard]] Eigen::MatrixXd of(const Eigen::MatrixXd& columns) const { return columns(entries_, Eigen::all); }
  [[nodiscard]] SmoothField field(const SmoothField& field) const {
    return {field.factor(rows_, Eigen::all), field.rest(rows_)};
  }
  [[nodiscard]] RowWeights weights(const RowWeights& weights) const { return weights(rows_, Eigen::all); }
  /// Weights of all rows, 0 where they are not fitted.
  [[nodiscard]] RowWeights among(Eigen::Index rows, const RowWeights& weights) const {
    RowWeights all = RowWeights::Zero(rows, 2);
    all(rows_, Eigen::all) = weights;
    return all;
  }

private:
  std::vector<Eigen::Index> rows_, entries_;
};

/// The factor of the field error at the places of a table, fine enough for its noise.
inline SmoothField field_at(const Eigen::MatrixX3d& places, const Noise& noise) {
  constexpr double negligible = 0.01;  // of the jitter's variance
  const auto tolerance = [](double jitter, double field) { return negligible * jitter * jitter / (field * field); };
  return smooth_field(places, noise.correlation_length,
                      std::min(tolerance(noise.position_jitter, noise.position_field),
                               tolerance(noise.rotation_jitter, noise.rotation_field)));
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
                               const Noise& noise, const Eigen::MatrixX3d& places,
                               const IdentifyOptions& options = {}) {
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
  const RowWeights given = options.weights ? is_measured.cwiseProduct(*options.weights) : is_measured;
  if (!(given.array() > 0).any())
    throw std::invalid_argument("no reading is left to fit: nothing was measured or solved");
  const detail::FittedRows fitted(given);
  const RowWeights use = fitted.weights(given);
  const Predictor predict_fitted = fitted.predictor(predict);
  residual = fitted.of(residual), jacobian = fitted.of(jacobian);

  const bool smooth = noise.position_field > 0 || noise.rotation_field > 0;
  const SmoothField field_everywhere =
      smooth ? detail::field_at(places, noise)
             : SmoothField{Eigen::MatrixXd(places.rows(), 0), Eigen::VectorXd::Zero(places.rows())};
  const SmoothField field = fitted.field(field_everywhere);
  Identification out;
  out.weights = use;
  if (options.inflation) out.inflation = *options.inflation;
  const auto inflated = [&] {
    RowWeights weights = out.weights;
    for (int kind = 0; kind < 2; ++kind) weights.col(kind) /= out.inflation[kind] * out.inflation[kind];
    return weights;
  };
  const auto set_whitening = [&] { out.whitening = Whitening(noise, field, inflated()); };
  set_whitening();
  // Without a prior a parameter is scaled by what the readings say of it.
  for (Eigen::Index k = 0; k < n; ++k)
    if (!std::isfinite(sd[k])) {
      Eigen::VectorXd slope = jacobian.col(k);
      out.whitening.apply(slope);
      sd[k] = slope.norm() > 0 ? 1 / slope.norm() : 1.0;
    }
  detail::Objective objective(predict_fitted, parameters, sd);
  objective.set_whitening(out.whitening);
  const detail::Bounds bounds(parameters, options.within, sd);

  Eigen::VectorXd z = objective.z(x);
  objective.know(z, residual, std::move(jacobian));
  detail::Descent best;
  detail::Linearised here;
  const auto precision = [&] {
    return Eigen::MatrixXd(here.information + Eigen::MatrixXd(objective.prior().asDiagonal()));
  };
  const auto linearise = [&] {
    if (!objective.linearise(z, here))
      throw std::invalid_argument("the readings cannot be predicted at the fitted values");
  };
  const bool finds_weights = options.robust && !options.weights;
  const bool finds_inflation = options.admit_model_error && !options.inflation;
  if (finds_weights && options.first_weights) out.weights = use.cwiseProduct(fitted.weights(*options.first_weights));
  // The inflation with which a residual would be no surprise.
  const auto inflate = [&](const Eigen::VectorXd& left) {
    const Whitening stated(noise, field, out.weights);
    for (int kind = 0; kind < 2; ++kind) {
      const double rows = detail::bulk_rows(out.weights, kind);
      out.inflation[kind] = std::sqrt(stated.axes(kind).inflation(Whitening::gathered(left, kind), 3 * rows));
    }
  };
  // Weights and inflation that belong to the best parameters of the model linearised at z, found without predictions.
  // Returns whether they are others than before.
  const auto settle = [&] {
    constexpr int rounds = 20;
    const double settled = std::max(0.5, 1e-3 * double(places.rows()));  // rows
    for (int round = 0; round < rounds; ++round) {
      linearise();
      const auto* point = objective.at(z);
      const Eigen::VectorXd step = bounds.step(z, here.gradient, precision());
      const Eigen::VectorXd left = point->residual + point->jacobian * sd.cwiseProduct(step);
      const RowWeights weights = out.weights;
      const Eigen::Array2d inflation = out.inflation;
      if (finds_weights) out.weights = outlier_weights(noise, out.inflation, out.whitening, left, use);
      if (finds_inflation) inflate(left);
      const double changed = (weights - out.weights).cwiseAbs().sum();
      if (changed < settled && (out.inflation / inflation).log().abs().maxCoeff() < 0.02) {
        out.weights = weights, out.inflation = inflation;  // those that the whitening has
        return round > 0;
      }
      set_whitening();
    }
    return true;
  };
  const auto descend = [&](double tolerance) {
    best = detail::descend(objective, bounds, options.max_iterations, tolerance, z);
    out.iterations += best.iterations;
  };
  const auto descend_robustly = [&] {
    constexpr int rounds = 8;
    const double round_tolerance = std::max(0.5, options.tolerance);
    for (int round = 0; (finds_weights || finds_inflation) && round < rounds; ++round) {
      descend(round_tolerance);
      if (!objective.at(z) || !settle()) break;
    }
    descend(options.tolerance);
  };
  // The first descent takes all that is wrong at the start for noise: far from the truth, details mislead.
  if (finds_inflation) inflate(residual);
  set_whitening();
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
    other = bounds.clamped(other);
    for (int halving = 0; halving < 5 && !objective.at(other); ++halving) other = 0.5 * (other + z);
    if (!objective.at(other)) continue;
    const detail::Goal goal{z, precision()};
    const detail::Descent there =
        detail::descend(objective, bounds, options.max_iterations, options.tolerance, other, &goal);
    out.iterations += there.iterations;
    out.starts.push_back({there.cost, goal.distance(other), there.converged});
    if (there.cost < best.cost - 0.5 && goal.distance(other) > 0.5) {
      out.warnings.push_back("a start drawn from the prior led to a better place than the first one");
      z = other;
      descend_robustly();
      linearise();
    }
  }

  const Posterior posterior(here.information, objective.prior());
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

  residual = objective.at(z)->residual;
  Whitening(noise, field, out.weights).apply(residual);
  out.chi_square = residual.squaredNorm();
  out.admitted_chi_square = here.chi_square;
  out.shift_square = z.cwiseProduct(objective.prior()).squaredNorm();
  out.observations = out.whitening.observations();
  out.effective_parameters = posterior.effective_parameters();
  out.bulk_observations = 3 * (detail::bulk_rows(out.weights, 0) + detail::bulk_rows(out.weights, 1));
  out.reduced_chi_square = out.chi_square / (out.bulk_observations - out.effective_parameters);
  out.log_evidence =
      -0.5 * (here.chi_square + out.shift_square + posterior.log_determinant() + out.whitening.log_determinant() +
              double(out.observations) * std::log(2 * std::numbers::pi));
  if ((objective.prior().array() == 0).any()) out.log_evidence = std::numeric_limits<double>::quiet_NaN();

  const double left = bounds.step_left(z, here.gradient, precision());
  out.converged = left < 0.05 || best.converged;
  out.evaluations = objective.evaluations() + 1;
  out.status = out.converged ? (best.at_kink && left >= 0.05 ? "converged, at a kink of the model" : "converged")
                             : "not converged after " + std::to_string(best.iterations) + " iterations: a step of " +
                                   detail::number(left) + " standard deviations is left";
  detail::add_warnings(parameters, posterior, here.information.diagonal(), bounds.reached(z), use, out);
  out.whitening = Whitening(noise, field_everywhere, fitted.among(places.rows(), inflated()));
  out.weights = fitted.among(places.rows(), out.weights);
  return out;
}

}  // namespace ctcr
