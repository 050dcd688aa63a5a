#pragma once
// Curvature and curved length of a tube from points of its outline in a photo: a straight line, then an arc.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>

#include "ctcr/calibration/procedures/notice.hpp"
#include "ctcr/calibration/procedures/propagation.hpp"
#include "ctcr/calibration/procedures/small_problem.hpp"
#include "ctcr/calibration/statistics.hpp"

namespace ctcr {

struct TubeShapeOptions {
  double scale = 1;     ///< metres to a unit of the points
  double scale_sd = 0;  ///< of it, relative: what a known length in the picture leaves uncertain
  double point_sd = 0;  ///< of a point, per axis, in its unit; 0: from the residuals
};

enum class TubeShapeNotice {
  outliers,            ///< figure: points left out
  straight_too_short,  ///< figure: length of the straight part seen [m]; the curve may start outside the picture
  arc_too_short,       ///< figure: relative sd of the curvature
  curvature_varies,    ///< figure: relative change of the curvature along the curved part
  straight_part_bent,  ///< figure: curvature of the straight part [1/m]
  residuals_large,     ///< figure: sd of the residuals [m], above the one stated
};

/// The notice's name.
constexpr const char* to_string(TubeShapeNotice kind) {
  return std::array{"outliers",         "straight_too_short", "arc_too_short",
                    "curvature_varies", "straight_part_bent", "residuals_large"}
      .at(std::size_t(kind));
}

/// Lengths in metres; positions in the unit of the points.
struct TubeShapeFit {
  double curvature, curvature_sd;          ///< kappa >= 0 [1/m]; a picture does not show its sign
  double curved_length, curved_length_sd;  ///< from where the curve starts to the last point, the tip [m]
  double correlation;                      ///< of the two
  double straight_length;                  ///< of the straight part that points cover [m]
  Eigen::Vector2d junction;                ///< where the curve starts
  Eigen::Vector2d heading;                 ///< unit vector of the straight part, towards the curve
  Eigen::Vector2d tip;                     ///< end of the curve
  double rms, noise_sd;                    ///< of the distances from the shape, and the sd used [m]
  std::vector<double> residuals;           ///< distance of each point from the shape, with sign [m]
  std::vector<double> arc_position;        ///< of its foot, from where the curve starts; straight part < 0 [m]
  std::vector<int> outliers;               ///< numbers of the points left out
  Notices<TubeShapeNotice> notices;
};

namespace tube_shape {

using Vec2 = Eigen::Vector2d;

/// Straight line that ends at `junction` with direction `heading`, then an arc that turns left for a curvature > 0.
struct LineAndArc {
  Vec2 junction;
  double heading;    ///< [rad]
  double curvature;  ///< [1/unit]
};

/// Distance of a point from the line or, where it lies beyond the junction, from the arc's circle; left is positive.
/// Regular at curvature 0.
template <class T>
T distance(const Vec2& point, const T* junction, const T& heading, const T& curvature) {
  using std::cos, std::sin, std::sqrt;
  const T x = point.x() - junction[0], y = point.y() - junction[1];
  const T along = cos(heading) * x + sin(heading) * y, across = cos(heading) * y - sin(heading) * x;
  const T a = T(1) - curvature * across, b = curvature * along;
  if (along < T(0) && a > T(0)) return across;  // behind the junction, and not the end of an arc that comes back
  return (T(2) * across - curvature * (along * along + across * across)) / (T(1) + sqrt(a * a + b * b));
}

/// Arc length of a point's foot from the junction.
inline double arc_position(const Vec2& point, const LineAndArc& bend) {
  const Vec2 d = point - bend.junction, e(std::cos(bend.heading), std::sin(bend.heading));
  const double along = e.dot(d), across = e.x() * d.y() - e.y() * d.x();
  if (along < 0 && bend.curvature * across < 1) return along;
  const double sign = bend.curvature < 0 ? -1 : 1, k = std::abs(bend.curvature);
  if (k * d.norm() < 1e-9) return along;
  const double angle = std::atan2(k * along, 1 - k * sign * across);
  return (angle < 0 ? angle + 2 * std::numbers::pi : angle) / k;
}

/// Distance of a point over `scale`, by junction, heading and curvature.
struct LineAndArcResidual {
  static constexpr int size = 1, parameters = 4;
  Vec2 point;
  double scale;
  template <class T>
  void operator()(const T* p, T* residual) const {
    *residual = distance(point, p, p[2], p[3]) / T(scale);
  }
};

inline double distance(const Vec2& point, const LineAndArc& bend) {
  return distance<double>(point, bend.junction.data(), bend.heading, bend.curvature);
}

/// A bend after the robust fit, and the derivative (points, 4) of the distances by junction, heading and curvature.
struct Refined {
  LineAndArc bend;
  Eigen::MatrixXd J;
};

inline Refined refined(std::span<const Vec2> points, LineAndArc bend, double scale, double loss) {
  SmallProblem<LineAndArcResidual, LineAndArcResidual::parameters> problem(
      {bend.junction.x(), bend.junction.y(), bend.heading, bend.curvature}, {0, 1, 2, 3});
  for (const Vec2& point : points) problem.add({point, scale}, loss / scale);
  problem.minimise(scale, 1e-9 * scale);
  const auto& x = problem.parameters();
  return {{{x[0], x[1]}, x[2], x[3]}, scale * problem.jacobian()};
}

inline double median_distance(std::span<const Vec2> points, const LineAndArc& bend) {
  std::vector<double> d;
  for (const Vec2& point : points) d.push_back(std::abs(distance(point, bend)));
  return median(d);
}

/// At most 60 of the points in their order along the tube: a walk to the nearest point not yet visited, from where it is
/// shortest. Points that only long steps reach are outliers and left out.
inline std::vector<Vec2> in_order(std::span<const Vec2> points) {
  std::vector<Vec2> some;
  const double stride = std::max(1.0, double(points.size()) / 60);
  for (double i = 0; i < double(points.size()); i += stride) some.push_back(points[std::size_t(i)]);
  const std::size_t n = some.size();
  std::vector<double> nearest(n, std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      if (i != j) nearest[i] = std::min(nearest[i], (some[i] - some[j]).norm());
  const double longest = 5 * median(nearest);

  std::vector<Vec2> best;
  double shortest = std::numeric_limits<double>::infinity();
  for (std::size_t first = 0; first < n; ++first) {
    std::vector<Vec2> order = some, kept;
    std::swap(order[0], order[first]);
    double length = 0, before = 0;
    for (std::size_t i = 1; i < n; ++i) {
      const Vec2 here = order[i - 1];
      const auto next = std::min_element(
          order.begin() + std::ptrdiff_t(i), order.end(),
          [&](const Vec2& a, const Vec2& b) { return (a - here).squaredNorm() < (b - here).squaredNorm(); });
      const double step = (*next - here).norm();
      std::swap(order[i], *next);
      length += step;
      if (std::max(before, step) <= longest || (i == 1 && step <= longest)) kept.push_back(here);
      before = step;
    }
    if (before <= longest) kept.push_back(order.back());
    if (length < shortest && kept.size() >= 6) {
      shortest = length;
      best = kept;
    }
  }
  return best.empty() ? some : best;
}

/// A start with the points [0, k) on the straight part and the others on the arc: line and circle of least squares.
inline LineAndArc start_at(const std::vector<Vec2>& order, std::size_t k) {
  Vec2 mean = Vec2::Zero();
  for (std::size_t i = 0; i < k; ++i) mean += order[i] / double(k);
  Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < k; ++i) moments += (order[i] - mean) * (order[i] - mean).transpose();
  const double principal = 0.5 * std::atan2(2 * moments(0, 1), moments(0, 0) - moments(1, 1));
  Vec2 along(std::cos(principal), std::sin(principal));
  if (along.dot(order[k] - order[0]) < 0) along = -along;
  // x^2 + y^2 = 2 c . (x, y) + rest, about the point k.
  const Eigen::Index n = Eigen::Index(order.size() - k);
  Eigen::MatrixXd M(n, 3);
  Eigen::VectorXd squares(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vec2 p = order[k + std::size_t(i)] - order[k];
    M.row(i) << 2 * p.x(), 2 * p.y(), 1;
    squares[i] = p.squaredNorm();
  }
  const Vec3 x = least_squares(M, squares);
  const double radius = std::sqrt(std::max(x[2] + x.head<2>().squaredNorm(), 1e-12 * squares.maxCoeff()));
  const double side = along.x() * x[1] - along.y() * x[0];
  return {mean + along.dot(order[k] - mean) * along, std::atan2(along.y(), along.x()), std::copysign(1 / radius, side)};
}

/// Starts for positions of the junction along the tube, either end of which may be the straight one.
inline std::vector<LineAndArc> starts(std::span<const Vec2> points) {
  std::vector<Vec2> order = in_order(points);
  std::vector<LineAndArc> all;
  const std::size_t n = order.size();
  for (int end = 0; end < 2; ++end, std::reverse(order.begin(), order.end()))
    for (const double fraction : {0.1, 0.25, 0.4, 0.55, 0.7, 0.85})
      all.push_back(start_at(order, std::clamp<std::size_t>(std::size_t(fraction * double(n)), 2, n - 3)));
  return all;
}

}  // namespace tube_shape

/// Fits a straight line followed by an arc of constant curvature to points of a tube in any order, and finds which end is
/// curved. A robust loss finds outliers, which are left out.
/// @param points  on the middle of the tube (or all on one edge), taken up to its tip
/// @throws std::invalid_argument for fewer than 8 points, coincident points, and numbers that are not finite. Real time: no.
[[nodiscard]] inline TubeShapeFit fit_tube_shape(std::span<const Eigen::Vector2d> points,
                                                 const TubeShapeOptions& options) {
  using namespace tube_shape;
  require(points.size() >= 8, "a tube's shape needs at least 8 points, here are %zu", points.size());
  require(options.scale > 0 && std::isfinite(options.scale), "the scale must be positive [m per unit of the points]");
  require(options.scale_sd >= 0 && options.point_sd >= 0, "standard deviations must not be negative");
  Vec2 low = points[0], high = points[0];
  for (std::size_t i = 0; i < points.size(); ++i) {
    require(points[i].allFinite(), "point %zu is not a pair of finite numbers", i + 1);
    low = low.cwiseMin(points[i]);
    high = high.cwiseMax(points[i]);
  }
  const char* no_bend = "no straight part that goes over into an arc is seen: take points of both";
  const double size = (high - low).norm();
  require(size > 0, "all points are in one place");

  // A robust fit from every start; the best one that has points of both parts to the end, with the noise that it shows.
  LineAndArc bend{};
  double best = std::numeric_limits<double>::infinity();
  for (const LineAndArc& start : starts(points)) {
    const LineAndArc found = refined(points, start, 0.01 * size, 0.01 * size).bend;
    double cost = 0;
    int straight = 0;
    for (const Vec2& point : points) {
      cost += std::log1p(std::pow(distance(point, found) / (0.003 * size), 2));
      straight += arc_position(point, found) < 0;
    }
    if (cost < best && straight > 1 && straight + 2 < int(points.size())) {
      best = cost;
      bend = found;
    }
  }
  require(best < std::numeric_limits<double>::infinity(), "%s", no_bend);
  double sd = 0;
  const auto scale = [&] { return std::max({sd, options.point_sd, 1e-4 * size}); };  // no photo is finer
  for (int k = 0; k < 3; ++k) {
    sd = median_distance(points, bend) / median_length_1;
    bend = refined(points, bend, scale(), 2.5 * scale()).bend;
  }
  sd = median_distance(points, bend) / median_length_1;
  TubeShapeFit result{};
  std::vector<Vec2> used;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (std::abs(distance(points[i], bend)) > 4.5 * scale())
      result.outliers.push_back(int(i));
    else
      used.push_back(points[i]);
  }
  require(used.size() >= 8, "only %zu points lie on one shape, 8 are needed", used.size());
  const Refined fit = refined(used, bend, scale(), 0);
  bend = fit.bend;

