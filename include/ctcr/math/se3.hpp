#pragma once
// Frames moved by exponentials of twists, and their exact tangents.
#include <cmath>

#include "ctcr/core/types.hpp"
#include "ctcr/math/dual.hpp"

namespace ctcr {

/// Scalar functions of z = t^2 that build exponentials, t = |Omega|:
/// B = (1 - cos t)/t^2, C = (t - sin t)/t^3 and their derivatives by z; sin t / t = 1 - z C, cos t = 1 - z B.
struct ExpCoefficients {
  double B, C, dB, dC;
};

/// Coefficients of z^k in B, C, dB, dC: (-1)^k/(2k+2)!, (-1)^k/(2k+3)! and (k+1) times those of z^(k+1).
inline constexpr double exp_series[7][4] = {
    {0.5, 0.16666666666666666, -0.041666666666666664, -0.008333333333333333},
    {-0.041666666666666664, -0.008333333333333333, 0.002777777777777778, 0.0003968253968253968},
    {0.001388888888888889, 0.0001984126984126984, -7.440476190476191e-05, -8.267195767195768e-06},
    {-2.48015873015873e-05, -2.7557319223985893e-06, 1.1022927689594355e-06, 1.0020843354176688e-07},
    {2.755731922398589e-07, 2.505210838544172e-08, -1.043837849393405e-08, -8.029521918410807e-10},
    {-2.08767569878681e-09, -1.6059043836821613e-10, 6.882447358637835e-11, 4.58829823909189e-12},
    {1.1470745597729725e-11, 7.647163731819816e-13, -3.3456341326711696e-13, -1.9680200780418645e-14}};

/// Series up to t = 1 rad (error below 1e-13), closed forms beyond. Real time: yes.
CTCR_INLINE ExpCoefficients exp_coefficients(double z) noexcept {
  if (z > 1.0) [[unlikely]] {
    const double t = std::sqrt(z), s = std::sin(t) / t, B = (1.0 - std::cos(t)) / z, C = (1.0 - s) / z;
    return {B, C, (s - 2.0 * B) / (2.0 * z), (B - 3.0 * C) / (2.0 * z)};
  }
  Lanes r{exp_series[6][0], exp_series[6][1], exp_series[6][2], exp_series[6][3]};
  for (int k = 5; k >= 0; --k)
    r = r * z + Lanes{exp_series[k][0], exp_series[k][1], exp_series[k][2], exp_series[k][3]};
  return {r[0], r[1], r[2], r[3]};
}

/// A moving frame g = (R, p) and, for S = Dual, its body twist g^-1 dg along every direction.
template <class S>
struct Frame {
  Lanes x{1, 0, 0, 0}, y{0, 1, 0, 0}, z{0, 0, 1, 0};  ///< columns of R, fourth lane unused
  Lanes p{0, 0, 0, 0};                                ///< [m]

  [[nodiscard]] Mat3 rotation() const noexcept {
    Mat3 R;
    R << x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2];
    return R;
  }
  [[nodiscard]] Vec3 position() const noexcept { return {p[0], p[1], p[2]}; }
};
template <int G>
struct Frame<Dual<G>> : Frame<double> {
  Lanes rotation_twist[3][G];     ///< [rad] per direction
  Lanes translation_twist[3][G];  ///< [m] per direction
};

/// How much of a step's tangent is wanted.
enum class TangentOf { nothing, rotation, frame };

/// exp of a twist (Omega, v) with what its tangent needs: E = exp(Omega^), p = D v,
/// D = (1 - zC) I + B Omega^ + C Omega Omega^T, T = d(D v)/dOmega.
struct Exponential {
  double E[3][3], p[3], D[3][3], T[3][3];
};

