#pragma once
// From a starting point down to the nearest minimum of minus the log of a posterior, with Ceres.
#include <ceres/ceres.h>

#include "ctcr/calibration/identification.hpp"

namespace ctcr {
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

  /// Residual as predicted and its derivatives by x, or null where the prediction fails. Valid until the next call.
  ///
  /// Both are computed at once, and kept: of what a descent tries it keeps nearly all, and asks for it again.
  struct Point {
    Eigen::VectorXd z, residual;
    Eigen::MatrixXd jacobian;
    bool predicted = false;
  };
  const Point* at(const Eigen::VectorXd& z) const {
    if (point_.z.size() != z.size() || point_.z != z) {
      ++evaluations_;
      point_.z = z;
      point_.predicted = predict_(x(z), point_.residual, &point_.jacobian);
    }
    return point_.predicted ? &point_ : nullptr;
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Index n = scale_.size(), count = num_residuals() - n;
    const Eigen::VectorXd z = Eigen::Map<const Eigen::VectorXd>(parameters[0], n);
    const Point* point = at(z);
    if (!point) return false;
    Eigen::Map<Eigen::VectorXd> out(residuals, num_residuals());
    out.head(count) = point->residual;
    whitening_->apply(out.head(count));
    out.tail(n) = prior_.cwiseProduct(z);
    if (jacobians && jacobians[0]) {
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      Eigen::Map<RowMajor> J(jacobians[0], num_residuals(), n);
      Eigen::MatrixXd whitened = point->jacobian * scale_.asDiagonal();
      whitening_->apply(whitened);
      J.topRows(count) = whitened;
      J.bottomRows(n) = prior_.asDiagonal();
    }
    return out.allFinite();
  }

private:
  const Predictor& predict_;
  Eigen::VectorXd scale_, origin_, prior_;
  const Whitening* whitening_ = nullptr;
  mutable Point point_;
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

/// Bounds in scaled parameters.
struct Bounds {
  Eigen::VectorXd low, high;
  [[nodiscard]] bool hold(const Eigen::VectorXd& z) const {
    return (z.array() >= low.array()).all() && (z.array() <= high.array()).all();
  }
};

/// Goes down from z to the nearest minimum.
inline Descent descend_within(Objective& objective, const Bounds* bounds, int max_iterations, Eigen::VectorXd& z,
                              ceres::IterationCallback* callback) {
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  problem.AddResidualBlock(&objective, nullptr, z.data());
  for (Eigen::Index k = 0; bounds && k < z.size(); ++k) {
    if (std::isfinite(bounds->low[k])) problem.SetParameterLowerBound(z.data(), int(k), bounds->low[k]);
    if (std::isfinite(bounds->high[k])) problem.SetParameterUpperBound(z.data(), int(k), bounds->high[k]);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = max_iterations;
  options.gradient_tolerance = 1e-3;  // of a parameter in prior sd: a thousandth of the posterior sd at most
  options.function_tolerance = 1e-7;
  options.parameter_tolerance = 1e-8;
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

/// As above; bounds cost evaluations, so far ones are imposed only where the descent without them ends beyond.
inline Descent descend(Objective& objective, const Bounds& bounds, int max_iterations, Eigen::VectorXd& z,
                       ceres::IterationCallback* callback = nullptr) {
  constexpr double far = 6;  // prior sd
  if (bounds.low.maxCoeff() > -far || bounds.high.minCoeff() < far)
    return descend_within(objective, &bounds, max_iterations, z, callback);
  const Eigen::VectorXd start = z;
  const Descent free = descend_within(objective, nullptr, max_iterations, z, callback);
  if (bounds.hold(z)) return free;
  z = start;
  return descend_within(objective, &bounds, max_iterations, z, callback);
}

}  // namespace detail

}  // namespace ctcr
