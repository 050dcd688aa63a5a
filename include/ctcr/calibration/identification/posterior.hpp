#pragma once
// The Gaussian posterior of parameters, and the combinations of them that stay undetermined.
//
// Parameters are scaled by their prior sd, so that the prior's covariance is its correlations and every number below
// compares the posterior with the prior.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "ctcr/calibration/dense.hpp"
#include "ctcr/core/types.hpp"

namespace ctcr {

/// Parameter that a fit may move.
struct FreeParameter {
  std::string name;
  double mean;  ///< prior mean, in the parameter's own unit, as all below
  double sd;    ///< prior standard deviation, above 0; infinite: nothing is known before
  double low = -std::numeric_limits<double>::infinity();  ///< hard bounds
  double high = std::numeric_limits<double>::infinity();
};

/// A change of the parameters that is known to leave all readings (nearly) unchanged.
struct KnownDirection {
  std::string text;        ///< its meaning in words
  Eigen::VectorXd change;  ///< in the parameters' units
};

/// A combination of parameters that the readings (nearly) do not determine.
struct Direction {
  std::string text;
  double ratio;                  ///< posterior sd / prior sd along it
  Eigen::VectorXd coefficients;  ///< unit vector, in prior sd
};

/// Precision of the prior of scaled parameters: the inverse of its correlations (independent without any), and 0 for a
/// parameter without a prior, which correlates with no other.
inline Eigen::MatrixXd prior_precision(const std::vector<FreeParameter>& parameters,
                                       const std::optional<Eigen::MatrixXd>& correlations = {}) {
  const auto n = Eigen::Index(parameters.size());
  Eigen::MatrixXd precision = Eigen::MatrixXd::Identity(n, n);
  if (correlations) precision = correlations->ldlt().solve(precision).eval();
  for (Eigen::Index k = 0; k < n; ++k)
    if (!std::isfinite(parameters[std::size_t(k)].sd)) precision.row(k).setZero(), precision.col(k).setZero();
  return precision;
}

/// Gaussian approximation of the posterior in scaled parameters.
class Posterior {
public:
  /// @param information  J^T Sigma^-1 J   @param prior  precision of the prior
  Posterior(const Eigen::MatrixXd& information, const Eigen::MatrixXd& prior) {
    const Eigen::MatrixXd H = information + prior;
    // Equilibrated, so that a direction without information stands out whatever the units.
    const Eigen::VectorXd unit = (H.diagonal().array() > 0).select(H.diagonal().array().rsqrt(), 1.0);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(unit.asDiagonal() * H * unit.asDiagonal());
    constexpr double nothing = 1e-13;
    const Eigen::ArrayXd lambda = eigen.eigenvalues().array();
    const Eigen::ArrayXd inverse = (lambda > nothing).select(lambda.inverse(), 0.0);
    const Eigen::MatrixXd V = unit.asDiagonal() * eigen.eigenvectors();
    covariance_ = product(V * inverse.matrix().asDiagonal(), V.transpose());
    sd_ = covariance_.diagonal().cwiseMax(0.0).cwiseSqrt();
    for (Eigen::Index j = 0; j < lambda.size() && !(lambda[j] > nothing); ++j) {
      singular_ = true;
      for (Eigen::Index k = 0; k < sd_.size(); ++k)
        if (std::abs(eigen.eigenvectors()(k, j)) > 1e-3) sd_[k] = std::numeric_limits<double>::infinity();
    }
    log_determinant_ = lambda.max(nothing).log().sum() - 2 * unit.array().log().sum();
    effective_ = covariance_.cwiseProduct(information).sum();
  }

  [[nodiscard]] const Eigen::MatrixXd& covariance() const { return covariance_; }
  [[nodiscard]] const Eigen::VectorXd& sd() const { return sd_; }  ///< infinite where nothing is known
  [[nodiscard]] bool singular() const { return singular_; }        ///< some direction is not determined at all
  [[nodiscard]] double log_determinant() const { return log_determinant_; }  ///< of the posterior's precision
  [[nodiscard]] double effective_parameters() const { return effective_; }   ///< trace of the hat matrix

private:
  Eigen::MatrixXd covariance_;
  Eigen::VectorXd sd_;
  bool singular_ = false;
  double log_determinant_, effective_;
};

namespace detail {

/// Turns columns among themselves so that each has few large entries. Ref: Kaiser 1958 (varimax).
inline void make_simple(Eigen::MatrixXd& V) {
  for (int sweep = 0; sweep < 50; ++sweep) {
    double turned = 0;
    for (Eigen::Index a = 0; a + 1 < V.cols(); ++a)
      for (Eigen::Index b = a + 1; b < V.cols(); ++b) {
        const Eigen::ArrayXd x = V.col(a), y = V.col(b), u = x * x - y * y, v = 2 * x * y;
        const double count = double(V.rows()), U = u.sum(), W = v.sum();
        const double angle =
            0.25 * std::atan2(2 * ((u * v).sum() - U * W / count), (u * u - v * v).sum() - (U * U - W * W) / count);
        V.col(a) = std::cos(angle) * x + std::sin(angle) * y;
        V.col(b) = std::cos(angle) * y - std::sin(angle) * x;
        turned = std::max(turned, std::abs(angle));
      }
    if (turned < 1e-6) break;
  }
}

/// "a - 0.6 b" of the leading entries.
inline std::string combination(const Eigen::VectorXd& v, const std::vector<FreeParameter>& parameters) {
  constexpr double leading = 0.25;
  std::vector<Eigen::Index> order(std::size_t(v.size()));
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = Eigen::Index(k);
  std::stable_sort(order.begin(), order.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return std::abs(v[a]) > std::abs(v[b]) * (1 + 1e-9); });
  const double first = v[order[0]];
  std::string text;
  for (const Eigen::Index k : order) {
    const double share = v[k] / first;
    if (std::abs(share) < leading) break;
    if (!text.empty()) text += share < 0 ? " - " : " + ";
    char factor[16] = "";
    if (std::abs(share) < 0.95) std::snprintf(factor, sizeof factor, "%.1f ", std::abs(share));
    text += factor + parameters[std::size_t(k)].name;
  }
  return text;
}

}  // namespace detail