  // Errors of junction, heading and curvature, then of the length, whose other end is the last point.
  const Eigen::Index n = Eigen::Index(used.size());
  const double degrees = double(n - 4), k = bend.curvature;
  Eigen::VectorXd error(n), s(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    error[i] = distance(used[std::size_t(i)], bend);
    s[i] = arc_position(used[std::size_t(i)], bend);
  }
  const Eigen::MatrixXd G = gain(fit.J);
  require(G.size() > 0 && s.maxCoeff() > 0 && s.minCoeff() < 0, "%s", no_bend);
  const double variance = std::max(options.point_sd * options.point_sd, error.squaredNorm() / degrees);
  const double length = s.maxCoeff();
  // Foot of the tip: s = atan2(k along, 1 - k across) / k; its error along the shape, and the shape's own motion.
  Eigen::Index last;
  s.maxCoeff(&last);
  Eigen::MatrixXd D = Eigen::MatrixXd::Zero(2, 4);  // (curvature, length) by the four parameters
  D(0, 3) = 1;
  for (int j = 0; j < 4; ++j) {
    const double h = j < 2 ? 1e-5 * size : j == 2 ? 1e-5 : 1e-5 / size;
    const auto moved = [&](double t) {
      LineAndArc b = bend;
      (j < 2 ? b.junction[j] : j == 2 ? b.heading : b.curvature) += t;
      return arc_position(used[std::size_t(last)], b);
    };
    D(1, j) = (moved(h) - moved(-h)) / (2 * h);
  }
  const Eigen::MatrixXd DG = product(D, G);
  Eigen::Matrix2d covariance = variance * product(DG, DG.transpose());
  covariance(1, 1) += variance;  // of the last point along the shape
  const double m = options.scale, relative = options.scale_sd;
  result.curvature = std::abs(k) / m;
  result.curved_length = length * m;
  const double c00 = covariance(0, 0) / (m * m) + std::pow(result.curvature * relative, 2);
  const double c11 = covariance(1, 1) * m * m + std::pow(result.curved_length * relative, 2);
  const double c01 =
      std::copysign(1.0, k) * covariance(0, 1) - result.curvature * result.curved_length * relative * relative;
  result.curvature_sd = std::sqrt(c00);
  result.curved_length_sd = std::sqrt(c11);
  result.correlation = c01 / std::sqrt(c00 * c11);
  result.straight_length = -s.minCoeff() * m;
  result.junction = bend.junction;
  result.heading = {std::cos(bend.heading), std::sin(bend.heading)};
  const double turned = bend.heading + 0.5 * k * length;
  const double chord = std::abs(k * length) > 1e-9 ? 2 * std::sin(0.5 * k * length) / k : length;
  result.tip = bend.junction + chord * Vec2(std::cos(turned), std::sin(turned));
  result.rms = m * std::sqrt(error.squaredNorm() / double(n));
  result.noise_sd = m * std::sqrt(variance);
  for (const Vec2& point : points) {
    result.residuals.push_back(m * distance(point, bend));
    result.arc_position.push_back(m * arc_position(point, bend));
  }

