#pragma once
// A point that a motor turns on a circle in space, fitted to readings of where it is.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "ctcr/calibration/procedures/ceres_problem.hpp"
#include "ctcr/calibration/dense.hpp"
#include "ctcr/core/types.hpp"

namespace ctcr {

/// centre + radius (cos(angle + offset) x + sin(angle + offset) y), where x is `reference` projected on the plane and y
/// completes a right-handed frame with the normal. Readings of series 0 and 1 have offsets of their own.
struct Circle {
  Vec3 centre = Vec3::Zero();       ///< [m]
  double radius = 0;                ///< [m]
  Vec3 normal = Vec3::UnitZ();      ///< unit vector about which angles grow
  Vec3 reference = Vec3::UnitX();   ///< not parallel to the normal
  Eigen::Vector2d offset = {0, 0};  ///< [rad]

  /// Columns x, y, normal.
  [[nodiscard]] Mat3 frame() const {
    Mat3 R;
    R.col(2) = normal;
    R.col(0) = (reference - reference.dot(normal) * normal).normalized();
    R.col(1) = R.col(2).cross(R.col(0));
    return R;
  }
  [[nodiscard]] Vec3 at(double angle, int series) const {
    const double a = angle + offset[series];
    return centre + radius * (frame() * Vec3(std::cos(a), std::sin(a), 0));
  }
};

struct CircleReading {
  double angle;   ///< known up to the offset [rad]
  Vec3 position;  ///< [m]
  int series;     ///< 0 or 1
};

/// What is known of the circle and not fitted.
struct KnownCircle {
  std::optional<Vec3> centre{};    ///< [m]
  std::optional<double> radius{};  ///< [m]
  std::optional<Vec3> normal{};    ///< unit vector
};

/// The circle with both offsets equal, from linear least absolute deviations: an ellipse c + A cos + B sin is linear in
/// its unknowns, so there is one minimum, and readings that are far off hardly matter. The reference is left alone.
inline Circle approximate_circle(const std::vector<CircleReading>& readings, const KnownCircle& known,
                                 const Vec3& reference) {
  const Eigen::Index n = Eigen::Index(readings.size()), shift = known.centre ? 0 : 1;
  Eigen::MatrixXd M(n, 2 + shift), X(n, 3), ellipse;
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& [angle, position, series] = readings[std::size_t(i)];
    if (shift) M(i, 0) = 1;
    M(i, shift) = std::cos(angle);
    M(i, shift + 1) = std::sin(angle);
    X.row(i) = position - known.centre.value_or(Vec3::Zero());
  }
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(n);
  for (int k = 0; k < 30; ++k) {
    ellipse = least_squares(weight.asDiagonal() * M, weight.asDiagonal() * X);
    const Eigen::VectorXd distance = (X - product(M, ellipse)).rowwise().norm();
    weight = (distance.array() + 1e-3 * distance.mean() + 1e-12).sqrt().inverse();
  }
  const Vec3 A = ellipse.row(shift), B = ellipse.row(shift + 1);
  Circle circle;
  circle.reference = reference;
  circle.centre = known.centre ? *known.centre : Vec3(ellipse.row(0));
  circle.radius = known.radius.value_or(std::sqrt(0.5 * (A.squaredNorm() + B.squaredNorm())));
  if (known.normal || A.cross(B).norm() > 0) circle.normal = known.normal.value_or(A.cross(B).normalized());
  const Mat3 R = circle.frame();
  circle.offset.setConstant(std::atan2(A.dot(R.col(1)) - B.dot(R.col(0)), A.dot(R.col(0)) + B.dot(R.col(1))));
  return circle;
}

/// Residual of one reading, model - measured in units of `scale`, by offset, centre, radius and the tilt of the normal.
struct CircleResidual {
  CircleReading reading;
  Circle start;  ///< its normal + tilt[0] x + tilt[1] y is the fitted one's direction
  double scale;  ///< [m]

  template <class T>
  bool operator()(const T* offset, const T* centre, const T* radius, const T* tilt, T* residual) const {
    using V = Eigen::Matrix<T, 3, 1>;
    const Mat3 R = start.frame();
    const V normal = (R.col(2).cast<T>() + tilt[0] * R.col(0).cast<T>() + tilt[1] * R.col(1).cast<T>()).normalized();
    const V reference = start.reference.cast<T>();
    const V x = (reference - reference.dot(normal) * normal).normalized(), y = normal.cross(x);
    using std::cos, std::sin;
    const T angle = *offset + reading.angle;
    const V error = Eigen::Map<const V>(centre) + *radius * (cos(angle) * x + sin(angle) * y) - reading.position;
    Eigen::Map<V>{residual} = error / T(scale);
    return true;
  }
};

/// A fit with what its errors follow from.
struct CircleFit {
  Circle circle;
  Eigen::MatrixXd J;  ///< (3 readings, free parameters): model by offsets of the series present, then those free
  std::array<int, 5> column{-1, -1, -1, -1, -1};  ///< of offset 0, offset 1, centre, radius, tilt; -1: not fitted
};

/// Least squares from `start`, whose known parts stay; with `loss` > 0 [m] readings farther off than that count ever
/// less (Cauchy), which is good for finding them, not for the last digit.
inline CircleFit refined_circle(const std::vector<CircleReading>& readings, const Circle& start,
                                const KnownCircle& known, double scale, double loss) {
  CircleFit fit{.circle = start, .J = {}};
  Circle& circle = fit.circle;
  Eigen::Vector2d tilt(0, 0);
  ceres::Problem problem;
  for (const CircleReading& reading : readings) {
    using Cost = ceres::AutoDiffCostFunction<CircleResidual, 3, 1, 3, 1, 2>;
    problem.AddResidualBlock(new Cost(new CircleResidual{reading, start, scale}),
                             loss > 0 ? new ceres::CauchyLoss(loss / scale) : nullptr, &circle.offset[reading.series],
                             circle.centre.data(), &circle.radius, tilt.data());
  }
  const std::array<double*, 5> blocks{&circle.offset[0], &circle.offset[1], circle.centre.data(), &circle.radius,
                                      tilt.data()};
  const std::array<bool, 5> is_free{problem.HasParameterBlock(blocks[0]), problem.HasParameterBlock(blocks[1]),
                                    !known.centre, !known.radius, !known.normal};
  std::vector<double*> free_blocks;
  for (std::size_t k = 0, columns = 0; k < blocks.size(); ++k) {
    if (is_free[k]) {
      fit.column[k] = int(columns);
      columns += std::size_t(problem.ParameterBlockSize(blocks[k]));
      free_blocks.push_back(blocks[k]);
    } else if (problem.HasParameterBlock(blocks[k])) {
      problem.SetParameterBlockConstant(blocks[k]);
    }
  }
  minimise(problem, scale, 1e-13, loss > 0 ? 1e-6 : 0);
  fit.J = scale * jacobian(problem, free_blocks);
  const Mat3 R = start.frame();
  circle.normal = (R * Vec3(tilt[0], tilt[1], 1)).normalized();
  return fit;
}

}  // namespace ctcr
