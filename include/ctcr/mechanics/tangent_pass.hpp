#pragma once
// Tangents of a MagnusRk4 step as a pass of their own (forward mode).
//
// Carrying values and derivatives together (steppers.hpp with dual numbers) serves any scalar type. Where the robot's
// parameters are plain numbers, the values go first and each stage records what its tangents need; the tangent pass then
// keeps four columns at a time in registers, for less than half of the instructions. A test holds both equal.
#include <utility>

#include "ctcr/mechanics/steppers.hpp"

namespace ctcr {

/// A frame that records the exponential that moved it last.
template <TangentOf Of>
struct RecordedFrame {
  Frame<double>& frame;
  Exponential& step;
};

/// Moves the frame and keeps what the tangents need. Real time: yes.
template <TangentOf Of>
CTCR_INLINE void move_by_exponential(RecordedFrame<Of>& g, const double (&o)[3], double vx, double vy, double vz) noexcept {
  exponential<Of>(o, {vx, vy, vz}, g.step);
  move(g.frame, g.step);
}

/// Values of one stage that its tangents need.
template <bool Loaded, bool Gravity, int NC>
struct Stage {
  std::array<double, NC> sin, cos, w, F;
  std::array<double, 2> u, m;
  std::array<double, 3> n, g, dn, dg;  ///< force and gravity, their rates

  CTCR_INLINE void keep(const RodState<double, NC>& y, const RodRates<double, NC>& k) noexcept {
    sin = k.sin, cos = k.cos, w = y.w, u = k.u;
    if constexpr (Loaded || NC > 1) F = k.F;
    if constexpr (Loaded) m = k.m, n = y.n, dn = k.n;
    if constexpr (Gravity) g = y.g, dg = k.g;
  }
};

/// Tangents of a RodState along one group of four columns.
template <int NC>
struct GroupState {
  std::array<Lanes, NC> psi, w;
  std::array<Lanes, 2> m;
  std::array<Lanes, 3> n, g;
};

/// The tangents of one step, for one group of four columns.
/// @tparam Dk  whether the step length has derivatives in this group
template <bool Loaded, bool Gravity, bool Dk, int NC>
class TangentPass {
public:
  using Section = RodSection<double, double, NC>;
  using StageValues = Stage<Loaded, Gravity, NC>;
  using Group = GroupState<NC>;
  using Curvature = std::array<Lanes, 2>;

  /// @param straight_mz  tangent of the straight tubes' torsional moment
  /// @param u  out: tangents of the curvature at the start, 4 x the middle, the end
  static CTCR_INLINE void loaded(const Section& r, const StageValues (&s)[4], double k, Lanes dk, Lanes straight_mz, Group& y,
                           Curvature (&u)[3]) noexcept {
    Group k1, sum = y;
    const double k6 = k / 6.0;
    const auto u1 = rates(r, s[0], straight_mz, y, k1);
    add(sum, k6, y.w, k1);
    Group z = at(y, 0.5 * k, 0.5 * dk, y.w, k1, s[0]);
    const auto u2 = rates(r, s[1], straight_mz, z, k1);
    add(sum, 2.0 * k6, z.w, k1);
    z = at(y, 0.5 * k, 0.5 * dk, z.w, k1, s[1]);
    const auto u3 = rates(r, s[2], straight_mz, z, k1);
    add(sum, 2.0 * k6, z.w, k1);
    z = at(y, k, dk, z.w, k1, s[2]);
    const auto u4 = rates(r, s[3], straight_mz, z, k1);
    add(sum, k6, z.w, k1);
    if constexpr (Dk) {
      const Lanes sixth = dk * (1.0 / 6.0);
      const auto mean = [&](auto member) { return member(s[0]) + 2.0 * (member(s[1]) + member(s[2])) + member(s[3]); };
      for (std::size_t i = 0; i < NC; ++i) {
        sum.psi[i] += sixth * mean([i](const StageValues& q) { return q.w[i]; });
        sum.w[i] += sixth * mean([i](const StageValues& q) { return q.F[i]; });
      }
      for (std::size_t i = 0; i < 2; ++i) sum.m[i] += sixth * mean([i](const StageValues& q) { return q.m[i]; });
      for (std::size_t i = 0; i < 3; ++i) sum.n[i] += sixth * mean([i](const StageValues& q) { return q.dn[i]; });
      if constexpr (Gravity)
        for (std::size_t i = 0; i < 3; ++i) sum.g[i] += sixth * mean([i](const StageValues& q) { return q.dg[i]; });
    }
    y = sum;
    for (std::size_t i = 0; i < 2; ++i) {
      u[0][i] = u1[i];
      u[1][i] = 2.0 * (u2[i] + u3[i]);
      u[2][i] = u4[i];
    }
  }

