#pragma once
// A circle fitted to readings some of which may be far off, with the errors that noise and a tracker's field make.
#include <limits>
#include <numbers>

#include "ctcr/calibration/procedures/circle_fit.hpp"
#include "ctcr/calibration/procedures/notice.hpp"
#include "ctcr/calibration/procedures/propagation.hpp"

namespace ctcr {

/// Sd per axis that the median distance of readings from a circle tells, whatever the far ones do.
inline double robust_sd(const std::vector<CircleReading>& readings, const Circle& circle) {
  std::vector<double> distance;
  for (const auto& [angle, position, series] : readings)
    distance.push_back((position - circle.at(angle, series)).norm());
  const auto middle = distance.begin() + std::ptrdiff_t(distance.size() / 2);
  std::nth_element(distance.begin(), middle, distance.end());
  return *middle / 1.5382;  // median length of a vector of three standard normal components
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
  double stated;                ///< jitter [m], 0: none
  double variance;              ///< of a coordinate, beside the field [m^2]
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
  CircleSolution solved{.fit = {},
                        .used = {},
                        .outliers = {},
                        .error = {},
                        .gain = {},
                        .field = {},
                        .stated = noise.position_jitter,
                        .variance = 0,
                        .covariance = {}};
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
  require(used.size() >= 6, sentence("only %zu readings lie on one circle, 6 are needed", used.size()));
  solved.fit = refined_circle(used, circle, known, sd, 0);
  for (double& offset : solved.fit.circle.offset) offset = std::remainder(offset, 2 * std::numbers::pi);

  solved.error.resize(3 * Eigen::Index(used.size()));
  Eigen::MatrixX3d places(Eigen::Index(used.size()), 3);
  for (std::size_t i = 0; i < used.size(); ++i) {
    places.row(Eigen::Index(i)) = used[i].position;
    solved.error.segment<3>(3 * Eigen::Index(i)) =
        used[i].position - solved.fit.circle.at(used[i].angle, used[i].series);
  }
  const Eigen::MatrixXd& J = solved.fit.J;
  solved.field = field_factor(places, noise);
  solved.gain = ctcr::gain(J);
  require(solved.gain.size() > 0,
          "the readings do not determine the circle: take them over a longer arc, or hold centre and radius");
  solved.variance = solved.variance_of(J, solved.gain, solved.error.squaredNorm());
  solved.covariance = propagated(solved.gain, solved.variance, solved.field);
  return solved;
}

}  // namespace ctcr
