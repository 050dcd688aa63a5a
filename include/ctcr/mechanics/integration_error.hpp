#pragma once
// The error that integration makes, and how many steps keep it below the one allowed.
#include <algorithm>
#include <cmath>
#include <limits>

#include "ctcr/mechanics/effect_evaluation.hpp"
#include "ctcr/mechanics/settings.hpp"

namespace ctcr::detail {

/// Error of the tip position [m] that integration in `steps` makes: how far the tip is from that of the
/// equilibrium in twice as many steps, found by one Newton step from the same guess. By chance the position may agree where
/// the shape does not, so the turns of the tip and of the tubes between both count too, at the length `arm` [m].
/// @param tip  of the equilibrium in `steps`, base frame   Real time: yes, one evaluation.
template <Loading L, class Stepper, int N, class C>
CTCR_NOINLINE double integration_error(const C& c, const Joints<N>& q, const TipLoad& load, const TipGuess<N>& guess,
                                       const Steps<N>& steps, const Pose& tip, double arm) noexcept {
  using Ev = Evaluation<N, L, Derivatives::jacobian>;
  Ev fine;
  evaluate<Derivatives::jacobian, L, Stepper>(c, q, load, guess, steps.doubled(), fine);
  Vec3 change = fine.position - tip.position, turn = rotation_vector(fine.rotation * tip.rotation.transpose());
  for (int k = 0; k < 3; ++k) {
    change[k] += fine.pose(k, Ev::Col::newton);
    turn[k] += fine.pose(3 + k, Ev::Col::newton);
  }
  double angles = turn.squaredNorm();
  for (int j = Ev::Col::turns; j < Ev::Col::unknowns; ++j) {
    const double angle = fine.unknown(j, Ev::Col::newton);
    angles += angle * angle;
  }
  return std::max(change.norm(), arm * std::sqrt(angles));
}

/// Factor on all steps for which the error, of fourth order, falls below the allowed one. Real time: yes.
inline int refined(int times, double error, double allowed, int most) noexcept {
  const double ratio = 1.5 * error / allowed;
  const double wanted = ratio < 1e6 ? times * std::sqrt(std::sqrt(ratio)) : 32.0 * times;  // not finite: 32
  return wanted < most ? std::max(int(std::ceil(wanted)), std::min(times + 1, most)) : most;
}

}  // namespace ctcr::detail
