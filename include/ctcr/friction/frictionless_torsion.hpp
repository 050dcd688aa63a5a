#pragma once
#include <algorithm>
#include <cmath>
#include <span>

#include "ctcr/friction/relative_torsion.hpp"
#include "ctcr/recording/row.hpp"
#include "ctcr/system/system.hpp"

namespace ctcr {

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
