#pragma once
// Rotational offset of a tube: from readings of its tip while no other tube is deployed and its motor turns.
#include <numbers>
#include <span>

#include "ctcr/calibration/procedures/circle.hpp"
#include "ctcr/calibration/statistics.hpp"
#include "ctcr/math/functions.hpp"
#include "ctcr/math/se3.hpp"

namespace ctcr {

/// A reading of the tip of the only deployed tube.
struct TurnReading {
  double motor_angle;  ///< theta [rad], counted on over several turns
  Vec3 position;       ///< of the tip [m], tracker frame
  int direction = 0;   ///< in which the motor last turned, +1 or -1; 0: from the order of the readings
};

struct RotationOffsetOptions {
  double ratio = 1;                      ///< rho: how far the tube turns for a turn of the motor
  std::optional<Pose> T_tracker_base{};  ///< T_ref; without it everything below is meant and returned in tracker axes
  KnownCircle known{};                   ///< held instead of fitted; base frame if T_ref is given
  double bend_angle =
      -std::numbers::pi / 2;  ///< where the tube bends, from its x axis: towards -y, for a curvature < 0
                              ///< towards +y (pi/2)
  Noise
      noise{};  ///< of positions; a jitter of 0 is estimated from the residuals. A field error turns the circle a little
  double wanted_sd = 0.3 * std::numbers::pi / 180;  ///< [rad] below which no notice is worth its while
};

enum class RotationOffsetNotice {
  one_direction,      ///< figure: the direction there is
  directions_differ,  ///< figure: offset forward - backward [rad]; friction or backlash; equal ones cancel in the mean
  arc_too_short,      ///< figure: how many times less certain the offset is than on a known circle
  radius_too_small,   ///< figure: radius [m]
  not_round,          ///< figure: amplitude of a radial error twice a turn [m]
  not_planar,         ///< figure: amplitude of an out-of-plane error twice a turn [m]
  not_uniform,        ///< figure: amplitude of an error along the circle, once or twice a turn [m]
  tilted,             ///< figure: angle between the circle's normal and the base frame's z axis [rad]
  noise_larger,       ///< figure: sd of the residuals per axis [m], above the jitter stated
  outliers,           ///< figure: how many readings are left out
};

/// The notice's name.
constexpr const char* to_string(RotationOffsetNotice kind) {
  return std::array{"one_direction", "directions_differ", "arc_too_short", "radius_too_small", "not_round",
                    "not_planar",    "not_uniform",       "tilted",        "noise_larger",     "outliers"}
      .at(std::size_t(kind));
}

/// Delta of alpha = rho theta + Delta for the tube that turned: its precurvature axis x stands at alpha from the base
/// frame's x axis, both seen on the circle's plane, right-handed about z. Without T_ref the angle is from the tracker's
/// x axis projected on that plane (y, where x is within 25 degrees of its normal), right-handed about the direction of
/// insertion, which follows from the sense of rotation; a constant that depends on T_ref is then unknown.
struct RotationOffset {
  double offset, offset_sd;                             ///< mean of both directions, in (-pi, pi] [rad]
  double forward, forward_sd, backward, backward_sd;    ///< of either direction of the motor; NaN where absent [rad]
  double difference, difference_sd;                     ///< forward - backward; NaN where one is absent [rad]
  Vec3 centre, centre_sd;                               ///< [m]; an sd of 0: held
  double radius, radius_sd;                             ///< [m]
  Vec3 normal;                                          ///< unit vector, along which the tube is inserted
  double tilt_sd;                                       ///< of the normal, in its worse direction [rad]
  Vec3 zero_axis;                                       ///< unit vector along the tube's x axis at alpha = 0
  bool in_base_frame;                                   ///< the axes of these vectors: base frame, or tracker
  double rms;                                           ///< of the distances from the circle, readings used [m]
  double radial_rms, tangential_rms, out_of_plane_rms;  ///< of their components [m]
  double noise_sd;  ///< per axis, beside the field: the jitter stated, or the larger one that residuals show [m]
  double arc;       ///< of the circle that readings cover [rad]
  std::vector<Vec3> residuals;  ///< measured - circle, all readings [m]
  std::vector<int> outliers;    ///< numbers of the readings left out
  Notices<RotationOffsetNotice> notices;
};

namespace rotation_offset {

inline constexpr double degree = std::numbers::pi / 180, mm = 1e-3;

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
inline std::pair<double, int> covered(const std::vector<CircleReading>& points) {
  constexpr double turn = 2 * std::numbers::pi;
  std::vector<double> angles;
  for (const CircleReading& point : points) angles.push_back(point.angle - turn * std::floor(point.angle / turn));
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

inline void check(std::span<const TurnReading> readings, const RotationOffsetOptions& options) {
  require(readings.size() >= 6, "a rotation offset needs at least 6 readings of the tip, here are %zu",
          readings.size());
  require(std::isfinite(options.ratio) && options.ratio != 0,
          "the ratio of tube to motor angle must be finite and not 0");
  require(!options.known.radius || *options.known.radius > 0, "the known radius must be positive [m]");
  require(!options.known.normal || options.known.normal->norm() > 0, "the known normal must not be a zero vector");
  for (std::size_t i = 0; i < readings.size(); ++i)
    require(std::isfinite(readings[i].motor_angle) && readings[i].position.allFinite(),
            "reading %zu: the motor angle [rad] or the position [m] is not a finite number", i + 1);
}

/// Readings as points that turn: in the base frame, or the tracker's without T_ref.
inline std::vector<CircleReading> turning_points(std::span<const TurnReading> readings,
                                                 const RotationOffsetOptions& options) {
  const Pose T = options.T_tracker_base ? options.T_tracker_base->inverse() : Pose{};
  const std::vector<int> series = series_of(readings);
  std::vector<CircleReading> points;
  for (std::size_t i = 0; i < readings.size(); ++i)
    points.push_back({options.ratio * readings[i].motor_angle + options.bend_angle,
                      T.rotation * readings[i].position + T.position, series[i]});
  return points;
}

/// Where the fit starts; refuses a tip that does not move, or turns the wrong way.
inline Circle start_of(const std::vector<CircleReading>& points, const RotationOffsetOptions& options) {
  const KnownCircle& known = options.known;
  Circle circle = approximate_circle(points, known, Vec3::UnitX());
  if (!options.T_tracker_base && std::abs(circle.normal.x()) > std::cos(25 * degree))
    circle = approximate_circle(points, known, Vec3::UnitY());
  const double sd = std::max(robust_sd(points, circle), options.noise.position_jitter);
  require(circle.radius > 6 * sd * std::sqrt(2.0 / double(points.size())) && circle.radius > 1e-9,
          "the tip hardly moves: a circle of radius %.3f mm in noise of %.3f mm", circle.radius / mm, sd / mm);
  if (!options.T_tracker_base && !known.normal) return circle;
  const Vec3 seen = approximate_circle(points, {.centre = known.centre}, circle.reference).normal;
  const double cosine = seen.dot(known.normal.value_or(Vec3::UnitZ()));
  require(cosine > 0.5,
          "the tip turns about an axis %.0f deg from that of insertion: the sign of the ratio or the frame of the "
          "tracker is wrong",
          std::acos(std::clamp(cosine, -1.0, 1.0)) / degree);
  return circle;
}

/// The result without notices and residuals.
inline RotationOffset result_of(const CircleSolution& solved) {
  const Circle& circle = solved.fit.circle;
  const auto& column = solved.fit.column;
  const auto sd_at = [&](int i) { return std::sqrt(solved.covariance(i, i)); };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  RotationOffset result{};
  result.forward = solved.has(0) ? circle.offset[0] : nan;
  result.backward = solved.has(1) ? circle.offset[1] : nan;
  result.forward_sd = solved.has(0) ? sd_at(column[0]) : nan;
  result.backward_sd = solved.has(1) ? sd_at(column[1]) : nan;
  result.difference = wrapped(result.forward - result.backward);
  result.difference_sd = solved.has(0) && solved.has(1) ? solved.sd_along(solved.combination(1, -1)) : nan;
  result.offset = !solved.has(1)   ? result.forward
                  : !solved.has(0) ? result.backward
                                   : wrapped(result.backward + 0.5 * result.difference);
  result.offset_sd = solved.sd_along(solved.mean());
  result.centre = circle.centre;
  result.centre_sd.setZero();
  for (int axis = 0; axis < 3 && column[2] >= 0; ++axis) result.centre_sd[axis] = sd_at(column[2] + axis);
  result.radius = circle.radius;
  result.radius_sd = column[3] >= 0 ? sd_at(column[3]) : 0;
  result.normal = circle.normal;
  if (column[4] >= 0) {
    const Eigen::Matrix2d tilt = solved.covariance.block<2, 2>(column[4], column[4]);
    // The larger eigenvalue.
    result.tilt_sd = std::sqrt(0.5 * tilt.trace() + std::hypot(0.5 * (tilt(0, 0) - tilt(1, 1)), tilt(0, 1)));
  }
  const Mat3 R = circle.frame();
  result.zero_axis = R.col(0);
  Vec3 squares = Vec3::Zero();
  for (std::size_t i = 0; i < solved.used.size(); ++i) {
    const double angle = solved.used[i].angle + circle.offset[solved.used[i].series];
    squares += (rotation_z(-angle) * (R.transpose() * solved.error.segment<3>(3 * Eigen::Index(i)))).cwiseAbs2();
  }
  const Vec3 rms = (squares / double(solved.used.size())).cwiseSqrt();
  result.rms = rms.norm();
  result.radial_rms = rms[0];
  result.tangential_rms = rms[1];
  result.out_of_plane_rms = rms[2];
  result.noise_sd = std::sqrt(solved.variance);
  return result;
}

/// Notices of both directions, and of how well readings like these can do.
inline void tell_of_readings(const CircleSolution& solved, const RotationOffsetOptions& options,
                             RotationOffset& result) {
  using enum RotationOffsetNotice;
  if (!solved.has(0) || !solved.has(1))
    result.notices.add(
        one_direction, solved.has(0) ? 1 : -1, 0,
        "the readings are of one direction of rotation: friction and backlash are in the offset in full");
  else if (std::abs(result.difference) > surprising * result.difference_sd)
    result.notices.add(
        directions_differ, result.difference, surprising * result.difference_sd,

        "the two directions differ by %.2f deg (sd %.2f deg): friction or backlash; the mean removes it only if "
        "it is the same both ways",
        result.difference / degree, result.difference_sd / degree);
  // On a known circle each reading gives the angle to noise / radius.
  const double used = double(solved.used.size());
  const double backward =
      double(std::count_if(solved.used.begin(), solved.used.end(), [](const auto& r) { return r.series == 1; }));
  const double inverse_count = solved.has(0) && solved.has(1) ? 0.25 / (used - backward) + 0.25 / backward : 1 / used;
  const double best_sd = result.noise_sd / result.radius * std::sqrt(inverse_count);
  const double sd = result.noise_sd * (solved.gain.transpose() * solved.mean()).norm();
  if (sd > 2 * best_sd)
    result.notices.add(
        arc_too_short, sd / best_sd, 2,

        "the readings cover %.0f deg of the circle: the offset is %.1f times less certain than with a whole turn",
        result.arc / degree, sd / best_sd);
  if (best_sd > options.wanted_sd)
    result.notices.add(
        radius_too_small, result.radius, result.radius * best_sd / options.wanted_sd,

        "a radius of %.2f mm is small for noise of %.3f mm and %.0f readings: sd %.2f deg even on a whole turn",
        result.radius / mm, result.noise_sd / mm, used, best_sd / degree);
  const double squares = solved.error.squaredNorm() - expected_field_squares(solved.fit.J, solved.gain, solved.field);
  const double stated = solved.stated;
  if (stated > 0 && chi_square_score(squares / (stated * stated), solved.degrees_of_freedom()) > surprising)
    result.notices.add(noise_larger, result.noise_sd, stated,
                       "readings lie %.3f mm per axis off the circle, more than the stated jitter of %.3f mm",
                       result.noise_sd / mm, stated / mm);
  if (!result.outliers.empty())
    result.notices.add(outliers, double(result.outliers.size()), 0,
                       "%zu readings are far off the circle and left out, %.0f are used", result.outliers.size(), used);
}

/// Notices of a path that is no circle in the plane where it should be.
inline void tell_of_misfit(const CircleSolution& solved, const RotationOffsetOptions& options, RotationOffset& result) {
  using enum RotationOffsetNotice;
  if (options.T_tracker_base && !options.known.normal) {
    const double tilt = std::acos(std::clamp(result.normal.z(), -1.0, 1.0));
    const double limit = std::max(2 * degree, surprising * result.tilt_sd);
    if (tilt > limit)
      result.notices.add(
          tilted, tilt, limit,

          "the circle's plane is %.1f deg from the base frame's x-y plane: the frame of the tracker is wrong, or "
          "the tube sags",
          tilt / degree);
  }
  Eigen::MatrixXd J(solved.fit.J.rows(), solved.fit.J.cols() + 8);
  J << solved.fit.J, harmonics(solved.used, solved.fit.circle);
  const Eigen::MatrixXd G = ctcr::gain(J);
  if (G.size() == 0 || J.rows() < J.cols() + 3) return;
  const Eigen::VectorXd found = G * solved.error, amplitude = found.tail(8);
  const double variance = solved.variance_of(J, G, (solved.error - J * found).squaredNorm());
  const Eigen::MatrixXd covariance = propagated(G.bottomRows(8), variance, solved.field);
  struct Misfit {
    RotationOffsetNotice kind;
    int first, count;
    const char* text;
  };
  for (const auto& [kind, first, count, text] :
       {Misfit{not_round, 0, 2, "the tip's path is not round"},
        Misfit{not_planar, 2, 2, "the tip's path is not planar"},
        Misfit{not_uniform, 4, 4, "the tip does not turn as the motor does"}}) {
    const Eigen::VectorXd a = amplitude.segment(first, count);
    const Eigen::VectorXd scaled = least_squares(covariance.block(first, first, count, count), a);
    const double chi_square = a.dot(scaled);
    const double size = std::max(a.head<2>().norm(), a.tail<2>().norm()), limit = options.wanted_sd * result.radius;
    if (size > limit && chi_square_score(chi_square, count) > surprising)
      result.notices.add(kind, size, limit, "%s: an error of %.3f mm repeats with every turn", text, size / mm);
  }
}

}  // namespace rotation_offset

/// Finds the rotation offset of a tube from readings of its tip, better in both directions of rotation: their mean, as
/// torsion and friction are the same both ways. Outliers are found with a robust loss and left out of the least squares.
/// @throws std::invalid_argument for too few readings or angles, a tip that does not move, or one that turns against
///         ratio * motor_angle. Real time: no.
/// Ref: Boyer et al., Eq. (5).
[[nodiscard]] inline RotationOffset fit_rotation_offset(std::span<const TurnReading> readings,
                                                        RotationOffsetOptions options = {}) {
  using namespace rotation_offset;
  check(readings, options);
  if (options.known.normal) options.known.normal->normalize();
  const std::vector<CircleReading> points = turning_points(readings, options);
  const auto [arc, distinct] = covered(points);
  require(distinct >= 4, "a rotation offset needs readings at 4 different angles, here are %d", distinct);

  const CircleSolution solved = solve_circle(points, start_of(points, options), options.known, options.noise);
  RotationOffset result = result_of(solved);
  result.in_base_frame = options.T_tracker_base.has_value();
  result.arc = arc;
  result.outliers = solved.outliers;
  for (const auto& [angle, position, series] : points)
    result.residuals.push_back(position - solved.fit.circle.at(angle, series));
  tell_of_readings(solved, options, result);
  tell_of_misfit(solved, options, result);
  return result;
}

}  // namespace ctcr
