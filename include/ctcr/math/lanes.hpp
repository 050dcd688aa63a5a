#pragma once
// Four doubles that are computed together. With GCC or Clang they are one vector (AVX2: one register, SSE2 and NEON:
// two); any other compiler gets the array below, which computes the same.
#include <cstddef>

#include "ctcr/core/arithmetic.hpp"

namespace ctcr {

inline constexpr int lane_count = 4;

#if defined(__GNUC__) && !defined(CTCR_SCALAR_LANES)
#define CTCR_VECTOR_LANES
// The kernels are fastest with everything inlined. A program that defines CTCR_FAST_COMPILE in all of its files leaves that
// choice to the compiler: half the compile time, and up to 1.4 times the instructions.
#if defined(CTCR_FAST_COMPILE)
#define CTCR_INLINE inline
#else
#define CTCR_INLINE inline __attribute__((always_inline))
#endif
#define CTCR_NOINLINE __attribute__((noinline))
#if defined(__AVX__) || !(defined(__x86_64__) || defined(__i386__))
typedef double LaneVector __attribute__((vector_size(32)));
typedef LaneVector Lanes;
CTCR_INLINE const LaneVector& lane_vector(const Lanes& x) noexcept { return x; }
#else
// Without AVX a bare vector of 32 bytes is passed in another way than with it, and compilers warn of that (-Wpsabi)
// wherever it is an argument or a result, inlined or not: here it is wrapped, and aligned to 16 bytes.
typedef double LaneVector __attribute__((vector_size(32), aligned(16)));
struct Lanes {
  LaneVector v;

  Lanes() = default;
  CTCR_INLINE constexpr Lanes(double a, double b, double c, double d) noexcept : v{a, b, c, d} {}
  CTCR_INLINE explicit constexpr Lanes(const LaneVector& x) noexcept : v(x) {}
  CTCR_INLINE double operator[](auto i) const noexcept { return v[i]; }
  CTCR_INLINE double& operator[](auto i) noexcept { return reinterpret_cast<double*>(&v)[i]; }
};
CTCR_INLINE const LaneVector& lane_vector(const Lanes& x) noexcept { return x.v; }
#define CTCR_LANE_OPERATOR(op)                                                                         \
  CTCR_INLINE Lanes operator op(const Lanes& a, const Lanes& b) noexcept { return Lanes(a.v op b.v); } \
  CTCR_INLINE Lanes operator op(double a, const Lanes& b) noexcept { return Lanes(a op b.v); }         \
  CTCR_INLINE Lanes operator op(const Lanes& a, double b) noexcept { return Lanes(a.v op b); }         \
  CTCR_INLINE Lanes& operator op##=(Lanes & a, const Lanes & b) noexcept { return a.v = a.v op b.v, a; }
CTCR_LANE_OPERATOR(+)
CTCR_LANE_OPERATOR(-)
CTCR_LANE_OPERATOR(*)
#undef CTCR_LANE_OPERATOR
CTCR_INLINE Lanes operator-(const Lanes& a) noexcept {
  return Lanes(-a.v);
}
#endif
#else
struct alignas(32) Lanes {
  double x[lane_count];
  double& operator[](auto i) { return x[i]; }
  double operator[](auto i) const { return x[i]; }
};
#define CTCR_INLINE inline
#define CTCR_NOINLINE
#define CTCR_LANE_OPERATOR(op)                                                                          \
  CTCR_INLINE Lanes operator op(const Lanes& a, const Lanes& b) noexcept {                              \
    return {{a.x[0] op b.x[0], a.x[1] op b.x[1], a.x[2] op b.x[2], a.x[3] op b.x[3]}};                  \
  }                                                                                                     \
  CTCR_INLINE Lanes operator op(double a, const Lanes& b) noexcept {                                    \
    return Lanes {                                                                                      \
      {                                                                                                 \
        a, a, a, a                                                                                      \
      }                                                                                                 \
    }                                                                                                   \
    op b;                                                                                               \
  }                                                                                                     \
  CTCR_INLINE Lanes operator op(const Lanes& a, double b) noexcept { return a op Lanes{{b, b, b, b}}; } \
  CTCR_INLINE Lanes& operator op##=(Lanes & a, const Lanes & b) noexcept { return a = a op b; }
CTCR_LANE_OPERATOR(+)
CTCR_LANE_OPERATOR(-)
CTCR_LANE_OPERATOR(*)
#undef CTCR_LANE_OPERATOR
CTCR_INLINE Lanes operator-(const Lanes& a) noexcept {
  return {{-a.x[0], -a.x[1], -a.x[2], -a.x[3]}};
}
#endif

/// 1 in lane i, 0 elsewhere. Adding x * unit_lane(i) keeps vectors in registers where writing a lane would not.
CTCR_INLINE Lanes unit_lane(int i) noexcept {
  constexpr Lanes units[lane_count] = {Lanes{1, 0, 0, 0}, Lanes{0, 1, 0, 0}, Lanes{0, 0, 1, 0}, Lanes{0, 0, 0, 1}};
  return units[i];
}

/// Number of lane groups that hold `n` values.
constexpr int lane_groups(int n) noexcept { return (n + lane_count - 1) / lane_count; }

}  // namespace ctcr
