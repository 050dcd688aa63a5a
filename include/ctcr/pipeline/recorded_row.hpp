#pragma once
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/mechanics/contact_twist.hpp"
#include "ctcr/pipeline/system.hpp"

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

/// Gives each row the twist and the jumps of a robot without effects in its equilibrium on the way there; a place without
/// one keeps those of the place before; and where the tubes touch. On a long way tubes do not turn evenly against one another: it is cut into parts. Real time: no.
template <int N>
void add_twist(const System<N>& system, std::span<RecordedRow<N>> rows) {
  constexpr double most_rotation = 0.175, most_translation = 5e-3;  // of a part [rad], [m]
  Workspace<N> ws;
  Solution<N> solution;
  Twist<N> twist{};
  MomentJumps<N> jumps;
  bool known = false;
  for (std::size_t row = 0; row < rows.size(); ++row) {
    rows[row].radius = ContactRadii<N>(system.model.robot());
    double parts = 1;
    const bool from_home = row == 0 && rows[row].from_home;
    if (row > 0 || from_home) {
      const MotorAngles<N> home{VecN<N>::Zero(), VecN<N>::Zero()};
      const Joints<N> from = joints(system.transmission, from_home ? home : rows[row - 1].theta),
                      to = joints(system.transmission, rows[row].theta);
      parts = std::max({parts, (to.alpha - from.alpha).cwiseAbs().maxCoeff() / most_rotation,
                        (to.beta - from.beta).cwiseAbs().maxCoeff() / most_translation});
    }
    rows[row].twist.resize(std::size_t(std::ceil(parts)) + from_home);
    rows[row].jumps.resize(rows[row].twist.size());
    for (std::size_t place = 0; place < rows[row].twist.size(); ++place) {
      const RecordedRow<N> here = on_the_way<N>(rows, row, place);
      if (solve(system.model, joints(system.transmission, here.theta), here.load, ws, solution, system.settings) ==
          Status::ok) {
        twist = twist_of(system.model, ws, system.settings.steps, twist);
        jumps = moment_jumps(system.model, ws, system.settings.steps, jumps);
        if (!known)
          for (RecordedRow<N>& earlier : rows.first(row + 1))
            std::ranges::fill(earlier.twist, twist), std::ranges::fill(earlier.jumps, jumps);
        known = true;
      }
      rows[row].twist[place] = twist;
      rows[row].jumps[place] = jumps;
    }
  }
}

}  // namespace ctcr
