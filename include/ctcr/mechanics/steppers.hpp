#pragma once
// One integration step along a segment, from the tip side to the base side. Real time: yes, all of it.
#include "ctcr/math/se3.hpp"
#include "ctcr/mechanics/rod.hpp"

namespace ctcr {

/// Records nothing of the stages of a step.
struct NoStageRecord {
  template <class... A>
  CTCR_INLINE void operator()(const A&...) const noexcept {}
};

/// Moves the frame by the fourth-order Magnus exponential of the curvatures at the start, the middle and the end of a step.
/// @param u0, u_mid, u1  about the x and y axes of the Bishop frame [1/m]   @param k  step [m], negative towards the base
template <class F, class S, class H>
CTCR_INLINE void move_frame(F& frame, const std::array<S, 2>& u0, const std::array<S, 2>& u_mid, const std::array<S, 2>& u1,
                       const H& k) noexcept {
  const auto k6 = (1.0 / 6.0) * k;
  const auto kk12 = (1.0 / 12.0) * (k * k);
  const S omega[3] = {k6 * (u0[0] + 4.0 * u_mid[0] + u1[0]), k6 * (u0[1] + 4.0 * u_mid[1] + u1[1]),
                      kk12 * (u0[0] * u1[1] - u0[1] * u1[0])};
  move_by_exponential(frame, omega, S(kk12 * (u0[1] - u1[1])), S(kk12 * (u1[0] - u0[0])), k);
}

/// Sines and cosines of the angles of two stages at once.
template <class S, int NC>
CTCR_INLINE void sincos_of_two(const std::array<S, std::size_t(NC)>& a, const std::array<S, std::size_t(NC)>& b,
                          RodRates<S, NC>& at_a, RodRates<S, NC>& at_b) noexcept {
  if constexpr (std::is_same_v<S, double>) {
    for (std::size_t i = 0; i < NC; ++i) {
      const Lanes r = sincos_pair(a[i], b[i]);
      at_a.sin[i] = r[0], at_a.cos[i] = r[1], at_b.sin[i] = r[2], at_b.cos[i] = r[3];
    }
  } else {
    sincos(a, at_a.sin, at_a.cos);
    sincos(b, at_b.sin, at_b.cos);
  }
}

/// The default scheme. Loaded: classical RK4 for torsion and internal wrench, frame by the Magnus exponential of its
/// stage curvatures (fourth order, arc length and orthogonality exact). Ref: Hairer, Lubich & Wanner, Geometric
/// Numerical Integration, IV.7-8.
struct MagnusRk4 {
  static constexpr bool has_tangent_pass =
      true;  ///< tangents by tangent_pass.hpp where the parameters are plain numbers

  /// @param record  called as record(stage, state, rates) for each of the four stages
  template <bool Gravity, class S, class P, int NC, class F, class H, class Record = NoStageRecord>
  static CTCR_INLINE void loaded(const RodSection<S, P, NC>& r, RodState<S, NC>& y, F& frame, const H& k,
                           const Record& record = {}) noexcept {
    using Rates = RodRates<S, NC>;
    const auto half = 0.5 * k;
    const auto along = [](const auto& from, const auto& h, const auto& rate) {
      auto to = from;
      for (std::size_t i = 0; i < to.size(); ++i) to[i] = from[i] + h * rate[i];
      return to;
    };
    RodState<S, NC> y2, y3, y4;
    Rates k1, k2, k3, k4;
    const auto wrench = [&](const auto& h, const Rates& q, RodState<S, NC>& z) {
      z.m = along(y.m, h, q.m);
      z.n = along(y.n, h, q.n);
      if constexpr (Gravity) z.g = along(y.g, h, q.g);
    };
    // An angle depends on the rates of two stages before: two stages share their sines.
    y2.psi = along(y.psi, half, y.w);
    sincos_of_two(y.psi, y2.psi, k1, k2);
    loaded_rates<Gravity>(r, y, k1);
    record(0, y, k1);
    y2.w = along(y.w, half, k1.F);
    wrench(half, k1, y2);
    loaded_rates<Gravity>(r, y2, k2);
    record(1, y2, k2);
    y3.w = along(y.w, half, k2.F);
    y3.psi = along(y.psi, half, y2.w);
    y4.psi = along(y.psi, k, y3.w);
    sincos_of_two(y3.psi, y4.psi, k3, k4);
    wrench(half, k2, y3);
    loaded_rates<Gravity>(r, y3, k3);
    record(2, y3, k3);
    y4.w = along(y.w, k, k3.F);
    wrench(k, k3, y4);
    loaded_rates<Gravity>(r, y4, k4);
    record(3, y4, k4);
    const auto sixth = (1.0 / 6.0) * k;
    const auto mean = [&](const S& a, const S& b, const S& c, const S& d) {
      return S(sixth * (a + 2.0 * (b + c) + d));
    };
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
  template <class S, class P, int NC, class F, class H, class Record = NoStageRecord>
  static CTCR_INLINE void unloaded(const RodSection<S, P, NC>& r, RodState<S, NC>& y, F& frame, const H& k,
                             const Record& record = {}) noexcept {
    using Rates = RodRates<S, NC>;
    const auto half = 0.5 * k;
    Rates k1, k2, k3, turn;
    if constexpr (NC == 1)
      sincos_of_two(y.psi, std::array<S, 1>{half * y.w[0]}, k1, turn);
    else
      sincos(y.psi, k1.sin, k1.cos);
    curvature<false>(r, y.m, k1);
    record(0, y, k1);
    if constexpr (NC == 1) {
      const auto turned = [&](const Rates& a, Rates& b) {
        b.sin[0] = a.sin[0] * turn.cos[0] + a.cos[0] * turn.sin[0];
        b.cos[0] = a.cos[0] * turn.cos[0] - a.sin[0] * turn.sin[0];
        curvature<false>(r, y.m, b);
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
    record(1, y, k2);
    record(2, y, k3);
    move_frame(frame, k1.u, k2.u, k3.u, k);
  }
};

/// MagnusRk4 with values and tangents always carried together: the reference that tangent_pass.hpp must equal.
struct DirectMagnusRk4 : MagnusRk4 {
  static constexpr bool has_tangent_pass = false;
};

}  // namespace ctcr
