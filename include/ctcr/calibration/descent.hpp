#pragma once
// From a starting point down to the nearest minimum of minus the log of a posterior.
#include "ctcr/calibration/bounds.hpp"
#include "ctcr/calibration/identification.hpp"

namespace ctcr {
namespace detail {

/// Minus the log of a posterior near a point z, up to a constant: chi_square / 2 + prior . z^2 / 2 and its derivatives.
struct Linearised {
  double chi_square = 0, cost = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;  ///< J^T J of the whitened residual; with the prior the Gauss-Newton Hessian
};

/// A posterior in scaled parameters z, x = origin + scale z.
class Objective {
public:
  Objective(const Predictor& predict, const std::vector<FreeParameter>& parameters, Eigen::VectorXd scale)
    : predict_(predict), scale_(std::move(scale)), origin_(scale_.size()), prior_(scale_.size()) {
    for (Eigen::Index k = 0; k < scale_.size(); ++k) {
      const FreeParameter& p = parameters[std::size_t(k)];
      origin_[k] = p.mean;
      prior_[k] = std::isfinite(p.sd);
    }
  }

  Eigen::VectorXd x(const Eigen::VectorXd& z) const { return origin_ + scale_.cwiseProduct(z); }
  Eigen::VectorXd z(const Eigen::VectorXd& x) const { return (x - origin_).cwiseQuotient(scale_); }
  const Eigen::VectorXd& prior() const { return prior_; }  ///< precision, 1 or 0
  int evaluations() const { return evaluations_; }

  void set_whitening(const Whitening& whitening) { whitening_ = &whitening; }

  /// What is predicted at z.
  struct Point {
    Eigen::VectorXd z, residual;
    Eigen::MatrixXd jacobian;  ///< by x
    bool predicted = false;
  };
  /// Residual and derivatives are predicted at once, and kept: of what a descent tries it keeps nearly all, and asks for
  /// it again. Null where the prediction fails; valid until the next call.
  const Point* at(const Eigen::VectorXd& z) {
    if (point_.z.size() != z.size() || point_.z != z) {
      ++evaluations_;
      point_.z = z;
      point_.predicted = predict_(x(z), point_.residual, &point_.jacobian);
    }
    return point_.predicted ? &point_ : nullptr;
  }
  /// Infinite where the prediction fails.
  double cost(const Eigen::VectorXd& z) {
    if (!at(z)) return std::numeric_limits<double>::infinity();
    Eigen::VectorXd residual = point_.residual;
    whitening_->apply(residual);
    const double cost = 0.5 * (residual.squaredNorm() + prior_.dot(z.cwiseAbs2()));
    return std::isfinite(cost) ? cost : std::numeric_limits<double>::infinity();
  }
  bool linearise(const Eigen::VectorXd& z, Linearised& out) {
    if (!at(z)) return false;
    Eigen::VectorXd residual = point_.residual;
    Eigen::MatrixXd jacobian = point_.jacobian * scale_.asDiagonal();
    whitening_->apply(residual);
    whitening_->apply(jacobian);
    out.chi_square = residual.squaredNorm();
    out.cost = 0.5 * (out.chi_square + prior_.dot(z.cwiseAbs2()));
    out.gradient = jacobian.transpose() * residual + prior_.cwiseProduct(z);
    out.information.setZero(z.size(), z.size());
    out.information.selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose());
    out.information = out.information.selfadjointView<Eigen::Lower>();
    return std::isfinite(out.cost) && out.information.allFinite();
  }

private:
  const Predictor& predict_;
  Eigen::VectorXd scale_, origin_, prior_;
  const Whitening* whitening_ = nullptr;
  Point point_;
  int evaluations_ = 0;
};

/// Where another descent has been, and how far is far from there.
struct Goal {
  Eigen::VectorXd z;
  Eigen::MatrixXd precision;
  [[nodiscard]] double distance(const Eigen::VectorXd& from) const {
    return std::sqrt(std::max(0.0, (from - z).dot(precision * (from - z))));
  }
};

struct Descent {
  double cost = std::numeric_limits<double>::infinity();
  double left = std::numeric_limits<double>::infinity();  ///< length of the step still to be done, in posterior sd
  bool converged = false;
  int iterations = 0;
};

/// Goes down from z to the nearest minimum within bounds: Levenberg-Marquardt, each step the exact minimum of its model
/// within the bounds (Ceres projects its steps onto them instead, which stalls where parameters go together).
/// @param goal  ends the descent where it is about to arrive there; or null
/// Ref: damping as in Nielsen, "Damping parameter in Marquardt's method", 1999.
inline Descent descend(Objective& objective, const Bounds& bounds, int max_iterations, Eigen::VectorXd& z,
                       const Goal* goal = nullptr) {
  constexpr double arrived = 0.1, settled = 0.003;  // posterior sd
  constexpr double most_damping = 1e10;
  Descent out;
  z = bounds.clamped(z);
  Linearised here;
  if (!objective.linearise(z, here)) return out;
  double damping = 1e-4;
  for (bool moved = true; moved && out.iterations < max_iterations; ++out.iterations) {
    moved = false;
    const Eigen::MatrixXd H = here.information + Eigen::MatrixXd(objective.prior().asDiagonal());
    out.converged = bounds.step_left(z, here.gradient, H) < settled || (goal && goal->distance(z) < arrived);
    if (out.converged) break;
    for (double growth = 2; damping < most_damping && !moved; damping *= moved ? 1 : growth, growth *= 2) {
      Eigen::MatrixXd damped = H;
      damped.diagonal() += damping * H.diagonal();
      const Eigen::VectorXd step = bounds.step(z, here.gradient, damped);
      const double foreseen = -step.dot(here.gradient + 0.5 * (H * step));
      const double gain = (here.cost - objective.cost(z + step)) / foreseen;
      if (!(gain > 1e-3)) continue;
      z += step;
      damping *= std::max(1.0 / 3, 1 - std::pow(2 * gain - 1, 3));
      if (!objective.linearise(z, here)) return out;
      moved = true;
    }
  }
  out.cost = here.cost;
  return out;
}

}  // namespace detail

}  // namespace ctcr
