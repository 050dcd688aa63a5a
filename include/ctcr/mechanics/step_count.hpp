#pragma once
// How many integration steps a segment needs: a first guess from bounds, and the error that a number of steps makes.
#include <algorithm>
#include <cmath>
#include <limits>

#include "ctcr/mechanics/effect_evaluation.hpp"
#include "ctcr/mechanics/settings.hpp"

namespace ctcr::detail {

/// Steps per segment from which refinement starts: no step is longer than the length over which the state of the rod
/// changes, 1 / sqrt(F / EI + u^2 / 4 + w^2 / 4 + rho u / 2). Its terms are the wave number of a loaded rod, half the turn
/// of its frame, half the twist of a tube by the moment at its tip, and the growth of relative torsion, with bounds on
/// curvature u and force F in the segment. Neither angles nor unknowns enter, so the same joints and load give the same
/// number. Real time: yes.
template <int N>
inline int first_steps(const Coefficients<N>& c, const VecN<N>& beta, const TipLoad& load, int most) noexcept {
  const Events<N> events = sort_events(c, beta);
  const double length = std::max(events.s[0], 0.0), moment = load.moment.norm(), w = moment / c.kz[0],
               force = load.force.norm() + c.gravity.norm() * c.weight[N - 1] * length;
  std::array<bool, N> curved{};
  int present = 0;
  double steps = 1;
  for (std::size_t e = 0; e < 2 * N && events.s[e] > 0; ++e) {
    const int id = events.id[e];
    if (id < N)
      present = id + 1, curved[std::size_t(id)] = c.curved[std::size_t(id)];
    else
      curved[std::size_t(id - N)] = false;
    const double h = events.s[e] - (e + 1 < 2 * N ? std::max(events.s[e + 1], 0.0) : 0.0);
    double bending = moment, rho = 0;
    for (std::size_t i = 0; i < N; ++i)
      if (curved[i]) bending += std::abs(c.a[i]), rho = std::max(rho, std::abs(c.rho[i]));
    const double compliance = c.compliance[std::size_t(present - 1)], u = compliance * bending;
    steps = std::max(steps, h * std::sqrt(force * compliance + 0.25 * (u * u + w * w) + 0.5 * rho * u));
  }
  return steps < most ? int(std::ceil(steps)) : most;
}
template <int N, class Fx>
inline int first_steps(const EffectCoefficients<N, Fx>& c, const VecN<N>& beta, const TipLoad& load,
                       int most) noexcept {
  return first_steps(c.plain, beta, load, most);
}

/// Error of the tip position [m] that integration in `steps` steps a segment makes: how far the tip is from that of the
/// equilibrium in twice as many steps, found by one Newton step from the same guess. By chance the position may agree where
/// the shape does not, so the turns of the tip and of the tubes between both count too, at the length `arm` [m].
/// @param tip  of the equilibrium in `steps` steps, base frame   Real time: yes, one evaluation.
template <Loading L, class Stepper, int N, class C>
CTCR_NOINLINE double integration_error(const C& c, const Joints<N>& q, const TipLoad& load, const TipGuess<N>& guess,
                                       int steps, const Pose& tip, double arm) noexcept {
  using Ev = Evaluation<N, L, Derivatives::jacobian>;
  Ev fine;
  evaluate<Derivatives::jacobian, L, Stepper>(c, q, load, guess, 2 * steps, fine);
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

/// Steps for which the error, of fourth order, falls below the allowed one. Real time: yes.
inline int refined_steps(int steps, double error, double allowed, int most) noexcept {
  const double ratio = 1.5 * error / allowed;
  const double wanted = ratio < 1e6 ? steps * std::sqrt(std::sqrt(ratio)) : 32.0 * steps;  // not finite: 32
  return wanted < most ? std::max(int(std::ceil(wanted)), std::min(steps + 1, most)) : most;
}

}  // namespace ctcr::detail
