#pragma once
// A point that a motor turns on a circle in space: the circle fitted to readings of its position, outliers among them,
// and the errors that jitter and a tracker's field error make.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "ctcr/calibration/procedures/notice.hpp"
#include "ctcr/calibration/procedures/propagation.hpp"
#include "ctcr/calibration/procedures/small_problem.hpp"
#include "ctcr/calibration/statistics.hpp"
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

/// Parameters of the circle that are known and not fitted.
struct KnownCircle {
  std::optional<Vec3> centre{};    ///< [m]
  std::optional<double> radius{};  ///< [m]
  std::optional<Vec3> normal{};    ///< unit vector
};

/// The circle with both offsets equal, from linear least absolute deviations: an ellipse c + A cos + B sin is linear in
/// its unknowns, so there is one minimum, and outliers hardly matter.
/// @param reference  as Circle::reference, which it becomes   Real time: no.
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
  static constexpr int size = 3;
  // Parameters: the offset of each series first.
  static constexpr int centre = 2, radius = 5, tilt = 6, parameters = 8;

  CircleReading reading;
  Circle start;  ///< its normal + tilt[0] x + tilt[1] y is the fitted one's direction
  double scale;  ///< [m]

  template <class T>
  void operator()(const T* p, T* residual) const {
    using V = Eigen::Matrix<T, 3, 1>;
    const Mat3 R = start.frame();
    const V normal =
        (R.col(2).cast<T>() + p[tilt] * R.col(0).cast<T>() + p[tilt + 1] * R.col(1).cast<T>()).normalized();
    const V reference = start.reference.cast<T>();
    const V x = (reference - reference.dot(normal) * normal).normalized(), y = normal.cross(x);
    using std::cos, std::sin;
    const T angle = p[reading.series] + reading.angle;
    const V error = Eigen::Map<const V>(p + centre) + p[radius] * (cos(angle) * x + sin(angle) * y) - reading.position;
    Eigen::Map<V>{residual} = error / T(scale);
  }
};

/// A fit with what its errors follow from.
struct CircleFit {
  Circle circle;
  Eigen::MatrixXd J{};  ///< (3 readings, free parameters): model by offsets of the series present, then those free
  std::array<int, 5> column{-1, -1, -1, -1, -1};  ///< of offset 0, offset 1, centre, radius, tilt; -1: not fitted
};

/// Least squares from `start`, whose known parts stay; with `loss` > 0 [m] readings farther off than that count ever
/// less (Cauchy), which is good for finding them, not for the last digit.
inline CircleFit refined_circle(const std::vector<CircleReading>& readings, const Circle& start,
                                const KnownCircle& known, double scale, double loss) {
  using R = CircleResidual;
  Eigen::Vector<double, R::parameters> x;
  x << start.offset[0], start.offset[1], start.centre, start.radius, 0, 0;
  const auto has = [&](int series) {
    return std::ranges::find(readings, series, &CircleReading::series) != readings.end();
  };
  CircleFit fit{.circle = start};
  std::vector<int> free;
  const auto release = [&](std::size_t part, bool is_free, int first, int count) {
    if (!is_free) return;
    fit.column[part] = int(free.size());
    for (int k = 0; k < count; ++k) free.push_back(first + k);
  };
  for (const int series : {0, 1}) release(std::size_t(series), has(series), series, 1);
  release(2, !known.centre, R::centre, 3);
  release(3, !known.radius, R::radius, 1);
  release(4, !known.normal, R::tilt, 2);

  SmallProblem<R, R::parameters> problem(x, free);
  for (const CircleReading& reading : readings) problem.add({reading, start, scale}, loss / scale);
  problem.minimise(scale, 1e-13);
  x = problem.parameters();
  fit.J = scale * problem.jacobian();
  fit.circle.offset = x.head<2>();
  fit.circle.centre = x.segment<3>(R::centre);
  fit.circle.radius = x[R::radius];
  fit.circle.normal = (start.frame() * Vec3(x[R::tilt], x[R::tilt + 1], 1)).normalized();
  return fit;
}

/// Robust sd per axis, from the median distance of readings from a circle.
inline double robust_sd(const std::vector<CircleReading>& readings, const Circle& circle) {
  std::vector<double> distance;
  for (const auto& [angle, position, series] : readings)
    distance.push_back((position - circle.at(angle, series)).norm());
  return median(distance) / median_length_3;
}

