#pragma once
// Motion along a line with bounded speed and acceleration, from rest to rest.
#include <algorithm>
#include <cmath>

namespace ctcr {

/// Speeds up at `acceleration`, travels at `speed`, slows down at `acceleration`; a line too short for that speed has
/// no travel at it. Without speed or acceleration it rests at the start. Exact at any time. Real time: yes.
class Trapezoid {
public:
  struct Point {
    double position, velocity;  ///< [m], [m/s]
  };

  Trapezoid() noexcept = default;
  /// @param length  [m], >= 0   @param speed  [m/s], > 0   @param acceleration  [m/s^2], > 0
  Trapezoid(double length, double speed, double acceleration) noexcept {
    if (!(length > 0 && speed > 0 && acceleration > 0)) return;
    length_ = length;
    speed_ = std::min(speed, std::sqrt(length * acceleration));
    acceleration_ = acceleration;
    ramp_ = speed_ / acceleration;
    duration_ = length / speed_ + ramp_;
  }

  /// Time from start to end [s].
  [[nodiscard]] double duration() const noexcept { return duration_; }

  /// Where it is at the time t [s]; before the start and after the end it rests there.
  [[nodiscard]] Point at(double t) const noexcept {
    if (t <= 0) return {0, 0};
    if (t >= duration_) return {length_, 0};
    if (t < ramp_) return {0.5 * acceleration_ * t * t, acceleration_ * t};
    const double left = duration_ - t;
    if (left < ramp_) return {length_ - 0.5 * acceleration_ * left * left, acceleration_ * left};
    return {speed_ * (t - 0.5 * ramp_), speed_};
  }

private:
  double length_ = 0, speed_ = 0, acceleration_ = 1, ramp_ = 0, duration_ = 0;
};

}  // namespace ctcr
