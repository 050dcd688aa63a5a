#pragma once
// How many integration steps each segment takes.
#include <algorithm>
#include <array>
#include <cmath>

#include "ctcr/mechanics/events.hpp"
#include "ctcr/robot/tip_load.hpp"

namespace ctcr {

/// Integration steps of the segments: a share of each, as robot, joints and load ask for, times one factor for all.
template <int N>
struct Steps {
  int times = 1;
  std::array<int, 2 * N> share;  ///< of the segment that begins, on its tip side, at event `id` of Events<N>

  /// As many steps in every segment, at least one.
  constexpr Steps(int in_each = 1) noexcept : times(std::max(in_each, 1)) { share.fill(1); }

  [[nodiscard]] constexpr int after(int event) const noexcept { return times * share[std::size_t(event)]; }
  [[nodiscard]] constexpr int largest_share() const noexcept { return std::ranges::max(share); }
  [[nodiscard]] constexpr Steps doubled() const noexcept {
    Steps r = *this;
    r.times *= 2;
    return r;
  }
  [[nodiscard]] bool operator==(const Steps&) const noexcept = default;
};

namespace detail {

/// Longest step, as a part of the length over which the state of the rod changes. Classical RK4 of a loaded rod then errs
/// by 5e-6 of the length at the paper's loads; Nystrom's scheme of an unloaded one does so in longer steps.
template <bool Loaded>
inline constexpr double longest_step = Loaded ? 0.29 : 1.0;

/// Steps of each segment, so that none is longer than a part of the length over which the state of the rod changes,
/// 1 / sqrt(F / EI + u^2 / 4 + w^2 / 4 + rho u / 2). Its terms are the wave number of a loaded rod, half the turn of its
/// frame, half the twist of a tube by the moment at its tip, and the growth of relative torsion, with bounds on curvature u
/// and force F in the segment. Neither angles nor unknowns enter, so the same joints and load give the same steps, and the
/// residual is a smooth function of the unknowns.
/// @param times  of all segments   @param most  in a segment, for times = 1   Real time: yes.
template <bool Loaded, int N>
inline Steps<N> steps_for(const Coefficients<N>& c, const VecN<N>& beta, const TipLoad& load, int times,
                          int most) noexcept {
  Steps<N> steps(times);
  const Events<N> events = sort_events(c, beta);
  double moment = 0, w = 0, force = 0;
  if constexpr (Loaded) {
    moment = load.moment.norm();
    w = moment / c.kz[0];
    force = load.force.norm() + c.gravity.norm() * c.weight[N - 1] * std::max(events.s[0], 0.0);
  }
  constexpr double parts = 1 / (longest_step<Loaded> * longest_step<Loaded>);
  double bending = moment, rho = 0;
  std::size_t last = 0;
  for (std::size_t e = 0; e < 2 * N && events.s[e] > 0; ++e) {
    const int id = events.id[e];
    const auto tube = std::size_t(id < N ? id : id - N);
    const double sign = id >= N ? -1.0 : c.curved[tube] ? 1.0 : 0.0;  // only curved tubes begin to curve
    if (id < N) last = tube;
    bending += sign * std::abs(c.a[tube]);
    rho += sign * std::abs(c.rho[tube]);
    const double h = events.s[e] - (e + 1 < 2 * N ? std::max(events.s[e + 1], 0.0) : 0.0),
                 u = c.compliance[last] * bending;
    const double square = parts * h * h * (force * c.compliance[last] + 0.25 * (u * u + w * w) + 0.5 * rho * u);
    if (square > 1)
      steps.share[std::size_t(id)] = square < double(most) * most ? int(std::ceil(std::sqrt(square))) : most;
  }
  return steps;
}

}  // namespace detail
}  // namespace ctcr
