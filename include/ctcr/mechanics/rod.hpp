#pragma once
// The rod equations in the Bishop frame of the common centreline (no torsion), all tubes treated alike.
//   u_xy = (m_xy + sum a_i (cos psi_i, sin psi_i)) / sum EI_i        psi_i' = w_i
//   w_i' = rho_i (sin psi_i u_x - cos psi_i u_y)                     m' = -u x m - e3 x n   (x, y; m_z = sum kz_i w_i)
//   n' = -u x n - (mass per length) g                                g' = -u x g
// Ref: Rucker, Jones & Webster 2010, written for the sum of moments as in Boyer et al. Section III.B.
#include <array>

#include "ctcr/math/dual.hpp"

namespace ctcr {

/// State along the rod inside a segment with NC curved tubes. Vectors in the Bishop frame.
template <class S, int NC>
struct RodState {
  std::array<S, NC> psi, w;  ///< angle of each curved tube [rad] and its twist rate [rad/m]
  std::array<S, 2> m;        ///< bending moment, sum over tubes [N m]
  std::array<S, 3> n;        ///< internal force [N]
  std::array<S, 3> g;        ///< gravity [m/s^2]
};

/// Derivatives by arc length of a RodState (psi' = w is not repeated), and the curvature they come from.
template <class S, int NC>
struct RodRates {
  std::array<S, NC> sin, cos;  ///< of psi
  std::array<S, NC> F;         ///< w' [rad/m^2]
  std::array<S, 2> u;          ///< curvature of the centreline [1/m]
  std::array<S, 2> m;
  std::array<S, 3> n;
  std::array<S, 3> g;
};

/// Coefficients of a segment: the curved tubes one by one, the straight ones by their sums.
template <class S, class P, int NC>
struct RodSection {
  std::array<P, NC> a, rho, kz;
  P compliance;   ///< 1 / sum EI
  P weight;       ///< mass per length of all tubes [kg/m]
  S straight_mz;  ///< torsional moment of the straight tubes [N m], constant in the segment
};

/// Curvature and torsional rate where the angles' sines and cosines are in `k`. Real time: yes.
template <bool Loaded, class S, class P, int NC>
CTCR_INLINE void curvature(const RodSection<S, P, NC>& r, const std::array<S, 2>& m, RodRates<S, NC>& k) noexcept {
  const auto &s = k.sin, &c = k.cos;
  S ux = 0.0, uy = 0.0;
  if constexpr (Loaded) ux = m[0], uy = m[1];
  for (std::size_t i = 0; i < NC; ++i) {
    if (!Loaded && i == 0) {
      ux = r.a[i] * c[i];
      uy = r.a[i] * s[i];
    } else {
      ux = ux + r.a[i] * c[i];
      uy = uy + r.a[i] * s[i];
    }
  }
  k.u = {ux * r.compliance, uy * r.compliance};
  if constexpr (Loaded || NC > 1)
    for (std::size_t i = 0; i < NC; ++i) k.F[i] = r.rho[i] * (s[i] * k.u[0] - c[i] * k.u[1]);
}

/// Curvature and torsional rate for angles psi. Real time: yes.
template <bool Loaded, class S, class P, int NC, class Angles>
CTCR_INLINE void curvature(const RodSection<S, P, NC>& r, const Angles& psi, const std::array<S, 2>& m,
                      RodRates<S, NC>& k) noexcept {
  sincos(psi, k.sin, k.cos);
  curvature<Loaded>(r, m, k);
}

/// All rates of a loaded rod where the angles' sines and cosines are in `k`. Real time: yes.
template <bool Gravity, class S, class P, int NC>
CTCR_INLINE void loaded_rates(const RodSection<S, P, NC>& r, const RodState<S, NC>& y, RodRates<S, NC>& k) noexcept {
  curvature<true>(r, y.m, k);
  const S &ux = k.u[0], &uy = k.u[1];
  S mz = r.straight_mz;
  for (std::size_t i = 0; i < NC; ++i) mz = mz + r.kz[i] * y.w[i];
  k.m = {y.n[1] - uy * mz, ux * mz - y.n[0]};
  k.n = {-(uy * y.n[2]), ux * y.n[2], uy * y.n[0] - ux * y.n[1]};
  if constexpr (Gravity) {
    k.g = {-(uy * y.g[2]), ux * y.g[2], uy * y.g[0] - ux * y.g[1]};
    for (std::size_t i = 0; i < 3; ++i) k.n[i] = k.n[i] - r.weight * y.g[i];
  }
}

/// All rates of a loaded rod. Real time: yes.
template <bool Gravity, class S, class P, int NC>
CTCR_INLINE RodRates<S, NC> loaded_rates(const RodSection<S, P, NC>& r, const RodState<S, NC>& y) noexcept {
  RodRates<S, NC> k;
  sincos(y.psi, k.sin, k.cos);
  loaded_rates<Gravity>(r, y, k);
  return k;
}

}  // namespace ctcr