  using enum TubeShapeNotice;
  constexpr double mm = 1e-3;
  if (!result.outliers.empty())
    result.notices.add(outliers, double(result.outliers.size()), 0,
                       "%zu of %zu points are far off the shape and left out", result.outliers.size(), points.size());
  const double straight_limit = 0.1 * result.curved_length;
  if (result.straight_length < straight_limit)
    result.notices.add(straight_too_short, result.straight_length, straight_limit,
                       "only %.1f mm of the straight part are seen: the curved length may be too short",
                       result.straight_length / mm);
  if (result.curvature_sd > 0.1 * result.curvature)
    result.notices.add(arc_too_short, result.curvature_sd / result.curvature, 0.1,
                       "the curvature is uncertain by %.0f %%: take more or better points of the curved part",
                       100 * result.curvature_sd / result.curvature);
  const double stated = options.point_sd * options.point_sd;
  if (stated > 0 && chi_square_score(error.squaredNorm() / stated, degrees) > surprising)
    result.notices.add(residuals_large, std::sqrt(error.squaredNorm() / degrees) * m, options.point_sd * m,
                       "points lie %.3f mm off the shape, more than the %.3f mm stated",
                       std::sqrt(error.squaredNorm() / degrees) * m / mm, options.point_sd * m / mm);

