#pragma once
// The angle at which a motor holds a tube: from readings of its tip while it alone is out and turns.
#include <numbers>
#include <span>

#include "ctcr/calibration/circle_fit.hpp"
#include "ctcr/calibration/notice.hpp"
#include "ctcr/calibration/propagation.hpp"
#include "ctcr/calibration/significance.hpp"
#include "ctcr/math/se3.hpp"

namespace ctcr {

/// A reading of the tip of a tube that is out alone.
struct TurnReading {
  double motor_angle;  ///< theta [rad], counted on over several turns
  Vec3 position;       ///< of the tip [m], tracker frame
  int direction = 0;   ///< in which the motor last turned, +1 or -1; 0: the order of the readings tells
};

struct RotationOffsetOptions {
  double ratio = 1;                     ///< rho: how far the tube turns for a turn of the motor
  std::optional<Pose> T_tracker_base;   ///< T_ref; without it everything below is meant and returned in tracker axes
  KnownCircle known;                    ///< held instead of fitted; base frame if T_ref is given
  double bend_angle = -std::numbers::pi / 2;  ///< where the tube bends, from its x axis: towards -y, for a curvature < 0
                                              ///< towards +y (pi/2)
  Noise noise;  ///< of positions; a jitter of 0 is estimated from the residuals. A field error turns the circle a little
  double wanted_sd = 0.3 * std::numbers::pi / 180;  ///< [rad] below which no notice is worth its while
};

enum class RotationOffsetNotice {
  one_direction,     ///< figure: the direction there is
  directions_differ, ///< figure: offset forward - backward [rad]; friction or backlash, of which the mean keeps no half
  arc_too_short,     ///< figure: how many times less certain the offset is than on a known circle
  radius_too_small,  ///< figure: radius [m]
  not_round,         ///< figure: amplitude of a radial error twice a turn [m]
  not_planar,        ///< figure: amplitude of an out-of-plane error twice a turn [m]
  not_uniform,       ///< figure: amplitude of an error along the circle, once or twice a turn [m]
  tilted,            ///< figure: angle between the circle's normal and the base frame's z axis [rad]
  noise_larger,      ///< figure: sd of the residuals per axis [m], above the jitter stated
  outliers,          ///< figure: how many readings are left out
};

/// Delta of alpha = rho theta + Delta for the tube that turned: its precurvature axis x stands at alpha from the base
/// frame's x axis, both seen on the circle's plane, right-handed about z. Without T_ref the angle is from the tracker's
/// x axis projected on that plane (y, where x is within 25 degrees of its normal), right-handed about the direction of
/// insertion, which the sense of rotation tells: right up to the constant that T_ref decides.
struct RotationOffset {
  double offset, offset_sd;  ///< mean of both directions, in (-pi, pi] [rad]
  double forward, forward_sd, backward, backward_sd;  ///< of either direction of the motor; NaN where absent [rad]
  double difference, difference_sd;                   ///< forward - backward; NaN where one is absent [rad]
  Vec3 centre, centre_sd;    ///< [m]; an sd of 0: held
  double radius, radius_sd;  ///< [m]
  Vec3 normal;               ///< unit vector, along which the tube is inserted
  double tilt_sd;            ///< of the normal, in its worse direction [rad]
  Vec3 zero_axis;            ///< unit vector along the tube's x axis at alpha = 0
  bool in_base_frame;        ///< the axes of these vectors: base frame, or tracker
  double rms;                                        ///< of the distances from the circle, readings used [m]
  double radial_rms, tangential_rms, out_of_plane_rms;  ///< of their components [m]
  double noise_sd;           ///< per axis, beside the field: the jitter stated, or the larger one that residuals show [m]
  double arc;                ///< of the circle that readings cover [rad]
  std::vector<Vec3> residuals;  ///< measured - circle, all readings [m]
  std::vector<int> outliers;    ///< numbers of the readings left out
  std::vector<Notice<RotationOffsetNotice>> notices;
};

namespace rotation_offset {

inline constexpr double surprising = 3.5;  // a notice comes by chance once in some thousand calibrations
inline constexpr double degree = std::numbers::pi / 180, mm = 1e-3;

inline double wrapped(double angle) { return std::remainder(angle, 2 * std::numbers::pi); }

/// Series 0 is forward, 1 backward. A motor that stands keeps its direction; what comes before it first moves gets that
/// of the first motion.
inline std::vector<int> series_of(std::span<const TurnReading> readings) {
  std::vector<int> direction(readings.size());
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const double moved = i > 0 ? readings[i].motor_angle - readings[i - 1].motor_angle : 0;
    direction[i] = readings[i].direction != 0 ? readings[i].direction
                   : std::abs(moved) > 1e-9   ? (moved > 0 ? 1 : -1)
                                              : (i > 0 ? direction[i - 1] : 0);
  }
  const auto first = std::find_if(direction.begin(), direction.end(), [](int d) { return d != 0; });
  const int start = first == direction.end() ? 1 : *first;
  for (int& d : direction) d = (d == 0 ? start : d) > 0 ? 0 : 1;
  return direction;
}

/// The part of a turn that angles cover [rad], and how many of them are different by more than half a degree.
inline std::pair<double, int> covered(std::vector<double> angles) {
  constexpr double turn = 2 * std::numbers::pi;
  for (double& a : angles) a -= turn * std::floor(a / turn);
  std::sort(angles.begin(), angles.end());
  double largest_gap = angles.front() + turn - angles.back();
  int distinct = largest_gap > 0.5 * degree ? 1 : 0;
  for (std::size_t i = 1; i < angles.size(); ++i) {
    const double gap = angles[i] - angles[i - 1];
    largest_gap = std::max(largest_gap, gap);
    distinct += gap > 0.5 * degree;
  }
  return {turn - largest_gap, distinct};
}

/// Sd per axis that the median distance of readings from a circle tells, whatever the far ones do.
inline double robust_sd(const std::vector<CircleReading>& readings, const Circle& circle) {
  std::vector<double> distance;
  for (const auto& [angle, position, series] : readings)
    distance.push_back((position - circle.at(angle, series)).norm());
  const auto middle = distance.begin() + std::ptrdiff_t(distance.size() / 2);
  std::nth_element(distance.begin(), middle, distance.end());
  return *middle / 1.5382;  // median length of a vector of three standard normal components
}

inline void check(std::span<const TurnReading> readings, const RotationOffsetOptions& options) {
  require(readings.size() >= 6,
          sentence("a rotation offset needs at least 6 readings of the tip, here are %zu", readings.size()));
  require(std::isfinite(options.ratio) && options.ratio != 0, "the ratio of tube to motor angle must be finite and not 0");
  require(!options.known.radius || *options.known.radius > 0, "the known radius must be positive [m]");
  require(!options.known.normal || options.known.normal->norm() > 0, "the known normal must not be a zero vector");
  for (std::size_t i = 0; i < readings.size(); ++i)
    require(std::isfinite(readings[i].motor_angle) && readings[i].position.allFinite(),
            sentence("reading %zu: the motor angle [rad] or the position [m] is not a finite number", i + 1));
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

}  // namespace rotation_offset

/// Finds the rotation offset of a tube from readings of its tip, better in both directions of rotation: their mean, as
/// torsion and friction are the same both ways. Outliers are found with a robust loss and left out of the least squares.
/// @throws std::invalid_argument for too few readings or angles, a tip that does not move, or one that turns against
///         ratio * motor_angle. Real time: no.
/// Ref: Boyer et al., Eq. (5).
[[nodiscard]] inline RotationOffset fit_rotation_offset(std::span<const TurnReading> readings,
                                                        const RotationOffsetOptions& options = {}) {
  using namespace rotation_offset;
  check(readings, options);
  KnownCircle known = options.known;
  if (known.normal) known.normal->normalize();
  const Pose T_frame_tracker = options.T_tracker_base ? options.T_tracker_base->inverse() : Pose{};
  const std::vector<int> series = series_of(readings);
  std::vector<CircleReading> all;
  std::vector<double> angles;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    angles.push_back(options.ratio * readings[i].motor_angle);
    all.push_back({angles.back() + options.bend_angle,
                   T_frame_tracker.rotation * readings[i].position + T_frame_tracker.position, series[i]});
  }
  const auto [arc, distinct] = covered(angles);
  require(distinct >= 4, sentence("a rotation offset needs readings at 4 different angles, here are %d", distinct));