/// Columns, one to a coordinate of a reading, of the errors that friction, an eccentric drive or a bent frame would add:
/// radially and out of plane twice a turn, along the circle once and twice.
inline Eigen::MatrixXd harmonics(const std::vector<CircleReading>& readings, const Circle& circle) {
  Eigen::MatrixXd Z(3 * Eigen::Index(readings.size()), 8);
  const Mat3 R = circle.frame();
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const double a = readings[i].angle + circle.offset[readings[i].series];
    const Vec3 radial = R * Vec3(std::cos(a), std::sin(a), 0), along = R * Vec3(-std::sin(a), std::cos(a), 0);
    auto rows = Z.middleRows<3>(3 * Eigen::Index(i));
    rows << radial * std::cos(2 * a), radial * std::sin(2 * a), R.col(2) * std::cos(2 * a), R.col(2) * std::sin(2 * a),
        along * std::cos(a), along * std::sin(a), along * std::cos(2 * a), along * std::sin(2 * a);
  }
  return Z;
}

/// A fit, the readings it stands on and what their errors do to it.
struct CircleSolution {
  CircleFit fit;
  std::vector<CircleReading> used;
  std::vector<int> outliers;    ///< numbers of the readings left out
  Eigen::VectorXd error;        ///< (3 used) measured - circle [m]
  Eigen::MatrixXd gain, field;  ///< see propagation.hpp
  double stated = 0;            ///< jitter [m], 0: none
  double variance = 0;          ///< of a coordinate, beside the field [m^2]
  Eigen::MatrixXd covariance;   ///< of the parameters fitted

  [[nodiscard]] double degrees_of_freedom() const { return double(fit.J.rows() - fit.J.cols()); }
  /// Variance that residuals of this sum of squares show, or the one stated where it is larger.
  [[nodiscard]] double variance_of(const Eigen::MatrixXd& J, const Eigen::MatrixXd& G, double squares) const {
    const double shown = (squares - expected_field_squares(J, G, field)) / double(J.rows() - J.cols());
    return std::max(stated * stated, shown);
  }
  [[nodiscard]] double sd_along(const Eigen::VectorXd& v) const { return std::sqrt(v.dot(covariance * v)); }
  /// The mean offset, and the difference of both, as combinations of the parameters.
  [[nodiscard]] Eigen::VectorXd combination(double forward, double backward) const {
    Eigen::VectorXd v = Eigen::VectorXd::Zero(covariance.rows());
    if (fit.column[0] >= 0) v[fit.column[0]] = forward;
    if (fit.column[1] >= 0) v[fit.column[1]] = backward;
    return v;
  }
  [[nodiscard]] bool has(int series) const { return fit.column[std::size_t(series)] >= 0; }
  [[nodiscard]] Eigen::VectorXd mean() const { return has(0) && has(1) ? combination(0.5, 0.5) : combination(1, 1); }
};

/// Two robust fits, each with the noise that the one before shows, then least squares without the outliers.
inline CircleSolution solve_circle(const std::vector<CircleReading>& points, Circle circle, const KnownCircle& known,
                                   const Noise& noise) {
  CircleSolution solved;
  solved.stated = noise.position_jitter;
  const auto scale = [&] { return std::max({robust_sd(points, circle), solved.stated, 1e-9 * circle.radius}); };
  for (int k = 0; k < 2; ++k) {
    const double sd = scale();
    circle = refined_circle(points, circle, known, sd, 2.5 * sd).circle;
  }
  const double sd = scale();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto& [angle, position, series] = points[i];
    if ((position - circle.at(angle, series)).norm() > 5 * sd)
      solved.outliers.push_back(int(i));
    else
      solved.used.push_back(points[i]);
  }
  const std::vector<CircleReading>& used = solved.used;
  require(used.size() >= 6, "only %zu readings lie on one circle, 6 are needed", used.size());
  solved.fit = refined_circle(used, circle, known, sd, 0);
  for (double& offset : solved.fit.circle.offset) offset = std::remainder(offset, 2 * std::numbers::pi);

  solved.error.resize(3 * Eigen::Index(used.size()));
  Eigen::MatrixX3d positions(Eigen::Index(used.size()), 3);
  for (std::size_t i = 0; i < used.size(); ++i) {
    positions.row(Eigen::Index(i)) = used[i].position;
    solved.error.segment<3>(3 * Eigen::Index(i)) =
        used[i].position - solved.fit.circle.at(used[i].angle, used[i].series);
  }
  const Eigen::MatrixXd& J = solved.fit.J;
  solved.field = field_factor(positions, noise);
  solved.gain = ctcr::gain(J);
  require(solved.gain.size() > 0,
          "the readings do not determine the circle: take them over a longer arc, or hold centre and radius");
  solved.variance = solved.variance_of(J, solved.gain, solved.error.squaredNorm());
  solved.covariance = propagated(solved.gain, solved.variance, solved.field);
  return solved;
}

}  // namespace ctcr
