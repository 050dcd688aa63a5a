#pragma once
#include <algorithm>
#include <cmath>
#include <span>

#include "ctcr/friction/relative_torsion.hpp"
#include "ctcr/recording/row.hpp"
#include "ctcr/system/system.hpp"

namespace ctcr {

/// Divides the way to each row into samples and gives these the torsion and the moment jumps of a robot without effects. A
/// sample without an equilibrium keeps those of the sample before. The relative rotation of the tubes is not linear along a
/// long way, therefore the samples. Real time: no.
template <int N>
void set_frictionless_torsion(const System<N>& system, std::span<RecordedRow<N>> rows) {
  constexpr double most_rotation = 0.175, most_translation = 5e-3;  // between samples [rad], [m]
  Workspace<N> ws;
  Solution<N> solution;
  RelativeTorsion<N> torsion{};
  MomentJumps<N> jumps;
  bool known = false;
  for (std::size_t row = 0; row < rows.size(); ++row) {
    rows[row].radius = ContactRadii<N>(system.model.robot());
    double samples = 1;
    const bool from_home = row == 0 && rows[row].from_home;
    if (row > 0 || from_home) {
      const MotorAngles<N> home{VecN<N>::Zero(), VecN<N>::Zero()};
      const Joints<N> from = joints(system.transmission, from_home ? home : rows[row - 1].theta),
                      to = joints(system.transmission, rows[row].theta);
      samples = std::max({samples, (to.alpha - from.alpha).cwiseAbs().maxCoeff() / most_rotation,
                          (to.beta - from.beta).cwiseAbs().maxCoeff() / most_translation});
    }
    rows[row].torsion.resize(std::size_t(std::ceil(samples)) + from_home);
    rows[row].jumps.resize(rows[row].torsion.size());
    for (std::size_t k = 0; k < rows[row].torsion.size(); ++k) {
      const RecordedRow<N> here = sample_of<N>(rows, row, k);
      if (solve(system.model, joints(system.transmission, here.theta), here.load, ws, solution, system.settings) ==
          Status::ok) {
        torsion = relative_torsion(system.model, ws, torsion);
        jumps = moment_jumps(system.model, ws, jumps);
        if (!known)
          for (RecordedRow<N>& earlier : rows.first(row + 1))
            std::ranges::fill(earlier.torsion, torsion), std::ranges::fill(earlier.jumps, jumps);
        known = true;
      }
      rows[row].torsion[k] = torsion;
      rows[row].jumps[k] = jumps;
    }
  }
}

}  // namespace ctcr
