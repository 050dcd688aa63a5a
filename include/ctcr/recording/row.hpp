#pragma once
#include <algorithm>
#include <span>
#include <vector>

#include "ctcr/actuation/transmission.hpp"
#include "ctcr/effects/hooks.hpp"
#include "ctcr/robot/tip_load.hpp"

namespace ctcr {

/// One row of a recording.
template <int N>
struct RecordedRow {
  MotorAngles<N> theta;
  TipLoad load;
  Occasion at;
  /// The twist_of() the tubes at evenly spaced places of the way from the row before, the last of them in this
  /// row, as add_twist() and wind_up() give it; none: tubes count as stiff in torsion [rad].
  std::vector<Twist<N>> twist{};
  /// The moment_jumps() of a robot without effects at these places, as add_twist() gives them [N m].
  std::vector<MomentJumps<N>> jumps{};
  ContactRadii<N> radius{};  ///< as add_twist() gives them
  /// Of a first row: whether the robot came straight from home, where all motors are at 0. Home is the first place then.
  bool from_home = false;

  [[nodiscard]] std::size_t places() const noexcept { return std::max<std::size_t>(twist.size(), from_home ? 2 : 1); }
};

/// What stands at a place on the way to a row, from 0 to places() - 1: joints and time on a straight line, the load of the
/// row. A first row has no way, or one from home, all of it at its own time. Real time: no (allocates).
template <int N>
RecordedRow<N> on_the_way(std::span<const RecordedRow<N>> rows, std::size_t row, std::size_t place) {
  const RecordedRow<N>& end = rows[row];
  RecordedRow<N> here{end.theta, end.load, end.at};
  if (place + 1 >= end.places()) return here;
  if (row == 0) {
    const double done = double(place) / double(end.places() - 1);
    here.theta = {done * end.theta.translation, done * end.theta.rotation};
    return here;
  }
  const RecordedRow<N>& start = rows[row - 1];
  const double left = 1 - double(place + 1) / double(end.places());
  here.theta.translation += left * (start.theta.translation - end.theta.translation);
  here.theta.rotation += left * (start.theta.rotation - end.theta.rotation);
  here.at.time += left * (start.at.time - end.at.time);
  return here;
}

}  // namespace ctcr
