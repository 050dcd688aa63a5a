#pragma once
// Bounds of parameters and of sums of them, and the best step within them.
#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "ctcr/calibration/identification/posterior.hpp"

namespace ctcr {

/// A sum of parameters that must not fall below a value: change . (x - mean) >= low, with low <= 0.
struct LinearBound {
  std::string text;        ///< what happens there, in words: the fit "stopped where <text>"
  Eigen::VectorXd change;  ///< one number a parameter, in the inverse of its unit
  double low;
};

namespace detail {

/// The bounds of scaled parameters z = (x - mean) / scale, in coordinates y = T z each of which has its own.
///
/// Bounds that are nearest to z = 0 become coordinates first, as many as there are parameters; those that depend on
/// nearer ones are not kept: where a descent goes beyond one of them, the prediction may fail.
class Bounds {
public:
  Bounds(const std::vector<FreeParameter>& parameters, const std::vector<LinearBound>& within,
         const Eigen::VectorXd& scale) {
    const Eigen::Index n = scale.size();
    std::vector<Side> sides;
    const auto add = [&](Eigen::VectorXd change, double limit, std::string text) {
      const double size = change.norm();
      if (size > 0 && std::isfinite(limit)) sides.push_back({change / size, limit / size, std::move(text)});
    };
    for (Eigen::Index k = 0; k < n; ++k) {
      const FreeParameter& p = parameters[std::size_t(k)];
      const Eigen::VectorXd axis = scale[k] * Eigen::VectorXd::Unit(n, k);
      add(axis, p.low - p.mean, {});
      add(-axis, p.mean - p.high, {});
    }
    for (const LinearBound& bound : within) add(scale.cwiseProduct(bound.change), bound.low, bound.text);
    std::stable_sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) { return a.limit > b.limit; });
    T_.resize(n, n), inverse_.resize(n, n);
    for (const Side& side : sides)
      if (!merge(side)) append(side);
    for (Eigen::Index k = 0; k < n; ++k) append({Eigen::VectorXd::Unit(n, k), -infinity, {}});
    low_.resize(n), high_.resize(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const Coordinate& y = coordinates_[std::size_t(k)];
      low_[k] = y.low;
      high_[k] = y.high;
    }
  }

