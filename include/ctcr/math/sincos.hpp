#pragma once
// Sine and cosine of one angle in one call, or of several at once, inlined and without a branch or a table: about 1 ulp
// for |x| < 1e5. The argument is reduced by multiples of pi/2 (Cody-Waite); minimax polynomials on [-pi/4, pi/4] (the
// coefficients of the Cephes library).
#include <array>
#include <bit>
#include <cstdint>

#include "ctcr/math/lanes.hpp"

namespace ctcr {
namespace detail {

inline constexpr double quarter_turns = 0.63661977236758134308;                                  // 2 / pi
inline constexpr double quarter_turn[2] = {1.57079632673412561417, 6.07710050650619224932e-11};  // pi / 2 in two parts
inline constexpr double round_to_integer = 6755399441055744.0;  // 1.5 * 2^52: a sum with it ends in the integer

/// Of z^k in (sin r - r) / (r z) and (cos r - 1 + z/2) / z^2, where z = r^2.
inline constexpr double sincos_series[6][2] = {
    {-1.66666666666666307295e-1, 4.16666666666665929218e-2}, {8.33333333332211858878e-3, -1.38888888888730564116e-3},
    {-1.98412698295895385996e-4, 2.48015872888517045348e-5}, {2.75573136213857245213e-6, -2.75573141792967388112e-7},
    {-2.50507477628578072866e-8, 2.08757008419747316778e-9}, {1.58962301576546568060e-10, -1.13585365213876817300e-11}};

}  // namespace detail

/// s = sin x, c = cos x; x in rad. Real time: yes.
CTCR_INLINE void sincos(double x, double& s, double& c) noexcept {
  using namespace detail;
  const double t = x * quarter_turns + round_to_integer;
  const auto quadrant = std::bit_cast<std::uint64_t>(t);
  const double k = t - round_to_integer;
  const double r = (x - k * quarter_turn[0]) - k * quarter_turn[1];
  const double z = r * r;
  double ps = sincos_series[5][0], pc = sincos_series[5][1];
  for (int i = 4; i >= 0; --i) {
    ps = ps * z + sincos_series[i][0];
    pc = pc * z + sincos_series[i][1];
  }
  ps = r + r * z * ps;
  pc = 1.0 - 0.5 * z + z * z * pc;
  const bool swap = (quadrant & 1u) != 0;
  const double a = swap ? pc : ps;
  const double b = swap ? ps : pc;
  s = std::bit_cast<double>(std::bit_cast<std::uint64_t>(a) ^ ((quadrant & 2u) << 62));
  c = std::bit_cast<double>(std::bit_cast<std::uint64_t>(b) ^ (((quadrant + 1u) & 2u) << 62));
}

/// Of four angles at once. Real time: yes.
CTCR_INLINE void sincos(const Lanes& x, Lanes& s, Lanes& c) noexcept {
#if defined(CTCR_VECTOR_LANES)
  using namespace detail;
  typedef std::uint64_t Bits __attribute__((vector_size(32)));
  typedef std::int64_t Choice __attribute__((vector_size(32)));
  const Lanes t = x * quarter_turns + round_to_integer;
  const Lanes k = t - round_to_integer;
  const Lanes r = (x - k * quarter_turn[0]) - k * quarter_turn[1];
  const Lanes z = r * r;
  Lanes ps = z * sincos_series[5][0] + sincos_series[4][0], pc = z * sincos_series[5][1] + sincos_series[4][1];
  for (int i = 3; i >= 0; --i) {
    ps = ps * z + sincos_series[i][0];
    pc = pc * z + sincos_series[i][1];
  }
  ps = r + r * z * ps;
  pc = 1.0 - 0.5 * z + z * z * pc;
  // Casts of vectors keep their bits.
  const LaneVector &sine = lane_vector(ps), &cosine = lane_vector(pc);
  const Bits quadrant = (Bits)lane_vector(t);
  const Choice swap = (Choice)(quadrant << 63) < 0;
  s = Lanes((LaneVector)((Bits)(swap ? cosine : sine) ^ ((quadrant >> 1) << 63)));
  c = Lanes((LaneVector)((Bits)(swap ? sine : cosine) ^ (((quadrant + 1) >> 1) << 63)));
#else
  for (std::size_t i = 0; i < lane_count; ++i) sincos(x[i], s[i], c[i]);
#endif
}

/// {sin x, cos x, sin y, cos y} for little more than one of them. Real time: yes.
CTCR_INLINE Lanes sincos_pair(double x, double y) noexcept {
#if defined(CTCR_VECTOR_LANES)
  using namespace detail;
  typedef std::uint64_t Bits __attribute__((vector_size(32)));
  const Lanes angle{x, x, y, y};
  const Lanes t = angle * quarter_turns + round_to_integer;
  const Lanes k = t - round_to_integer;
  const Lanes r = (angle - k * quarter_turn[0]) - k * quarter_turn[1];
  const Lanes z = r * r;
  const auto series = [](int i) {
    return Lanes{sincos_series[i][0], sincos_series[i][1], sincos_series[i][0], sincos_series[i][1]};
  };
  Lanes p = series(5);
  for (int i = 4; i >= 0; --i) p = p * z + series(i);
  p = (Lanes{r[0], 1, r[2], 1} - z * Lanes{0, 0.5, 0, 0.5}) + z * Lanes{r[0], z[1], r[2], z[3]} * p;
  const Bits quadrant = (Bits)lane_vector(t), sign = ((quadrant + Bits{0, 1, 0, 1}) >> 1) << 63;
  const Lanes swapped{p[1], p[0], p[3], p[2]};
  typedef std::int64_t Choice __attribute__((vector_size(32)));
  const LaneVector &other = lane_vector(swapped), &own = lane_vector(p);
  return Lanes((LaneVector)((Bits)((Choice)(quadrant << 63) < 0 ? other : own) ^ sign));
#else
  Lanes r;
  sincos(x, r[0], r[1]);
  sincos(y, r[2], r[3]);
  return r;
#endif
}

/// Several angles at once.
template <std::size_t M>
CTCR_INLINE void sincos(const std::array<double, M>& x, std::array<double, M>& s, std::array<double, M>& c) noexcept {
  for (std::size_t i = 0; i + 1 < M; i += 2) {
    const Lanes r = sincos_pair(x[i], x[i + 1]);
    s[i] = r[0], c[i] = r[1], s[i + 1] = r[2], c[i + 1] = r[3];
  }
  if constexpr (M % 2 == 1) sincos(x[M - 1], s[M - 1], c[M - 1]);
}

}  // namespace ctcr
