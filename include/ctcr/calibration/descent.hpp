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