  /// The nearest point within the bounds; to the last bit z where it is there already, as the descent keeps its
  /// prediction.
  [[nodiscard]] Eigen::VectorXd clamped(const Eigen::VectorXd& z) const {
    const Eigen::VectorXd y = T_ * z;
    if (y.cwiseMax(low_).cwiseMin(high_) == y) return z;
    // The axes of y may be nearly parallel: moving one coordinate to its bound alone could carry z far away.
    return step(Eigen::VectorXd::Zero(z.size()), -z, Eigen::MatrixXd::Identity(z.size(), z.size()));
  }
  /// The step from z (which keeps the bounds) to the minimum within the bounds of a quadratic function with this gradient
  /// there and this positive definite Hessian. Active set: goes towards the free minimum up to the first bound, and
  /// leaves a bound that holds it back no more.
  [[nodiscard]] Eigen::VectorXd step(const Eigen::VectorXd& z, const Eigen::VectorXd& gradient,
                                     const Eigen::MatrixXd& hessian) const {
    const Eigen::Index n = z.size();
    const Eigen::VectorXd at = T_ * z, g = inverse_.transpose() * gradient;
    const Eigen::MatrixXd H = transposed_product(inverse_, product(hessian, inverse_));
    const Eigen::VectorXd low = (low_ - at).cwiseMin(0.0), high = (high_ - at).cwiseMax(0.0);
    Eigen::VectorXd d = Eigen::VectorXd::Zero(n);
    std::vector<bool> stands(std::size_t(n), false);
    for (Eigen::Index round = 0; round < 10 * n; ++round) {
      std::vector<Eigen::Index> free;
      for (Eigen::Index k = 0; k < n; ++k)
        if (!stands[std::size_t(k)]) free.push_back(k);
      const Eigen::VectorXd slope = g + H * d;
      Eigen::VectorXd change = Eigen::VectorXd::Zero(n);
      const Eigen::MatrixXd H_free = H(free, free);
      const Eigen::VectorXd slope_free = slope(free);
      change(free) = -H_free.ldlt().solve(slope_free);
      double share = 1;
      Eigen::Index first = -1;
      for (const Eigen::Index k : free) {
        const double room = change[k] < 0 ? low[k] - d[k] : high[k] - d[k];
        if (std::abs(change[k]) * share > std::abs(room)) share = room / change[k], first = k;
      }
      d += share * change;
      if (first >= 0) {
        d[first] = change[first] < 0 ? low[first] : high[first];
        stands[std::size_t(first)] = true;
        continue;
      }
      const Eigen::VectorXd pull = g + H * d;  // at a bound: away from it where the bound is in the way no more
      Eigen::Index worst = -1;
      for (Eigen::Index k = 0; k < n; ++k) {
        if (!stands[std::size_t(k)]) continue;
        const double inwards = (d[k] == low[k] ? -pull[k] : pull[k]) / std::sqrt(H(k, k));
        if (inwards > 1e-9 && (worst < 0 || inwards > std::abs(pull[worst]) / std::sqrt(H(worst, worst)))) worst = k;
      }
      if (worst < 0) break;
      stands[std::size_t(worst)] = false;
    }
    return inverse_ * d;
  }
  /// Length of the undamped step still to be done from z, in posterior sd.
  [[nodiscard]] double step_left(const Eigen::VectorXd& z, const Eigen::VectorXd& gradient,
                                 const Eigen::MatrixXd& precision) const {
    const Eigen::VectorXd d = step(z, gradient, precision);
    return std::sqrt(std::max(0.0, d.dot(precision * d)));
  }
  /// The words of the sums that stand at their bound.
  [[nodiscard]] std::vector<std::string> reached(const Eigen::VectorXd& z) const {
    const Eigen::VectorXd at = T_ * z;
    std::vector<std::string> found;
    for (std::size_t k = 0; k < coordinates_.size(); ++k) {
      const Coordinate& y = coordinates_[k];
      if (!y.at_low.empty() && at[Eigen::Index(k)] <= y.low + at_bound) found.push_back(y.at_low);
      if (!y.at_high.empty() && at[Eigen::Index(k)] >= y.high - at_bound) found.push_back(y.at_high);
    }
    return found;
  }

private:
  static constexpr double infinity = std::numeric_limits<double>::infinity(), at_bound = 1e-6;

  /// change . z >= limit, change of length 1.
  struct Side {
    Eigen::VectorXd change;
    double limit;
    std::string text;
  };
  /// y = change . z
  struct Coordinate {
    Eigen::VectorXd change;
    double low, high;
    std::string at_low, at_high;
  };

  /// Takes a side in where it bounds a coordinate that there is, from below or from above.
  bool merge(const Side& side) {
    constexpr double parallel = 1 - 1e-9;
    for (Coordinate& y : coordinates_) {
      const double cosine = y.change.dot(side.change);
      if (cosine > parallel && side.limit > y.low) y.low = side.limit, y.at_low = side.text;
      if (cosine < -parallel && -side.limit < y.high) y.high = -side.limit, y.at_high = side.text;
      if (std::abs(cosine) > parallel) return true;
    }
    return false;
  }
  /// Adds a side as a coordinate, unless it depends linearly on the present ones.
  void append(const Side& side) {
    constexpr double dependent = 1e-3;
    Eigen::VectorXd apart = side.change;
    for (int pass = 0; pass < 2; ++pass)
      for (const Eigen::VectorXd& axis : axes_) apart -= axis * axis.dot(apart);
    if (!(apart.norm() > dependent)) return;
    axes_.push_back(apart.normalized());
    const auto last = Eigen::Index(coordinates_.size());
    T_.row(last) = side.change.transpose();
    // A step along the new axis moves no coordinate before; the columns before must not move the new one.
    inverse_.col(last) = axes_.back() / axes_.back().dot(side.change);
    for (Eigen::Index k = 0; k < last; ++k) inverse_.col(k) -= side.change.dot(inverse_.col(k)) * inverse_.col(last);
    coordinates_.push_back({side.change, side.limit, infinity, side.text, {}});
  }

  std::vector<Coordinate> coordinates_;
  std::vector<Eigen::VectorXd> axes_;  ///< orthonormal
  Eigen::MatrixXd T_, inverse_;
  Eigen::VectorXd low_, high_;  ///< of y
};

}  // namespace detail
}  // namespace ctcr
