#pragma once
// Paths of the tip in space and time, through points on a smooth curve.
#include <algorithm>
#include <span>
#include <unsupported/Eigen/Splines>
#include <vector>

#include "ctcr/control/control_state.hpp"
#include "ctcr/control/trapezoid.hpp"
#include "ctcr/control/way.hpp"

namespace ctcr {

/// A cubic spline through points, travelled from rest to rest along its arc length. Speed and acceleration bound the motion
/// along the curve; across it the acceleration is the square of the speed times the curvature. Through points that are no
/// way, see check(), it rests at the first one.
class SplinePath {
public:
  /// @param points  at least 4, none twice in a row [m], base frame. Allocates. Otherwise as
  ///                Polyline (polyline.hpp).
  SplinePath(std::span<const Vec3> points, double speed, double acceleration,
             const Mat3& orientation = Mat3::Identity())
    : orientation_(orientation), start_(detail::first_of(points)) {
    if (points.size() < 4 || !detail::are_a_way(points, 0) || !is_rotation(orientation)) return;
    Eigen::Matrix3Xd columns(3, Eigen::Index(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i) columns.col(Eigen::Index(i)) = points[i];
    curve_ = Eigen::SplineFitting<Curve>::Interpolate(columns, 3);
    const auto parts = 64 * (points.size() - 1);
    for (std::size_t k = 0; k < parts; ++k)
      arc_length_.push_back(arc_length_.back() +
                            length_between(double(k) / double(parts), double(k + 1) / double(parts)));
    motion_ = {arc_length_.back(), speed, acceleration};
  }

  /// ok; invalid_settings: there are fewer than 4 points, one is not finite, two in a row are the same, the orientation is
  /// no rotation, or all is no motion (Trapezoid::check()). Real time: yes.
  [[nodiscard]] Status check() const noexcept { return motion_.check(); }
  /// Of the curve [m]. Real time: yes.
  [[nodiscard]] double length() const noexcept { return arc_length_.back(); }
  /// Time from start to end [s]. Real time: yes.
  [[nodiscard]] double duration() const noexcept { return motion_.duration(); }

  /// Pose and velocity of the tip at the time t [s], base frame; before the start and after the end it rests there.
  /// Real time: yes.
  [[nodiscard]] Reference at(double t) const noexcept {
    Reference r{{orientation_, start_}};
    if (!(duration() > 0)) return r;
    const auto [s, v] = motion_.at(t);
    const auto [point, slope] = here(parameter(s));
    r.pose.position = point;
    r.velocity.head<3>() = v * slope.normalized();
    return r;
  }

private:
  using Curve = Eigen::Spline<double, 3, 3>;
  struct Here {
    Vec3 point, slope;
  };

  [[nodiscard]] Here here(double u) const noexcept {
    const auto d = curve_.derivatives<1>(u);
    return {d.col(0), d.col(1)};
  }
  /// By Gauss' rule of three points.
  [[nodiscard]] double length_between(double a, double b) const noexcept {
    const double middle = 0.5 * (a + b), half = 0.5 * (b - a), node = std::sqrt(0.6) * half;
    const auto speed = [this](double u) { return here(u).slope.norm(); };
    return half * (5 * speed(middle - node) + 8 * speed(middle) + 5 * speed(middle + node)) / 9;
  }
  /// Where the arc length is s: by bisection of the table, then Newton's method.
  [[nodiscard]] double parameter(double s) const noexcept {
    const auto after = std::upper_bound(arc_length_.begin() + 1, arc_length_.end() - 1, s);
    const auto k = after - arc_length_.begin() - 1;
    const double parts = double(arc_length_.size() - 1), start = double(k) / parts;
    double u = start + (s - arc_length_[std::size_t(k)]) / (*after - arc_length_[std::size_t(k)]) / parts;
    for (int round = 0; round < 3; ++round)
      u += (s - arc_length_[std::size_t(k)] - length_between(start, u)) / here(u).slope.norm();
    return std::clamp(u, 0.0, 1.0);
  }

  Curve curve_;
  std::vector<double> arc_length_{0};  ///< of equal parts of the curve's parameter [m]
  Trapezoid motion_;
  Mat3 orientation_;
  Vec3 start_;
};

}  // namespace ctcr