  // Start, and what cannot be.
  Circle circle = approximate_circle(all, known, Vec3::UnitX());
  if (!options.T_tracker_base && std::abs(circle.normal.x()) > std::cos(25 * degree))
    circle = approximate_circle(all, known, Vec3::UnitY());
  double sd = std::max(robust_sd(all, circle), options.noise.position_jitter);
  require(circle.radius > 6 * sd * std::sqrt(2.0 / double(all.size())) && circle.radius > 1e-9,
          sentence("the tip hardly moves: a circle of radius %.3f mm in noise of %.3f mm", circle.radius / mm, sd / mm));
  const Vec3 insertion = known.normal.value_or(Vec3::UnitZ());
  if (options.T_tracker_base || known.normal) {
    const Circle fitted = approximate_circle(all, {.centre = known.centre, .radius = {}, .normal = {}}, Vec3::UnitX());
    require(fitted.normal.dot(insertion) > 0.5,
            sentence("the tip turns about an axis %.0f deg from where the tube is inserted: the sign of the ratio or the "
                     "frame of the tracker is wrong",
                     std::acos(std::clamp(fitted.normal.dot(insertion), -1.0, 1.0)) / degree));
  }

  // Two robust fits, each with the noise that the one before shows, then least squares without the outliers.
  const auto scale = [&] { return std::max(sd, 1e-9 * circle.radius); };
  for (int k = 0; k < 2; ++k) {
    circle = refined_circle(all, circle, known, scale(), 2.5 * scale()).circle;
    sd = std::max(robust_sd(all, circle), options.noise.position_jitter);
  }
  RotationOffset result{};
  std::vector<CircleReading> used;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool is_far = (all[i].position - circle.at(all[i].angle, all[i].series)).norm() > 5 * scale();
    if (is_far) result.outliers.push_back(int(i));
    else used.push_back(all[i]);
  }
  require(used.size() >= 6, sentence("only %zu readings lie on one circle, 6 are needed", used.size()));
  const CircleFit fit = refined_circle(used, circle, known, scale(), 0);
  circle = fit.circle;
  circle.offset = circle.offset.unaryExpr([](double a) { return wrapped(a); });

  // Residuals in the directions of the circle.
  const Mat3 R = circle.frame();
  Eigen::VectorXd error(3 * Eigen::Index(used.size()));
  Eigen::MatrixX3d places(Eigen::Index(used.size()), 3);
  Vec3 squares = Vec3::Zero();
  for (std::size_t i = 0; i < used.size(); ++i) {
    const double a = used[i].angle + circle.offset[used[i].series];
    const Vec3 e = used[i].position - circle.at(used[i].angle, used[i].series);
    error.segment<3>(3 * Eigen::Index(i)) = e;
    places.row(Eigen::Index(i)) = used[i].position;
    squares += (rotation_z(-a) * (R.transpose() * e)).cwiseAbs2();
  }
  const Vec3 rms = (squares / double(used.size())).cwiseSqrt();
  for (const auto& [angle, position, s] : all) result.residuals.push_back(position - circle.at(angle, s));

  // Errors of the parameters.
  const double stated = options.noise.position_jitter;
  const Eigen::MatrixXd field = field_factor(places, options.noise);
  const auto variance_of = [&](const Eigen::MatrixXd& J, const Eigen::MatrixXd& G, double sum) {
    const double left = sum - expected_field_squares(J, G, field), degrees = double(J.rows() - J.cols());
    return std::max(stated * stated, left / degrees);
  };
  const Eigen::MatrixXd G = gain(fit.J);
  require(G.size() > 0, "the readings do not determine the circle: take them over a longer arc, or hold centre and radius");
  const double variance = variance_of(fit.J, G, error.squaredNorm());
  const Eigen::MatrixXd covariance = propagated(G, variance, field);
  const auto sd_at = [&](int column) { return std::sqrt(covariance(column, column)); };
  const auto& column = fit.column;
  const bool has[2] = {column[0] >= 0, column[1] >= 0};
  const double nan = std::numeric_limits<double>::quiet_NaN();

  result.forward = has[0] ? circle.offset[0] : nan;
  result.backward = has[1] ? circle.offset[1] : nan;
  result.forward_sd = has[0] ? sd_at(column[0]) : nan;
  result.backward_sd = has[1] ? sd_at(column[1]) : nan;
  result.difference = wrapped(result.forward - result.backward);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(covariance.rows()), difference = mean;
  for (int s = 0; s < 2; ++s) {
    if (!has[s]) continue;
    mean[column[std::size_t(s)]] = has[1 - s] ? 0.5 : 1;
    difference[column[std::size_t(s)]] = s == 0 ? 1 : -1;
  }
  const auto sd_along = [&](const Eigen::VectorXd& v) { return std::sqrt(v.dot(covariance * v)); };
  result.offset = has[0] && has[1] ? wrapped(result.backward + 0.5 * result.difference)
                                   : (has[0] ? result.forward : result.backward);
  result.offset_sd = sd_along(mean);
  result.difference_sd = has[0] && has[1] ? sd_along(difference) : nan;
  result.centre = circle.centre;
  result.radius = circle.radius;
  result.normal = circle.normal;
  result.zero_axis = R.col(0);
  result.in_base_frame = options.T_tracker_base.has_value();
  for (int axis = 0; axis < 3 && column[2] >= 0; ++axis) result.centre_sd[axis] = sd_at(column[2] + axis);
  result.radius_sd = column[3] >= 0 ? sd_at(column[3]) : 0;
  if (column[4] >= 0)
    result.tilt_sd = std::sqrt(
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance.block<2, 2>(column[4], column[4])).eigenvalues()[1]);
  result.rms = rms.norm();
  result.radial_rms = rms[0];
  result.tangential_rms = rms[1];
  result.out_of_plane_rms = rms[2];
  result.noise_sd = std::sqrt(variance);
  result.arc = arc;

  // Notices.
  const auto tell = [&](RotationOffsetNotice kind, double value, double limit, std::string text) {
    result.notices.push_back({kind, value, limit, std::move(text)});
  };
  using enum RotationOffsetNotice;
  if (!has[0] || !has[1])
    tell(one_direction, has[0] ? 1 : -1, 0,
         "the readings are of one direction of rotation: friction and backlash are in the offset in full");
  else if (std::abs(result.difference) > surprising * result.difference_sd)
    tell(directions_differ, result.difference, surprising * result.difference_sd,
         sentence("the two directions differ by %.2f deg (sd %.2f deg): friction or backlash; the mean removes it only if "
                  "it is the same both ways",
                  result.difference / degree, result.difference_sd / degree));
  const int series_1 = int(std::count_if(used.begin(), used.end(), [](const auto& r) { return r.series == 1; }));
  const double forward_count = double(used.size()) - series_1;
  const double spread = has[0] && has[1] ? 0.25 / forward_count + 0.25 / series_1 : 1 / double(used.size());
  const double best_sd = result.noise_sd / circle.radius * std::sqrt(spread);
  const double white_sd = std::sqrt(variance) * (G.transpose() * mean).norm();
  if (white_sd > 2 * best_sd)
    tell(arc_too_short, white_sd / best_sd, 2,
         sentence("the readings cover %.0f deg of the circle: the offset is %.1f times less certain than with a whole turn",
                  arc / degree, white_sd / best_sd));
  if (best_sd > options.wanted_sd)
    tell(radius_too_small, circle.radius, circle.radius * best_sd / options.wanted_sd,
         sentence("a radius of %.2f mm is small for noise of %.3f mm and %zu readings: sd %.2f deg even on a whole turn",
                  circle.radius / mm, result.noise_sd / mm, used.size(), best_sd / degree));
  if (options.T_tracker_base && !known.normal) {
    const double tilt = std::acos(std::clamp(circle.normal.z(), -1.0, 1.0));
    const double limit = std::max(2 * degree, surprising * result.tilt_sd);
    if (tilt > limit)
      tell(tilted, tilt, limit,
           sentence("the circle's plane is %.1f deg from the base frame's x-y plane: the frame of the tracker is wrong, or "
                    "the tube sags",
                    tilt / degree));
  }
  const double degrees = double(fit.J.rows() - fit.J.cols());
  const double ratio = (error.squaredNorm() - expected_field_squares(fit.J, G, field)) / (stated * stated);
  if (stated > 0 && chi_square_score(ratio, degrees) > surprising)
    tell(noise_larger, result.noise_sd, stated,
         sentence("readings lie %.3f mm per axis off the circle, more than the stated jitter of %.3f mm",
                  result.noise_sd / mm, stated / mm));
  if (!result.outliers.empty())
    tell(outliers, double(result.outliers.size()), 0,
         sentence("%zu of %zu readings are far off the circle and left out", result.outliers.size(), all.size()));

  Eigen::MatrixXd J(fit.J.rows(), fit.J.cols() + 8);
  J << fit.J, harmonics(used, circle);
  const Eigen::MatrixXd wide = gain(J);
  if (wide.size() == 0 || J.rows() < J.cols() + 3) return result;
  const Eigen::VectorXd estimate = wide * error;
  const Eigen::MatrixXd spread_of =
      propagated(wide, variance_of(J, wide, (error - J * estimate).squaredNorm()), field).bottomRightCorner(8, 8);
  const Eigen::VectorXd amplitude = estimate.tail(8);
  struct Misfit {
    RotationOffsetNotice kind;
    int first, count;
    const char* text;
  };
  for (const auto& [kind, first, count, text] :
       {Misfit{not_round, 0, 2, "the tip's path is not round"}, Misfit{not_planar, 2, 2, "the tip's path is not planar"},
        Misfit{not_uniform, 4, 4, "the tip does not turn as the motor does"}}) {
    const Eigen::VectorXd a = amplitude.segment(first, count);
    const double chi_square = a.dot(spread_of.block(first, first, count, count).ldlt().solve(a));
    const double size = std::max(a.head<2>().norm(), a.tail<2>().norm()), limit = options.wanted_sd * circle.radius;
    if (size > limit && chi_square_score(chi_square, count) > surprising)
      tell(kind, size, limit, sentence("%s: an error of %.3f mm repeats with every turn", text, size / mm));
  }
  return result;
}

}  // namespace ctcr
