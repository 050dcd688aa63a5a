#pragma once
// Inputs of the rod with effects, and the state that is integrated along it.
#include <array>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/mechanics/coefficients.hpp"

namespace ctcr {

/// Everything that the equilibrium depends on.
template <int N, class S, class Fx>
struct RodInputs {
  std::array<TubeParameters<S>, N> tubes;
  std::array<S, N> beta, alpha;             ///< [m], [rad]
  std::array<S, 3> force, moment, gravity;  ///< base frame [N], [N m], [m/s^2]
  typename Fx::OnRod::template On<N, S> effects;
};

/// State along the rod; vectors in the Bishop frame.
template <int N, class S>
struct EffectState {
  static constexpr int size = 2 * N + 8;
  std::array<S, std::size_t(size)> y;
  S& psi(int i) noexcept { return y[std::size_t(i)]; }            ///< angle of a tube [rad]
  S& torque(int i) noexcept { return y[std::size_t(N + i)]; }     ///< its torsional moment [N m]
  S& m(int i) noexcept { return y[std::size_t(2 * N + i)]; }      ///< bending moment of all tubes [N m]
  S& n(int i) noexcept { return y[std::size_t(2 * N + 2 + i)]; }  ///< force [N]
  S& g(int i) noexcept { return y[std::size_t(2 * N + 5 + i)]; }  ///< gravity [m/s^2]
  const S& psi(int i) const noexcept { return y[std::size_t(i)]; }
  const S& torque(int i) const noexcept { return y[std::size_t(N + i)]; }
  const S& m(int i) const noexcept { return y[std::size_t(2 * N + i)]; }
  const S& n(int i) const noexcept { return y[std::size_t(2 * N + 2 + i)]; }
  const S& g(int i) const noexcept { return y[std::size_t(2 * N + 5 + i)]; }
};

}  // namespace ctcr
