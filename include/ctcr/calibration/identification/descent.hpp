#pragma once
// From a starting point down to the nearest minimum of minus the log of a posterior.
#include "ctcr/calibration/identification/bounds.hpp"
#include "ctcr/calibration/identification/identification.hpp"

namespace ctcr {
namespace detail {

/// Minus the log of a posterior near a point z, up to a constant: chi_square / 2 + z . prior z / 2 and its derivatives.
struct Linearised {
  double chi_square = 0, cost = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;  ///< J^T J of the whitened residual
  Eigen::MatrixXd hessian;      ///< Gauss-Newton: information and prior
};

/// A posterior in scaled parameters z, x = origin + scale z.
class Objective {
public:
  Objective(const Predictor& predict, const std::vector<FreeParameter>& parameters, Eigen::VectorXd scale,
            Eigen::MatrixXd prior)
    : predict_(predict), scale_(std::move(scale)), origin_(scale_.size()), prior_(std::move(prior)) {
    for (Eigen::Index k = 0; k < scale_.size(); ++k) origin_[k] = parameters[std::size_t(k)].mean;
  }

  Eigen::VectorXd x(const Eigen::VectorXd& z) const { return origin_ + scale_.cwiseProduct(z); }
  Eigen::VectorXd z(const Eigen::VectorXd& x) const { return (x - origin_).cwiseQuotient(scale_); }
  const Eigen::MatrixXd& prior() const { return prior_; }  ///< precision
  /// Of a shift from the prior mean: its square in the metric of the prior.
  double shift_square(const Eigen::VectorXd& z) const { return z.dot(prior_ * z); }
  int evaluations() const { return evaluations_; }

  void set_whitening(Whitening whitening) { whitening_ = std::move(whitening); }
  const Whitening& whitening() const { return whitening_; }

