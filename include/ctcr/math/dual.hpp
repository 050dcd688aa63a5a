#pragma once
// Forward-mode dual numbers: a value and its derivatives along 4*G directions, four to a Lanes.
// A function written for a scalar S computes the value alone with S = double and exact derivatives with S = Dual<G>.
#include <array>
#include <cmath>
#include <type_traits>

#include "ctcr/math/lanes.hpp"
#include "ctcr/math/sincos.hpp"

namespace ctcr {

/// Value v and derivatives d along directions 0..4G-1.
template <int G>
struct Dual {
  static_assert(G > 0);
  double v;
  Lanes d[G];

  Dual() = default;
  CTCR_INLINE Dual(double value) noexcept : v(value) {  // NOLINT: a constant is a dual with no derivative
    for (int g = 0; g < G; ++g) d[g] = Lanes{};
  }
};

/// A dual number whose derivatives vanish in the first H groups: segment lengths depend on a few columns only.
template <int G, int H>
struct TailDual {
  double v;
  Lanes d[G - H];
};

template <class S>
struct IsDual : std::false_type {};
template <int G>
struct IsDual<Dual<G>> : std::true_type {};
template <class S>
inline constexpr bool is_dual = IsDual<S>::value;

/// Groups of four directions that a dual type carries.
template <class S>
inline constexpr int groups_of = 0;
template <int G>
inline constexpr int groups_of<Dual<G>> = G;

CTCR_INLINE double value(double x) noexcept { return x; }
template <int G>
CTCR_INLINE double value(const Dual<G>& x) noexcept {
  return x.v;
}
template <int G, int H>
CTCR_INLINE double value(const TailDual<G, H>& x) noexcept {
  return x.v;
}

/// Whether a number is 0, with all of its derivatives. Real time: yes.
CTCR_INLINE bool vanishes(double x) noexcept {
  return x == 0;
}
template <int G>
CTCR_INLINE bool vanishes(const Dual<G>& x) noexcept {
  if (x.v != 0) return false;
  for (const Lanes& d : x.d)
    for (std::size_t lane = 0; lane < lane_count; ++lane)
      if (d[lane] != 0) return false;
  return true;
}

/// Derivatives of a length in group g of G, whatever type carries it.
template <int G>
CTCR_INLINE Lanes length_tangent(double, int) noexcept {
  return Lanes{};
}
template <int G>
CTCR_INLINE Lanes length_tangent(const Dual<G>& x, int g) noexcept {
  return x.d[g];
}
template <int G, int H>
CTCR_INLINE Lanes length_tangent(const TailDual<G, H>& x, int g) noexcept {
  return g < H ? Lanes{} : x.d[g - H];
}

/// Whether a length of type X has derivatives in group g.
template <class X, int g>
inline constexpr bool has_length_tangent = !std::is_same_v<X, double>;
template <int G, int H, int g>
inline constexpr bool has_length_tangent<TailDual<G, H>, g> = g >= H;

template <int G>
CTCR_INLINE Dual<G> operator+(const Dual<G>& a, const Dual<G>& b) noexcept {
  Dual<G> r;
  r.v = a.v + b.v;
  for (int g = 0; g < G; ++g) r.d[g] = a.d[g] + b.d[g];
  return r;
}
template <int G>
CTCR_INLINE Dual<G> operator-(const Dual<G>& a, const Dual<G>& b) noexcept {
  Dual<G> r;
  r.v = a.v - b.v;
  for (int g = 0; g < G; ++g) r.d[g] = a.d[g] - b.d[g];
  return r;
}
template <int G>
CTCR_INLINE Dual<G> operator-(const Dual<G>& a) noexcept {
  Dual<G> r;
  r.v = -a.v;
  for (int g = 0; g < G; ++g) r.d[g] = -a.d[g];
  return r;
}
template <int G>
CTCR_INLINE Dual<G> operator*(const Dual<G>& a, const Dual<G>& b) noexcept {
  Dual<G> r;
  r.v = a.v * b.v;
  for (int g = 0; g < G; ++g) r.d[g] = a.d[g] * b.v + b.d[g] * a.v;
  return r;
}
template <int G>
CTCR_INLINE Dual<G> operator*(const Dual<G>& a, double b) noexcept {
  Dual<G> r;
  r.v = a.v * b;
  for (int g = 0; g < G; ++g) r.d[g] = a.d[g] * b;
  return r;
}
template <int G>
CTCR_INLINE Dual<G> operator*(double a, const Dual<G>& b) noexcept {
  return b * a;
}
template <int G>
CTCR_INLINE Dual<G> operator+(const Dual<G>& a, double b) noexcept {
  Dual<G> r = a;
  r.v += b;
  return r;
}
template <int G>
CTCR_INLINE Dual<G> operator+(double a, const Dual<G>& b) noexcept {
  return b + a;
}
template <int G>
CTCR_INLINE Dual<G> operator-(const Dual<G>& a, double b) noexcept {
  return a + (-b);
}
template <int G>
CTCR_INLINE Dual<G> operator-(double a, const Dual<G>& b) noexcept {
  return -b + a;
}
template <int G>
CTCR_INLINE Dual<G>& operator+=(Dual<G>& a, const Dual<G>& b) noexcept {
  return a = a + b;
}

template <int G, int H>
CTCR_INLINE Dual<G> operator*(const TailDual<G, H>& a, const Dual<G>& b) noexcept {
  Dual<G> r;
  r.v = a.v * b.v;
  for (int g = 0; g < G; ++g) r.d[g] = b.d[g] * a.v;
  for (int g = H; g < G; ++g) r.d[g] += a.d[g - H] * b.v;
  return r;
}
template <int G, int H>
CTCR_INLINE TailDual<G, H> operator*(double a, const TailDual<G, H>& b) noexcept {
  TailDual<G, H> r;
  r.v = a * b.v;
  for (int g = 0; g < G - H; ++g) r.d[g] = a * b.d[g];
  return r;
}
template <int G, int H>
CTCR_INLINE TailDual<G, H> operator*(const TailDual<G, H>& a, const TailDual<G, H>& b) noexcept {
  TailDual<G, H> r;
  r.v = a.v * b.v;
  for (int g = 0; g < G - H; ++g) r.d[g] = a.d[g] * b.v + b.d[g] * a.v;
  return r;
}

template <int G, int H>
CTCR_INLINE TailDual<G, H> operator-(const TailDual<G, H>& a, const TailDual<G, H>& b) noexcept {
  TailDual<G, H> r;
  r.v = a.v - b.v;
  for (int g = 0; g < G - H; ++g) r.d[g] = a.d[g] - b.d[g];
  return r;
}

template <int G>
CTCR_INLINE Dual<G> inverse(const Dual<G>& a) noexcept {
  Dual<G> r;
  r.v = 1.0 / a.v;
  const double slope = -r.v * r.v;
  for (int g = 0; g < G; ++g) r.d[g] = a.d[g] * slope;
  return r;
}
CTCR_INLINE double inverse(double a) noexcept { return 1.0 / a; }

/// f(x) from its value and its slope at x. Real time: yes.
CTCR_INLINE double mapped(double, double f, double) noexcept {
  return f;
}
template <int G>
CTCR_INLINE Dual<G> mapped(const Dual<G>& x, double f, double slope) noexcept {
  Dual<G> r;
  r.v = f;
  for (int g = 0; g < G; ++g) r.d[g] = x.d[g] * slope;
  return r;
}

/// sine and cosine together. Real time: yes.
template <int G>
CTCR_INLINE void sincos(const Dual<G>& a, Dual<G>& s, Dual<G>& c) noexcept {
  sincos(a.v, s.v, c.v);
  for (int g = 0; g < G; ++g) {
    s.d[g] = a.d[g] * c.v;
    c.d[g] = a.d[g] * -s.v;
  }
}
template <int G, std::size_t M>
CTCR_INLINE void sincos(const std::array<Dual<G>, M>& a, std::array<Dual<G>, M>& s, std::array<Dual<G>, M>& c) noexcept {
  for (std::size_t i = 0; i < M; ++i) sincos(a[i], s[i], c[i]);
}

}  // namespace ctcr
