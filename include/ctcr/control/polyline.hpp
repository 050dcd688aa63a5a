#pragma once
// Paths of the tip in space and time, through corners on straight lines.
#include <span>
#include <vector>

#include "ctcr/control/control_state.hpp"
#include "ctcr/control/trapezoid.hpp"
#include "ctcr/control/way.hpp"

namespace ctcr {

/// Straight lines from corner to corner, with a rest at each: a corner at speed would need infinite acceleration. Through
/// corners that are no way, see check(), it rests at the first one.
class Polyline {
public:
  /// @param corners  [m], base frame   @param orientation  of the tip, all along
  /// Allocates. speed and acceleration as Trapezoid.
  Polyline(std::span<const Vec3> corners, double speed, double acceleration, const Mat3& orientation = Mat3::Identity())
    : orientation_(orientation), start_(detail::first_of(corners)) {
    if (!detail::are_a_way(corners, -1) || !is_rotation(orientation)) return;
    status_ = Trapezoid(0, speed, acceleration).check();
    for (std::size_t i = 1; i < corners.size() && status_ == Status::ok; ++i) {
      const Vec3 way = corners[i] - corners[i - 1];
      const double length = way.norm();
      const Trapezoid motion(length, speed, acceleration);
      status_ = motion.check();
      if (!(motion.duration() > 0)) continue;  // no way: it rests where it is
      edges_.push_back({corners[i - 1], way / length, motion, duration_});
      duration_ += motion.duration();
    }
    if (!(duration_ < HUGE_VAL)) status_ = Status::invalid_settings;
    if (status_ != Status::ok) edges_.clear(), duration_ = 0;
  }

  /// ok; invalid_settings: there is no corner, one is not finite, the orientation is no rotation, or an edge no motion
  /// (Trapezoid::check()). Real time: yes.
  [[nodiscard]] Status check() const noexcept { return status_; }
  /// Time from start to end [s]. Real time: yes.
  [[nodiscard]] double duration() const noexcept { return duration_; }

  /// Pose and velocity of the tip at the time t [s], base frame; before the start and after the end it rests there.
  /// Real time: yes.
  [[nodiscard]] Reference at(double t) const noexcept {
    Reference r{{orientation_, start_}};
    if (edges_.empty()) return r;
    std::size_t k = 0;
    while (k + 1 < edges_.size() && edges_[k + 1].begin <= t) ++k;
    const Edge& edge = edges_[k];
    const auto [s, v] = edge.motion.at(t - edge.begin);
    r.pose.position = edge.start + s * edge.direction;
    r.velocity.head<3>() = v * edge.direction;
    return r;
  }

private:
  struct Edge {
    Vec3 start, direction;
    Trapezoid motion;
    double begin;  ///< [s]
  };
  std::vector<Edge> edges_;
  Mat3 orientation_;
  Vec3 start_;
  Status status_ = Status::invalid_settings;
  double duration_ = 0;
};

}  // namespace ctcr
