#pragma once
// The state on which the tasks of one control period act.
#include "ctcr/control/gdls.hpp"
#include "ctcr/mechanics/solve.hpp"

namespace ctcr {

/// Where the tip should be now, and how it should move. Base frame.
struct Reference {
  Pose pose;
  Vec6 velocity = Vec6::Zero();  ///< [m/s], [rad/s]
};

template <int N, class Fx = Standard>
struct ControlState {
  const Model<N, Fx>& model;
  const Settings& settings;
  TipLoad load;  ///< that the model was solved with
  Joints<N> q;   ///< that the tubes have
  Pose tip;      ///< measured, base frame
  Reference reference;
  const Workspace<N>& ws;       ///< of the solution
  const Solution<N>& solution;  ///< at q, with J
};

/// Distances [m] that must stay open: between neighbouring bases, the last to the front plate, and between neighbouring
/// tips, the last to the front plate. They add up to the length of the innermost tube.
template <int N>
struct Gaps {
  VecN<N> bases, tips;
};

/// The gaps at beta [m]. Real time: yes.
template <int N>
[[nodiscard]] Gaps<N> gaps(const Robot<N>& robot, const VecN<N>& beta) noexcept {
  Gaps<N> g;
  double base = 0, tip = 0;
  for (int i = N - 1; i >= 0; --i) {
    const double length = robot.tubes[std::size_t(i)].length;
    g.bases[i] = base - beta[i];
    g.tips[i] = length + beta[i] - tip;
    base = beta[i];
    tip = length + beta[i];
  }
  return g;
}

}  // namespace ctcr
