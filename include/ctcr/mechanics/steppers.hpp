#pragma once
// One integration step along a segment, from the tip side to the base side.
#include "ctcr/math/se3.hpp"
#include "ctcr/mechanics/rod.hpp"

namespace ctcr {

/// Observer of stages that does nothing.
struct NoTape {
  template <class... A>
  CTCR_INLINE void operator()(const A&...) const noexcept {}
};

/// Moves the frame by the fourth-order Magnus exponential of the curvatures met at the start, the middle and the end.
/// @param k  step [m], negative towards the base
template <class F, class S, class H>
CTCR_INLINE void move_frame(F& frame, const std::array<S, 2>& u0, const std::array<S, 2>& u_mid,
                            const std::array<S, 2>& u1, const H& k) noexcept {
  const auto k6 = (1.0 / 6.0) * k;
  const auto kk12 = (1.0 / 12.0) * (k * k);
  const S omega[3] = {k6 * (u0[0] + 4.0 * u_mid[0] + u1[0]), k6 * (u0[1] + 4.0 * u_mid[1] + u1[1]),
                      kk12 * (u0[0] * u1[1] - u0[1] * u1[0])};
  move_by_exponential(frame, omega, S(kk12 * (u0[1] - u1[1])), S(kk12 * (u1[0] - u0[0])), k);
}

/// The default scheme. Loaded: classical RK4 for torsion and internal wrench, frame by the Magnus exponential of its
/// stage curvatures (fourth order, arc length and orthogonality exact). Ref: Hairer, Lubich & Wanner, Geometric
/// Numerical Integration, IV.7-8.
struct MagnusRk4 {
  static constexpr bool replayed = true;  ///< tangents by replay.hpp where the parameters are plain numbers

  /// @param tape  called as tape(stage, state, rates) for each of the four stages
  template <bool Gravity, class S, class P, int NC, class F, class H, class Tape = NoTape>
  static CTCR_INLINE void loaded(const RodSection<S, P, NC>& r, RodState<S, NC>& y, F& frame, const H& k,
                                 const Tape& tape = {}) noexcept {
    using Rates = RodRates<S, NC>;
    const auto half = 0.5 * k;
    const auto stage = [&](const auto& h, const std::array<S, NC>& w, const Rates& q) {
      RodState<S, NC> z;
      for (int j = 0; j < NC; ++j) {
        const auto i = std::size_t(j);
        z.psi[i] = y.psi[i] + h * w[i];
        z.w[i] = y.w[i] + h * q.F[i];
      }
      for (std::size_t i = 0; i < 2; ++i) z.m[i] = y.m[i] + h * q.m[i];
      for (std::size_t i = 0; i < 3; ++i) z.n[i] = y.n[i] + h * q.n[i];
      if constexpr (Gravity)
        for (std::size_t i = 0; i < 3; ++i) z.g[i] = y.g[i] + h * q.g[i];
      return z;
    };
    const Rates k1 = loaded_rates<Gravity>(r, y);
    tape(0, y, k1);
    const auto y2 = stage(half, y.w, k1);
    const Rates k2 = loaded_rates<Gravity>(r, y2);
    tape(1, y2, k2);
    const auto y3 = stage(half, y2.w, k2);
    const Rates k3 = loaded_rates<Gravity>(r, y3);
    tape(2, y3, k3);
    const auto y4 = stage(k, y3.w, k3);
    const Rates k4 = loaded_rates<Gravity>(r, y4);
    tape(3, y4, k4);
    const auto sixth = (1.0 / 6.0) * k;
    const auto mean = [&](const S& a, const S& b, const S& c, const S& d) { return S(sixth * (a + 2.0 * (b + c) + d)); };
    for (std::size_t i = 0; i < NC; ++i) {
      y.psi[i] = y.psi[i] + mean(y.w[i], y2.w[i], y3.w[i], y4.w[i]);
      y.w[i] = y.w[i] + mean(k1.F[i], k2.F[i], k3.F[i], k4.F[i]);
    }
    for (std::size_t i = 0; i < 2; ++i) y.m[i] = y.m[i] + mean(k1.m[i], k2.m[i], k3.m[i], k4.m[i]);
    for (std::size_t i = 0; i < 3; ++i) y.n[i] = y.n[i] + mean(k1.n[i], k2.n[i], k3.n[i], k4.n[i]);
    if constexpr (Gravity)
      for (std::size_t i = 0; i < 3; ++i) y.g[i] = y.g[i] + mean(k1.g[i], k2.g[i], k3.g[i], k4.g[i]);
    const std::array<S, 2> u_mid{0.5 * (k2.u[0] + k3.u[0]), 0.5 * (k2.u[1] + k3.u[1])};
    move_frame(frame, k1.u, u_mid, k4.u, k);
  }

  /// Unloaded: torsion is a second-order equation of its own (Nystrom RKN4, three evaluations), and w is constant
  /// where one tube alone is curved.
  template <class S, class P, int NC, class F, class H, class Tape = NoTape>
  static CTCR_INLINE void unloaded(const RodSection<S, P, NC>& r, RodState<S, NC>& y, F& frame, const H& k,
                                   const Tape& tape = {}) noexcept {
    using Rates = RodRates<S, NC>;
    const auto half = 0.5 * k;
    Rates k1, k2, k3;
    curvature<false>(r, y.psi, y.m, k1);
    tape(0, y, k1);
    if constexpr (NC == 1) {
      S s, c;
      sincos(half * y.w[0], s, c);
      const auto size = r.a[0] * r.compliance;
      const auto turned = [&](const Rates& a, Rates& b) {
        b.sin[0] = a.sin[0] * c + a.cos[0] * s;
        b.cos[0] = a.cos[0] * c - a.sin[0] * s;
        b.u = {size * b.cos[0], size * b.sin[0]};
      };
      turned(k1, k2);
      turned(k2, k3);
      y.psi[0] = y.psi[0] + k * y.w[0];
    } else {
      std::array<S, NC> psi;
      const auto kk = k * k;
      const auto kk8 = 0.125 * kk, kk2 = 0.5 * kk, kk6 = (1.0 / 6.0) * kk, k6 = (1.0 / 6.0) * k;
      for (std::size_t i = 0; i < NC; ++i) psi[i] = y.psi[i] + half * y.w[i] + kk8 * k1.F[i];
      curvature<false>(r, psi, y.m, k2);
      for (std::size_t i = 0; i < NC; ++i) psi[i] = y.psi[i] + k * y.w[i] + kk2 * k2.F[i];
      curvature<false>(r, psi, y.m, k3);
      for (std::size_t i = 0; i < NC; ++i) {
        y.psi[i] = y.psi[i] + k * y.w[i] + kk6 * (k1.F[i] + 2.0 * k2.F[i]);
        y.w[i] = y.w[i] + k6 * (k1.F[i] + 4.0 * k2.F[i] + k3.F[i]);
      }
    }
    tape(1, y, k2);
    tape(2, y, k3);
    move_frame(frame, k1.u, k2.u, k3.u, k);
  }
};

/// MagnusRk4 with values and tangents always carried together: the reference that replay.hpp must equal.
struct DirectMagnusRk4 : MagnusRk4 {
  static constexpr bool replayed = false;
};

}  // namespace ctcr
