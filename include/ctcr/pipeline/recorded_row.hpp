#pragma once
#include <span>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/mechanics/tip_twist.hpp"
#include "ctcr/pipeline/system.hpp"

namespace ctcr {

/// One row of a recording.
template <int N>
struct RecordedRow {
  MotorAngles<N> theta;
  TipLoad load;
  Occasion at;
  std::array<double, N> twist{};  ///< by add_twist(); 0: tubes count as stiff in torsion [rad]
};

/// Gives each row the twist_between() of a robot without effects in its equilibrium there; a row without one keeps that
/// of the row before. Real time: no.
template <int N>
void add_twist(const System<N>& system, std::span<RecordedRow<N>> rows) {
  Workspace<N> ws;
  Solution<N> solution;
  std::array<double, N> twist{};
  std::size_t known = 0;
  for (std::size_t row = 0; row < rows.size(); ++row) {
    const Joints<N> q = joints(system.transmission, rows[row].theta);
    if (solve(system.model, q, rows[row].load, ws, solution, system.settings) == Status::ok) {
      twist = twist_between(ws, twist);
      for (; known < row; ++known) rows[known].twist = twist;  // of the first that is known
      known = rows.size();
    }
    rows[row].twist = twist;
  }
}

}  // namespace ctcr