  // A curvature that grows along the arc by `change`, and a bent straight part: how they move points sideways.
  Eigen::MatrixXd wide(n, 6);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double x = s[i] / length;
    wide.row(i) << fit.J.row(i), s[i] > 0 ? k * length * length * (x * x * x / 6 - x * x / 4) : 0.0,
        s[i] < 0 ? 0.5 * s[i] * s[i] : 0.0;
  }
  const Eigen::MatrixXd wide_gain = gain(wide);
  if (wide_gain.size() == 0 || degrees < 5) return result;
  const Eigen::VectorXd x = wide_gain * error;
  const double rest = std::max(stated, (error - wide * x).squaredNorm() / (degrees - 2));
  const Eigen::Vector2d spread = (rest * wide_gain.bottomRows(2).rowwise().squaredNorm()).cwiseSqrt();
  if (std::abs(x[4]) > std::max(0.1, surprising * spread[0]))
    result.notices.add(curvature_varies, x[4], std::max(0.1, surprising * spread[0]),
                       "the curvature changes by %.0f %% along the curved part", 100 * x[4]);
  const double bent_limit = std::max(0.02 * std::abs(k), surprising * spread[1]);
  if (std::abs(x[5]) > bent_limit)
    result.notices.add(straight_part_bent, std::abs(x[5]) / m, bent_limit / m,
                       "the straight part has a curvature of %.2f 1/m", std::abs(x[5]) / m);
  return result;
}

/// Metres to a unit, from two points of the picture whose distance is known.
/// @throws std::invalid_argument where they coincide or the length is not positive. Real time: no.
[[nodiscard]] inline double picture_scale(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double length) {
  require((a - b).norm() > 0 && length > 0 && std::isfinite(length),
          "a scale needs two different points and the positive distance between them [m]");
  return length / (a - b).norm();
}

}  // namespace ctcr