/// @param o  Omega [rad]   @param v  displacement [m]; both in body axes
/// @tparam Of  D is filled for the rotation's tangent, D and T for the frame's   Real time: yes.
template <TangentOf Of>
CTCR_INLINE void exponential(const double (&o)[3], const double (&v)[3], Exponential& x) noexcept {
  const double z = o[0] * o[0] + o[1] * o[1] + o[2] * o[2];
  const ExpCoefficients q = exp_coefficients(z);
  const double A = 1.0 - z * q.C, dot = o[0] * v[0] + o[1] * v[1] + o[2] * v[2];
  const double c[3] = {o[1] * v[2] - o[2] * v[1], o[2] * v[0] - o[0] * v[2], o[0] * v[1] - o[1] * v[0]};  // Omega x v
  const double Cd = q.C * dot;
  double Bo[3];
  for (int i = 0; i < 3; ++i) {
    Bo[i] = q.B * o[i];
    x.p[i] = A * v[i] + q.B * c[i] + Cd * o[i];
  }
  for (int i = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j) x.E[i][j] = x.E[j][i] = Bo[i] * o[j];
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    x.E[i][i] += 1.0 - z * q.B;
    x.E[k][j] += A * o[i];
    x.E[j][k] -= A * o[i];
  }
  if constexpr (Of != TangentOf::nothing) {
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) x.D[i][j] = x.D[j][i] = q.C * o[i] * o[j];
      x.D[i][i] += A;
    }
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      x.D[k][j] += Bo[i];
      x.D[j][k] -= Bo[i];
    }
  }
  if constexpr (Of == TangentOf::frame) {
    // T = C (Omega . v) I - (B v + C Omega x v)^ + (2 y - C v) Omega^T, y = B' Omega x v + C' Omega x (Omega x v)
    const double cc[3] = {o[1] * c[2] - o[2] * c[1], o[2] * c[0] - o[0] * c[2], o[0] * c[1] - o[1] * c[0]};
    for (int i = 0; i < 3; ++i) {
      const double y = 2.0 * (q.dB * c[i] + q.dC * cc[i]) - q.C * v[i];
      for (int j = 0; j < 3; ++j) x.T[i][j] = y * o[j];
      x.T[i][i] += Cd;
    }
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      const double b = q.B * v[i] + q.C * c[i];
      x.T[k][j] -= b;
      x.T[j][k] += b;
    }
  }
}

/// g <- g exp: the values.
CTCR_INLINE void move(Frame<double>& g, const Exponential& x) noexcept {
  const Lanes a = g.x, b = g.y, c = g.z;
  g.p += a * x.p[0] + b * x.p[1] + c * x.p[2];
  g.x = a * x.E[0][0] + b * x.E[1][0] + c * x.E[2][0];
  g.y = a * x.E[0][1] + b * x.E[1][1] + c * x.E[2][1];
  g.z = a * x.E[0][2] + b * x.E[1][2] + c * x.E[2][2];
}

/// g <- g moved along its z axis: the values.
template <class H>
CTCR_INLINE void move_along(Frame<double>& g, const H& h) noexcept {
  g.p += g.z * value(h);
}

/// Body twist (rotation f, translation t) of one column group after g <- g exp, exactly: rotation E^T (f + D dO),
/// translation E^T (t + f x p + T dO + D dv).
template <TangentOf Of>
CTCR_INLINE void move_twist(Lanes& f0, Lanes& f1, Lanes& f2, Lanes& t0, Lanes& t1, Lanes& t2, const Exponential& x,
                       const Lanes (&o)[3], const Lanes (&v)[3]) noexcept {
  Lanes r[3], t[3];
  const Lanes f[3] = {f0, f1, f2};
  for (int i = 0; i < 3; ++i) r[i] = f[i] + x.D[i][0] * o[0] + x.D[i][1] * o[1] + x.D[i][2] * o[2];
  if constexpr (Of == TangentOf::frame) {
    const Lanes u[3] = {t0, t1, t2};
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      t[i] = u[i] + f[j] * x.p[k] - f[k] * x.p[j] + x.T[i][0] * o[0] + x.T[i][1] * o[1] + x.T[i][2] * o[2] +
             x.D[i][0] * v[0] + x.D[i][1] * v[1] + x.D[i][2] * v[2];
    }
    t0 = x.E[0][0] * t[0] + x.E[1][0] * t[1] + x.E[2][0] * t[2];
    t1 = x.E[0][1] * t[0] + x.E[1][1] * t[1] + x.E[2][1] * t[2];
    t2 = x.E[0][2] * t[0] + x.E[1][2] * t[1] + x.E[2][2] * t[2];
  }
  f0 = x.E[0][0] * r[0] + x.E[1][0] * r[1] + x.E[2][0] * r[2];
  f1 = x.E[0][1] * r[0] + x.E[1][1] * r[1] + x.E[2][1] * r[2];
  f2 = x.E[0][2] * r[0] + x.E[1][2] * r[1] + x.E[2][2] * r[2];
}

