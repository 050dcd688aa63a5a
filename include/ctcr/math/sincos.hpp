#pragma once
// Sine and cosine of one angle in one call, inlined and without a branch or a table: about 1 ulp for |x| < 1e5.
#include <bit>
#include <cstdint>

#include "ctcr/math/lanes.hpp"

namespace ctcr {

/// s = sin x, c = cos x; x in rad. Argument reduced by multiples of pi/2 (Cody-Waite), minimax polynomials on
/// [-pi/4, pi/4] (the coefficients of the Cephes library). Real time: yes.
CTCR_INLINE void sincos(double x, double& s, double& c) noexcept {
  constexpr double round_to_integer = 6755399441055744.0;  // 1.5 * 2^52: adding it leaves the integer in the low bits
  const double t = x * 0.63661977236758134308 + round_to_integer;
  const auto quadrant = std::bit_cast<std::uint64_t>(t);
  const double k = t - round_to_integer;
  const double r = (x - k * 1.57079632673412561417e+00) - k * 6.07710050650619224932e-11;
  const double z = r * r;
  const double ps =
      r + r * z * (-1.66666666666666307295e-1 +
                   z * (8.33333333332211858878e-3 +
                        z * (-1.98412698295895385996e-4 +
                             z * (2.75573136213857245213e-6 +
                                  z * (-2.50507477628578072866e-8 + z * 1.58962301576546568060e-10)))));
  const double pc =
      1.0 - 0.5 * z +
      z * z * (4.16666666666665929218e-2 +
               z * (-1.38888888888730564116e-3 +
                    z * (2.48015872888517045348e-5 +
                         z * (-2.75573141792967388112e-7 +
                              z * (2.08757008419747316778e-9 + z * -1.13585365213876817300e-11)))));
  const bool swap = (quadrant & 1u) != 0;
  const double a = swap ? pc : ps;
  const double b = swap ? ps : pc;
  s = std::bit_cast<double>(std::bit_cast<std::uint64_t>(a) ^ ((quadrant & 2u) << 62));
  c = std::bit_cast<double>(std::bit_cast<std::uint64_t>(b) ^ (((quadrant + 1u) & 2u) << 62));
}

}  // namespace ctcr