  static CTCR_INLINE void unloaded(const Section& r, const StageValues (&s)[3], double k, Lanes dk, Group& y,
                             Curvature (&u)[3]) noexcept {
    std::array<Lanes, NC> f1, f2, f3, psi;
    u[0] = torsion(r, s[0], y.psi, f1);
    const auto linear = [&](std::size_t i, double part) {
      Lanes p = y.psi[i] + (part * k) * y.w[i];
      if constexpr (Dk) p = p + (part * s[0].w[i]) * dk;
      return p;
    };
    if constexpr (NC == 1) {
      psi[0] = linear(0, 0.5);
      u[1] = torsion(r, s[1], psi, f2);
      y.psi[0] = linear(0, 1.0);
      u[2] = torsion(r, s[2], y.psi, f3);
    } else {
      const double kk = k * k;
      for (std::size_t i = 0; i < NC; ++i) {
        psi[i] = linear(i, 0.5) + (0.125 * kk) * f1[i];
        if constexpr (Dk) psi[i] = psi[i] + (0.25 * k * s[0].F[i]) * dk;
      }
      u[1] = torsion(r, s[1], psi, f2);
      for (std::size_t i = 0; i < NC; ++i) {
        psi[i] = linear(i, 1.0) + (0.5 * kk) * f2[i];
        if constexpr (Dk) psi[i] = psi[i] + (k * s[1].F[i]) * dk;
      }
      u[2] = torsion(r, s[2], psi, f3);
      for (std::size_t i = 0; i < NC; ++i) {
        const double F1 = s[0].F[i], F2 = s[1].F[i], F3 = s[2].F[i];
        psi[i] = linear(i, 1.0) + (kk / 6.0) * (f1[i] + 2.0 * f2[i]);
        y.w[i] = y.w[i] + (k / 6.0) * (f1[i] + 4.0 * f2[i] + f3[i]);
        if constexpr (Dk) {
          psi[i] = psi[i] + (k / 3.0 * (F1 + 2.0 * F2)) * dk;
          y.w[i] = y.w[i] + ((F1 + 4.0 * F2 + F3) / 6.0) * dk;
        }
        y.psi[i] = psi[i];
      }
    }
    for (auto& d : u[1]) d = 4.0 * d;
  }

  /// Moves the body twist of the group by the tangent of the frame step.
  template <TangentOf Of>
  static CTCR_INLINE void frame(const Exponential& x, const std::array<double, 2>& u0, const std::array<double, 2>& u_mid,
                          const std::array<double, 2>& u1, double k, Lanes dk, const Curvature (&u)[3], Lanes* rotation,
                          Lanes* translation, std::size_t stride) noexcept {
    const double k6 = k / 6.0, kk12 = k * k / 12.0;
    Lanes o[3], v[3] = {Lanes{}, Lanes{}, Lanes{}};
    for (std::size_t i = 0; i < 2; ++i) o[i] = k6 * (u[0][i] + u[1][i] + u[2][i]);
    o[2] = (kk12 * u0[0]) * u[2][1] + (kk12 * u1[1]) * u[0][0] - (kk12 * u0[1]) * u[2][0] - (kk12 * u1[0]) * u[0][1];
    if constexpr (Of == TangentOf::frame) {
      v[0] = kk12 * (u[0][1] - u[2][1]);
      v[1] = kk12 * (u[2][0] - u[0][0]);
    }
    if constexpr (Dk) {
      const double k_6 = k / 6.0;
      for (std::size_t i = 0; i < 2; ++i) o[i] = o[i] + ((u0[i] + 4.0 * u_mid[i] + u1[i]) / 6.0) * dk;
      o[2] = o[2] + (k_6 * (u0[0] * u1[1] - u0[1] * u1[0])) * dk;
      v[0] = v[0] + (k_6 * (u0[1] - u1[1])) * dk;
      v[1] = v[1] + (k_6 * (u1[0] - u0[0])) * dk;
      v[2] = dk;
    }
    move_twist<Of>(rotation[0], rotation[stride], rotation[2 * stride], translation[0], translation[stride],
                   translation[2 * stride], x, o, v);
  }

private:
  static CTCR_INLINE void add(Group& sum, double h, const std::array<Lanes, NC>& w, const Group& f) noexcept {
    for (std::size_t i = 0; i < NC; ++i) {
      sum.psi[i] += h * w[i];
      sum.w[i] += h * f.w[i];
    }
    for (std::size_t i = 0; i < 2; ++i) sum.m[i] += h * f.m[i];
    for (std::size_t i = 0; i < 3; ++i) sum.n[i] += h * f.n[i];
    if constexpr (Gravity)
      for (std::size_t i = 0; i < 3; ++i) sum.g[i] += h * f.g[i];
  }