/// g <- g exp(Omega, (vx, vy, vz)) for any scalar. Real time: yes.
template <class S, class H>
CTCR_INLINE void move_by_exponential(Frame<S>& g, const S (&o)[3], const S& vx, const S& vy, const H& vz) noexcept {
  Exponential x;
  exponential<is_dual<S> ? TangentOf::frame : TangentOf::nothing>({value(o[0]), value(o[1]), value(o[2])},
                                                                  {value(vx), value(vy), value(vz)}, x);
  move(g, x);
  if constexpr (is_dual<S>) {
    constexpr int G = groups_of<S>;
    for (int i = 0; i < G; ++i)
      move_twist<TangentOf::frame>(g.rotation_twist[0][i], g.rotation_twist[1][i], g.rotation_twist[2][i],
                                   g.translation_twist[0][i], g.translation_twist[1][i], g.translation_twist[2][i], x,
                                   {o[0].d[i], o[1].d[i], o[2].d[i]}, {vx.d[i], vy.d[i], length_tangent<G>(vz, i)});
  }
}

/// Rotation vector of R, |.| <= pi [rad]. Real time: yes.
inline Vec3 rotation_vector(const Mat3& R) noexcept {
  const Vec3 twice_sine(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
  const double s = 0.5 * twice_sine.norm(), c = 0.5 * (R.trace() - 1.0);
  if (s > 1e-6) return twice_sine * (0.5 * std::atan2(s, c) / s);
  if (c > 0) return 0.5 * twice_sine;
  // Half a turn: the axis is the largest column of R + I.
  const Mat3 M = R + Mat3::Identity();
  int k = 0;
  M.diagonal().maxCoeff(&k);
  return M.col(k).normalized() * 3.14159265358979323846;
}

/// exp of a rotation vector [rad]. Real time: yes.
inline Mat3 rotation_matrix(const Vec3& o) noexcept {
  const double z = o.squaredNorm();
  const ExpCoefficients q = exp_coefficients(z);
  Mat3 W;
  W << 0, -o.z(), o.y(), o.z(), 0, -o.x(), -o.y(), o.x(), 0;
  return Mat3::Identity() + (1.0 - z * q.C) * W + q.B * (W * W);
}

/// exp(o + d) = exp(left_jacobian(o) d) exp(o) to first order in d, for rotation vectors [rad]. Real time: yes.
inline Mat3 left_jacobian(const Vec3& o) noexcept {
  const ExpCoefficients c = exp_coefficients(o.squaredNorm());
  Mat3 W;
  W << 0, -o.z(), o.y(), o.z(), 0, -o.x(), -o.y(), o.x(), 0;
  return Mat3::Identity() + c.B * W + c.C * (W * W);
}

/// Rotation about z by `angle` [rad]. Real time: yes.
inline Mat3 rotation_z(double angle) noexcept {
  double s, c;
  sincos(angle, s, c);
  Mat3 R;
  R << c, -s, 0, s, c, 0, 0, 0, 1;
  return R;
}

}  // namespace ctcr