  /// A prediction at z.
  struct Point {
    Eigen::VectorXd z, residual;
    Eigen::MatrixXd jacobian;  ///< by x
    bool predicted = false;
  };
  /// Stores a prediction that was made before.
  void know(const Eigen::VectorXd& z, Eigen::VectorXd residual, Eigen::MatrixXd jacobian) {
    point_ = {z, std::move(residual), std::move(jacobian), true};
  }
  /// Residual and derivatives are predicted at once, and kept: of what a descent tries it keeps nearly all, and asks for
  /// it again. Null where the prediction fails; valid until the next call.
  const Point* at(const Eigen::VectorXd& z) {
    if (held_.z.size() == z.size() && held_.z == z) return held_.predicted ? &held_ : nullptr;
    if (point_.z.size() != z.size() || point_.z != z) {
      ++evaluations_;
      point_.z = z;
      point_.predicted = predict_(x(z), point_.residual, &point_.jacobian);
    }
    return point_.predicted ? &point_ : nullptr;
  }
  /// Keeps the prediction at z while others are tried.
  void hold(const Eigen::VectorXd& z) {
    if (at(z) == &point_) std::swap(point_, held_);
  }
  /// Infinite where the prediction fails.
  double cost(const Eigen::VectorXd& z) {
    const Point* point = at(z);
    if (!point) return std::numeric_limits<double>::infinity();
    Eigen::VectorXd residual = point->residual;
    whitening_.apply(residual);
    const double cost = 0.5 * (residual.squaredNorm() + shift_square(z));
    return std::isfinite(cost) ? cost : std::numeric_limits<double>::infinity();
  }
  bool linearise(const Eigen::VectorXd& z, Linearised& out) {
    const Point* point = at(z);
    if (!point) return false;
    Eigen::VectorXd residual = point->residual;
    Eigen::MatrixXd jacobian = point->jacobian * scale_.asDiagonal();
    whitening_.apply(residual);
    whitening_.apply(jacobian);
    out.chi_square = residual.squaredNorm();
    out.cost = 0.5 * (out.chi_square + shift_square(z));
    out.gradient = jacobian.transpose() * residual + prior_ * z;
    out.information = transposed_product(jacobian, jacobian);
    out.hessian = out.information + prior_;
    return std::isfinite(out.cost) && out.information.allFinite();
  }

private:
  const Predictor& predict_;
  Eigen::VectorXd scale_, origin_;
  Eigen::MatrixXd prior_;
  Whitening whitening_;
  Point point_, held_;
  int evaluations_ = 0;
};

/// The minimum that another descent found, with the metric in which distances from it count.
struct Goal {
  Eigen::VectorXd z;
  Eigen::MatrixXd precision;
  [[nodiscard]] double distance(const Eigen::VectorXd& from) const {
    return std::sqrt(std::max(0.0, (from - z).dot(precision * (from - z))));
  }
};

struct Descent {
  double cost = std::numeric_limits<double>::infinity();
  bool converged = false;
  bool at_kink = false;  ///< converged where the derivatives jump: by those of this side the descent would go on
  int iterations = 0;
};

/// Change of a cost by a step, to second order: value + gradient . step + step^T hessian step / 2.
struct Quadratic {
  double value = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd hessian;
  double operator()(const Eigen::VectorXd& step) const { return value + step.dot(gradient + 0.5 * (hessian * step)); }
  /// The step from z to its minimum within the bounds, with damping added to the diagonal.
  Eigen::VectorXd minimum(const Bounds& bounds, const Eigen::VectorXd& z, const Eigen::VectorXd& damping) const {
    Eigen::MatrixXd damped = hessian;
    damped.diagonal() += damping;
    return bounds.step(z, gradient, damped);
  }
};

/// The combination (1 - t) a + t b, 0 <= t <= 1, whose minimum within the bounds is that of max(a, b), where a model a
/// foresaw too little at its own minimum and b is right there. Damping as in minimum().
inline Quadratic upper(const Quadratic& a, const Quadratic& b, const Bounds& bounds, const Eigen::VectorXd& z,
                       const Eigen::VectorXd& damping) {
  Quadratic mixed;
  double low = 0, high = 1;
  for (int halving = 0; halving < 20; ++halving) {
    const double t = halving == 0 ? 1.0 : 0.5 * (low + high);
    mixed.value = (1 - t) * a.value + t * b.value;
    mixed.gradient = (1 - t) * a.gradient + t * b.gradient;
    mixed.hessian = (1 - t) * a.hessian + t * b.hessian;
    const Eigen::VectorXd step = mixed.minimum(bounds, z, damping);
    const bool more_of_b = b(step) > a(step);
    if (halving == 0 && more_of_b) break;
    (more_of_b ? low : high) = t;
  }
  return mixed;
}

/// Goes down from z to the nearest minimum within bounds: Levenberg-Marquardt, each step the exact minimum of its model
/// within the bounds (Ceres projects its steps onto them instead, which stalls where parameters go together).
///
/// Where a tube's curve begins at the plate, or a load lifts off, derivatives jump, and the minimum may lie at such a
/// kink, where they never vanish. So a step that fails yields the derivatives on the other side, and the next one follows
/// the kink or finds that nothing is left to gain. That ends the descent only where short steps on this side, too, gain
/// nothing or next to nothing.
/// @param tolerance  of the cost; it may be left to gain at a kink. Elsewhere 0.15 times as many posterior sd may
/// @param goal       ends the descent where it is about to arrive there; or null
/// Ref: damping as in Nielsen, "Damping parameter in Marquardt's method", 1999; the model beyond a kink is an aggregated
/// bundle, Kiwiel 1983.
inline Descent descend(Objective& objective, const Bounds& bounds, int max_iterations, double tolerance,
                       Eigen::VectorXd& z, const Goal* goal = nullptr) {
  constexpr double arrived = 0.1, most_damping = 1e10;
  const double settled = 0.15 * tolerance, negligible = 0.01 * tolerance;
  Descent out;
  z = bounds.clamped(z);
  Linearised here, there;
  if (!objective.linearise(z, here)) return out;
  objective.hold(z);
  out.cost = here.cost;
  double damping = 1e-8;
  for (bool moved = true; moved && out.iterations < max_iterations; ++out.iterations) {
    moved = false;
    Quadratic model{0, here.gradient, here.hessian};
    const Eigen::VectorXd diagonal = model.hessian.diagonal();
    out.converged =
        bounds.step_left(z, here.gradient, model.hessian) < settled || (goal && goal->distance(z) < arrived);
    if (out.converged) break;
    bool kinked = false, doubted = false;
    for (double growth = 2; damping < most_damping && !moved; damping *= moved ? 1 : growth, growth *= 2) {
      const Eigen::VectorXd step = model.minimum(bounds, z, damping * diagonal);
      const double foreseen = -model(step);
      if (kinked && !doubted && foreseen < tolerance) {
        // A cost that is not convex, or a valley that bends, looks like a kink: short steps on this side distinguish them.
        doubted = true;
        model = {0, here.gradient, here.hessian};
        damping = std::max(damping, 1.0), growth = 15;
        continue;
      }
      const double gained = here.cost - objective.cost(z + step), gain = gained / foreseen;
      if (!(gain > 0.1)) {
        if (doubted || !objective.linearise(z + step, there)) continue;
        kinked = true;
        // The model of the other side, about z.
        Quadratic beyond{0, there.gradient - there.hessian * step, there.hessian};
        beyond.value = there.cost - here.cost - beyond(step);
        model = upper(model, beyond, bounds, z, damping * diagonal);
        continue;
      }
      z += step;
      damping *= std::max(1.0 / 3, 1 - std::pow(2 * gain - 1, 3));
      if (!objective.linearise(z, here)) return out;
      objective.hold(z);
      out.cost = here.cost;
      moved = true;
      out.at_kink = doubted && gained < negligible;
    }
    out.at_kink = out.at_kink || (doubted && !moved);
    out.converged = out.at_kink;
    if (out.at_kink) break;
  }
  return out;
}

}  // namespace detail

}  // namespace ctcr