/// Two parameters that the readings hardly tell apart.
struct Correlation {
  int first, second;
  double coefficient;
};

/// Posterior correlations beyond `threshold`, the strongest first.
inline std::vector<Correlation> strong_correlations(const Posterior& posterior, double threshold) {
  std::vector<Correlation> found;
  for (Eigen::Index a = 0; a < posterior.sd().size(); ++a)
    for (Eigen::Index b = a + 1; b < posterior.sd().size(); ++b) {
      const double r = posterior.covariance()(a, b) / (posterior.sd()[a] * posterior.sd()[b]);
      if (std::abs(r) > threshold) found.push_back({int(a), int(b), r});
    }
  std::ranges::sort(found, std::greater(), [](const Correlation& c) { return std::abs(c.coefficient); });
  return found;
}

/// Directions along which the posterior is wider than `limit` times the prior: first those of `known` for which that
/// holds, with their words, then the rest, each with as few parameters as possible.
/// @param correlations  of the prior; independent without any
inline std::vector<Direction> undetermined_directions(const Posterior& posterior,
                                                      const std::vector<FreeParameter>& parameters,
                                                      const std::vector<KnownDirection>& known = {},
                                                      const std::optional<Eigen::MatrixXd>& correlations = {},
                                                      double limit = 0.7) {
  const Eigen::Index n = Eigen::Index(parameters.size());
  // Without a prior there is nothing to compare with: a parameter nobody knew is either determined or singular.
  Eigen::VectorXd finite(n);
  for (Eigen::Index k = 0; k < n; ++k) finite[k] = std::isfinite(parameters[std::size_t(k)].sd);
  const Eigen::MatrixXd C = finite.asDiagonal() * posterior.covariance() * finite.asDiagonal();
  std::vector<Direction> found;
  const auto add = [&](const Eigen::VectorXd& v, std::string text) {
    const double prior = correlations ? v.dot(*correlations * v) : v.squaredNorm();
    const double ratio = std::sqrt(std::max(0.0, v.dot(C * v)) / prior);
    if (ratio > limit) found.push_back({std::move(text), ratio, v});
    return ratio > limit;
  };
  Eigen::MatrixXd taken(n, 0);  // orthonormal
  for (const KnownDirection& direction : known) {
    Eigen::VectorXd v(n);
    for (Eigen::Index k = 0; k < n; ++k)
      v[k] = finite[k] > 0 ? direction.change[k] / parameters[std::size_t(k)].sd : 0.0;
    if (!(v.norm() > 0)) continue;
    v.normalize();
    if (!add(v, direction.text + " (" + detail::combination(v, parameters) + ")")) continue;
    v -= taken * (taken.transpose() * v);
    if (!(v.norm() > 1e-6)) continue;
    taken.conservativeResize(n, taken.cols() + 1);
    taken.rightCols(1) = v.normalized();
  }
  const Eigen::MatrixXd apart = Eigen::MatrixXd::Identity(n, n) - product(taken, taken.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(product(product(apart, C), apart));
  const Eigen::Index open = (eigen.eigenvalues().array() > limit * limit).count();
  Eigen::MatrixXd V = eigen.eigenvectors().rightCols(open);
  detail::make_simple(V);
  std::vector<Direction> rest;
  std::swap(rest, found);
  for (Eigen::Index j = 0; j < open; ++j) {
    Eigen::VectorXd v = V.col(j);
    Eigen::Index largest;
    v.cwiseAbs().maxCoeff(&largest);
    if (v[largest] < 0) v = -v;
    add(v, detail::combination(v, parameters));
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Direction& a, const Direction& b) { return a.ratio > b.ratio; });
  rest.insert(rest.end(), found.begin(), found.end());
  return rest;
}

}  // namespace ctcr
