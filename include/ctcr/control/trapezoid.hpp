#pragma once
// Motion along a line with bounded speed and acceleration, from rest to rest.
#include <algorithm>
#include <cmath>

#include "ctcr/core/status.hpp"

namespace ctcr {

/// Speeds up at `acceleration`, travels at `speed`, slows down at `acceleration`; a line too short for that speed has
/// no travel at it. What is no motion, see check(), rests at the start. Exact at any time. Real time: yes.
class Trapezoid {
public:
  struct Point {
    double position, velocity;  ///< [m], [m/s]
  };

  Trapezoid() noexcept = default;
  /// @param length  [m], >= 0   @param speed  [m/s], > 0   @param acceleration  [m/s^2], > 0
  /// Infinity is no bound. It may stand for speed or acceleration, not for both: the motion would take no time.
  Trapezoid(double length, double speed, double acceleration) noexcept {
    const double fastest = std::min(speed, std::sqrt(length) * std::sqrt(acceleration)), ramp = fastest / acceleration;
    const double duration = length > 0 ? length / fastest + ramp : 0;
    if (!(length >= 0 && speed > 0 && acceleration > 0 && duration < HUGE_VAL)) return;
    status_ = Status::ok;
    length_ = length, speed_ = fastest, acceleration_ = acceleration, ramp_ = ramp, duration_ = duration;
  }

  /// ok; invalid_settings: length, speed or acceleration is NaN or out of range, or the time that they take is no number.
  [[nodiscard]] Status check() const noexcept { return status_; }

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
  Status status_ = Status::invalid_settings;
};

}  // namespace ctcr
