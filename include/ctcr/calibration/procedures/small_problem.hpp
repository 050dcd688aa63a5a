#pragma once
// The one way in which the procedures use Ceres: small dense problems, solved to rounding. Its TinySolver and its
// automatic derivatives are headers alone, so that nothing is linked.
#include <ceres/jet.h>
#include <ceres/tiny_solver.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace ctcr {

/// Least squares over residuals of one kind by some of P parameters; the others stay.
/// @tparam Residual  a block of `Residual::size` residuals, about of order 1: operator()(const T* x, T* residual) for T =
///                   double and ceres::Jet<double, P>
/// Real time: no.
template <class Residual, int P>
class SmallProblem {
public:
  // What TinySolver asks for.
  using Scalar = double;
  enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = Eigen::Dynamic };
  [[nodiscard]] int NumResiduals() const { return int(blocks_.size()) * Residual::size; }
  [[nodiscard]] int NumParameters() const { return int(free_.size()); }

  using Parameters = Eigen::Vector<double, P>;

  /// @param start  of all parameters   @param free  indices of those that are fitted
  SmallProblem(const Parameters& start, std::vector<int> free) : x_(start), free_(std::move(free)) {}

  /// @param loss  residuals beyond it, as the block's norm, count ever less (Cauchy); 0: all count alike
  void add(const Residual& block, double loss = 0) { blocks_.push_back({block, loss}); }

  /// Minimises until the parameters are right to `precision`.
  /// @param unit  change of a parameter that changes residuals by about 1; in units of the parameters, as is `precision`
  void minimise(double unit, double precision) {
    ceres::TinySolver<SmallProblem> solver;
    solver.options.max_num_iterations = 100;
    solver.options.function_tolerance = 0;
    // The curvature of the cost is about the number of residuals over unit^2; the solver's gradient is by parameters in
    // which it is 1.
    solver.options.gradient_tolerance = std::sqrt(double(NumResiduals())) * precision / unit;
    solver.options.parameter_tolerance = 1e-16;  // no step moves anything then
    solver.options.cost_threshold = 0;
    Eigen::VectorXd free = x_(free_);
    solver.Solve(*this, &free);
    x_(free_) = free;
  }

  [[nodiscard]] const Parameters& parameters() const { return x_; }

  /// Derivative (residuals, free parameters), in the order in which blocks were added, without losses.
  [[nodiscard]] Eigen::MatrixXd jacobian() const {
    Eigen::MatrixXd J(NumResiduals(), NumParameters());
    for (std::size_t i = 0; i < blocks_.size(); ++i) put(i, differentiated(blocks_[i].residual, x_), J);
    return J;
  }

  /// Residuals at values of the free parameters, and their derivatives by these if `jacobian` is given (by columns).
  bool operator()(const double* free, double* residuals, double* jacobian) const {
    Parameters x = x_;
    for (std::size_t k = 0; k < free_.size(); ++k) x[free_[k]] = free[k];
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      const auto& [residual, loss] = blocks_[i];
      Eigen::Map<Block> r(residuals + i * Residual::size);
      if (!jacobian) {
        residual(x.data(), r.data());
        r *= scaled(r.squaredNorm(), loss).factor;
        continue;
      }
      std::array<Jet, Residual::size> jets = differentiated(residual, x);
      for (int k = 0; k < Residual::size; ++k) r[k] = jets[std::size_t(k)].a;
      const auto [factor, slope] = scaled(r.squaredNorm(), loss);
      Eigen::Vector<double, P> by_square = Eigen::Vector<double, P>::Zero();
      for (int k = 0; k < Residual::size; ++k) by_square += 2 * slope * r[k] * jets[std::size_t(k)].v;
      for (int k = 0; k < Residual::size; ++k)
        jets[std::size_t(k)].v = factor * jets[std::size_t(k)].v + r[k] * by_square;
      Eigen::Map<Eigen::MatrixXd> J(jacobian, NumResiduals(), NumParameters());
      put(i, jets, J);
      r *= factor;
    }
    return true;
  }

private:
  using Jet = ceres::Jet<double, P>;
  using Block = Eigen::Vector<double, Residual::size>;
  struct WithLoss {
    Residual residual;
    double loss;
  };

  static std::array<Jet, Residual::size> differentiated(const Residual& residual, const Parameters& x) {
    std::array<Jet, P> variables;
    for (int k = 0; k < P; ++k) variables[std::size_t(k)] = Jet(x[k], k);
    std::array<Jet, Residual::size> out;
    residual(variables.data(), out.data());
    return out;
  }
  void put(std::size_t block, const std::array<Jet, Residual::size>& jets, auto& J) const {
    for (int k = 0; k < Residual::size; ++k)
      for (std::size_t column = 0; column < free_.size(); ++column)
        J(Eigen::Index(block) * Residual::size + k, Eigen::Index(column)) = jets[std::size_t(k)].v[free_[column]];
  }

  struct Scaling {
    double factor = 1, slope = 0;
  };
  /// The factor by which a block's square becomes Cauchy's loss, and the factor's derivative by the block's square.
  static Scaling scaled(double square, double loss) {
    const double c = loss * loss, z = square / c;
    if (!(loss > 0) || z == 0) return {};
    const double mean = std::log1p(z) / z;
    // The difference cancels where z is small.
    const double slope = z < 1e-4 ? -0.5 + 2 * z / 3 : (1 / (1 + z) - mean) / z;
    return {std::sqrt(mean), slope / (2 * std::sqrt(mean) * c)};
  }

  Parameters x_;
  std::vector<int> free_;
  std::vector<WithLoss> blocks_;
};

}  // namespace ctcr
