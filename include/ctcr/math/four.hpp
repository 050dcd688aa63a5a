#pragma once
// A scalar that is four numbers at once, one for each of four cases, and frames of it: a function written for a scalar
// computes four cases for little more than one.
#include "ctcr/math/se3.hpp"

namespace ctcr {

struct Four {
  Lanes v;

  Four() = default;
  CTCR_INLINE Four(double x) noexcept : v{x, x, x, x} {}  // NOLINT: a constant is the same in all cases
  CTCR_INLINE explicit Four(const Lanes& x) noexcept : v(x) {}
  [[nodiscard]] CTCR_INLINE double operator[](int i) const noexcept { return v[std::size_t(i)]; }

  friend CTCR_INLINE Four operator+(const Four& a, const Four& b) noexcept { return Four(a.v + b.v); }
  friend CTCR_INLINE Four operator-(const Four& a, const Four& b) noexcept { return Four(a.v - b.v); }
  friend CTCR_INLINE Four operator*(const Four& a, const Four& b) noexcept { return Four(a.v * b.v); }
  friend CTCR_INLINE Four operator-(const Four& a) noexcept { return Four(-a.v); }
  CTCR_INLINE Four& operator+=(const Four& b) noexcept { return *this = *this + b; }
};

/// The number of case i by number(i). Real time: yes.
template <class Number>
CTCR_INLINE Four four(const Number& number) noexcept {
  return Four(Lanes{number(0), number(1), number(2), number(3)});
}

/// The number of the first case. Decide by it only where all four cases agree.
CTCR_INLINE double value(const Four& x) noexcept {
  return x[0];
}
CTCR_INLINE Four inverse(const Four& x) noexcept {
  return four([&](int i) { return 1.0 / x[i]; });
}
CTCR_INLINE void sincos(const Four& x, Four& s, Four& c) noexcept { sincos(x.v, s.v, c.v); }
template <std::size_t M>
CTCR_INLINE void sincos(const std::array<Four, M>& x, std::array<Four, M>& s, std::array<Four, M>& c) noexcept {
  for (std::size_t i = 0; i < M; ++i) sincos(x[i], s[i], c[i]);
}

using Four3 = std::array<Four, 3>;

CTCR_INLINE Four dot(const Four3& a, const Four3& b) noexcept { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
CTCR_INLINE Four3 cross(const Four3& a, const Four3& b) noexcept {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <>
struct Frame<Four> {
  Four3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};  ///< columns of R
  Four3 p{0, 0, 0};                          ///< [m]
};

/// B and C of exp_coefficients(), in all cases.
CTCR_INLINE void exp_coefficients(const Four& z, Four& B, Four& C) noexcept {
  if (z[0] > 1 || z[1] > 1 || z[2] > 1 || z[3] > 1) [[unlikely]] {
    B = four([&](int i) { return exp_coefficients(z[i]).B; });
    C = four([&](int i) { return exp_coefficients(z[i]).C; });
    return;
  }
  B = exp_series[6][0], C = exp_series[6][1];
  for (int k = 5; k >= 0; --k) {
    B = B * z + exp_series[k][0];
    C = C * z + exp_series[k][1];
  }
}

/// g <- g exp(Omega, (vx, vy, vz)). Real time: yes.
CTCR_INLINE void move_by_exponential(Frame<Four>& g, const Four (&omega)[3], const Four& vx, const Four& vy,
                                const Four& vz) noexcept {
  const Four3 o{omega[0], omega[1], omega[2]}, v{vx, vy, vz}, across = cross(o, v);
  const Four z = dot(o, o);
  Four B, C;
  exp_coefficients(z, B, C);
  const Four A = 1.0 - z * C, D = 1.0 - z * B, along = C * dot(o, v);
  Four E[3][3], p[3];
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    const Four product = B * o[j] * o[k], sine = A * o[i];
    p[i] = A * v[i] + B * across[i] + along * o[i];
    E[i][i] = D + B * o[i] * o[i];
    E[k][j] = product + sine;
    E[j][k] = product - sine;
  }
  const Frame<Four> f = g;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto column = [&](const Four& a, const Four& b, const Four& c) {
      return f.x[i] * a + f.y[i] * b + f.z[i] * c;
    };
    g.p[i] += column(p[0], p[1], p[2]);
    g.x[i] = column(E[0][0], E[1][0], E[2][0]);
    g.y[i] = column(E[0][1], E[1][1], E[2][1]);
    g.z[i] = column(E[0][2], E[1][2], E[2][2]);
  }
}

/// g <- g moved along its z axis. Real time: yes.
CTCR_INLINE void move_along(Frame<Four>& g, const Four& h) noexcept {
  for (std::size_t i = 0; i < 3; ++i) g.p[i] += g.z[i] * h;
}

}  // namespace ctcr