  /// State at a later stage; `f` holds the rates, those of w under the name w.
  static CTCR_INLINE Group at(const Group& y, double h, Lanes dh, const std::array<Lanes, NC>& w, const Group& f,
                        const StageValues& s) noexcept {
    Group z;
    const auto add = [&](Lanes a, Lanes rate, double value) {
      Lanes r = a + h * rate;
      if constexpr (Dk) r = r + value * dh;
      return r;
    };
    for (std::size_t i = 0; i < NC; ++i) {
      z.psi[i] = add(y.psi[i], w[i], s.w[i]);
      z.w[i] = add(y.w[i], f.w[i], s.F[i]);
    }
    for (std::size_t i = 0; i < 2; ++i) z.m[i] = add(y.m[i], f.m[i], s.m[i]);
    for (std::size_t i = 0; i < 3; ++i) z.n[i] = add(y.n[i], f.n[i], s.dn[i]);
    if constexpr (Gravity)
      for (std::size_t i = 0; i < 3; ++i) z.g[i] = add(y.g[i], f.g[i], s.dg[i]);
    return z;
  }

  static CTCR_INLINE void torque(const Section& r, const StageValues& s, const std::array<Lanes, NC>& psi, Lanes ux, Lanes uy,
                           std::array<Lanes, NC>& f) noexcept {
    for (std::size_t i = 0; i < NC; ++i) {
      const double S = r.rho[i] * s.sin[i], C = r.rho[i] * s.cos[i];
      f[i] = (C * s.u[0] + S * s.u[1]) * psi[i] + S * ux - C * uy;
    }
  }

  /// Curvature and w' of an unloaded rod.
  static CTCR_INLINE Curvature torsion(const Section& r, const StageValues& s, const std::array<Lanes, NC>& psi,
                                 std::array<Lanes, NC>& f) noexcept {
    Curvature u;
    for (std::size_t i = 0; i < NC; ++i) {
      const double a = r.a[i] * r.compliance;
      const Lanes x = (a * s.sin[i]) * psi[i], y = (a * s.cos[i]) * psi[i];
      u[0] = i == 0 ? -x : u[0] - x;
      u[1] = i == 0 ? y : u[1] + y;
    }
    if constexpr (NC > 1) torque(r, s, psi, u[0], u[1], f);
    return u;
  }

  /// Rates of a loaded rod; those of w go to k.w.
  static CTCR_INLINE Curvature rates(const Section& r, const StageValues& s, Lanes mz, const Group& y, Group& k) noexcept {
    Lanes ux = y.m[0] * r.compliance, uy = y.m[1] * r.compliance;
    double value_mz = r.straight_mz;
    for (std::size_t i = 0; i < NC; ++i) {
      const double a = r.a[i] * r.compliance;
      ux = ux - (a * s.sin[i]) * y.psi[i];
      uy = uy + (a * s.cos[i]) * y.psi[i];
      mz = mz + r.kz[i] * y.w[i];
      value_mz += r.kz[i] * s.w[i];
    }
    torque(r, s, y.psi, ux, uy, k.w);
    const double vx = s.u[0], vy = s.u[1];
    k.m[0] = y.n[1] - vy * mz - value_mz * uy;
    k.m[1] = vx * mz + value_mz * ux - y.n[0];
    cross(k.n, vx, vy, y.n, ux, uy, s.n);
    if constexpr (Gravity) {
      cross(k.g, vx, vy, y.g, ux, uy, s.g);
      for (std::size_t i = 0; i < 3; ++i) k.n[i] = k.n[i] - r.weight * y.g[i];
    }
    return {ux, uy};
  }

  /// Tangent of -u x v.
  static CTCR_INLINE void cross(std::array<Lanes, 3>& k, double ux, double uy, const std::array<Lanes, 3>& dv, Lanes dux,
                          Lanes duy, const std::array<double, 3>& v) noexcept {
    k[0] = -(uy * dv[2]) - v[2] * duy;
    k[1] = ux * dv[2] + v[2] * dux;
    k[2] = uy * dv[0] - ux * dv[1] + v[0] * duy - v[1] * dux;
  }
};

}  // namespace ctcr
