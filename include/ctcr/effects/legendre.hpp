#pragma once
// What effects on the profile of a tube share.
#include <array>
#include <cstddef>

#include "ctcr/math/functions.hpp"

namespace ctcr {

/// Sum of c_k P_k(x), k = 1 to K, P_k the Legendre polynomials: over [-1, 1] its mean is 0. Real-time safe.
template <class P, std::size_t K>
[[nodiscard]] P legendre_sum(const P& x, const std::array<P, K>& c) noexcept {
  const double at = value(x);
  std::array<double, K + 1> p{1.0, at}, slope{0.0, 1.0};  // P_k and its derivative
  double sum = value(c[0]) * at, along = value(c[0]);
  for (std::size_t k = 2; k <= K; ++k) {
    p[k] = (2.0 - 1.0 / double(k)) * at * p[k - 1] - (1.0 - 1.0 / double(k)) * p[k - 2];
    slope[k] = double(k) * p[k - 1] + at * slope[k - 1];
    sum += value(c[k - 1]) * p[k];
    along += value(c[k - 1]) * slope[k];
  }
  P result = mapped(x, sum, along);
  if constexpr (is_dual<P>)  // by the coefficients
    for (std::size_t k = 0; k < K; ++k) result = result + p[k + 1] * (c[k] - value(c[k]));
  return result;
}

}  // namespace ctcr
