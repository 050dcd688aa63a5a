#pragma once
#include <algorithm>
#include <span>
#include <vector>

#include "ctcr/actuation/transmission.hpp"
#include "ctcr/effects/hooks.hpp"
#include "ctcr/robot/tip_load.hpp"

namespace ctcr {

/// One row of a recording. Between rows the joints move in a straight line, which is divided into samples.
template <int N>
struct RecordedRow {
  MotorAngles<N> theta;
  TipLoad load;
  Occasion at;
  /// relative_torsion() at evenly spaced samples of the way from the row before; the last sample is this row. Set by
  /// set_frictionless_torsion() and solve_friction(); empty: tubes count as rigid in torsion [rad].
  std::vector<RelativeTorsion<N>> torsion{};
  /// moment_jumps() of a robot without effects at these samples, set by set_frictionless_torsion() [N m].
  std::vector<MomentJumps<N>> jumps{};
  ContactRadii<N> radius{};  ///< set by set_frictionless_torsion()
  /// Of a first row: whether the robot came straight from home, where all motors are at 0. Home is the first sample then.
  bool from_home = false;

  [[nodiscard]] std::size_t samples() const noexcept {
    return std::max<std::size_t>(torsion.size(), from_home ? 2 : 1);
  }
};

/// A sample of the way to a row, from 0 to samples() - 1, as a row without torsion: joints and time on a straight line, load
/// of the row. A first row has no way, or one from home, all of it at its own time. Real time: yes.
template <int N>
RecordedRow<N> sample_of(std::span<const RecordedRow<N>> rows, std::size_t row, std::size_t sample) noexcept {
  const RecordedRow<N>& end = rows[row];
  RecordedRow<N> here{end.theta, end.load, end.at};
  if (sample + 1 >= end.samples()) return here;
  if (row == 0) {
    const double done = double(sample) / double(end.samples() - 1);
    here.theta = {done * end.theta.translation, done * end.theta.rotation};
    return here;
  }
  const RecordedRow<N>& start = rows[row - 1];
  const double left = 1 - double(sample + 1) / double(end.samples());
  here.theta.translation += left * (start.theta.translation - end.theta.translation);
  here.theta.rotation += left * (start.theta.rotation - end.theta.rotation);
  here.at.time += left * (start.at.time - end.at.time);
  return here;
}

}  // namespace ctcr
