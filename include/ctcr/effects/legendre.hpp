#pragma once
// Legendre polynomials, for profiles along a tube.
#include <array>
#include <concepts>
#include <cstddef>

#include "ctcr/math/functions.hpp"

namespace ctcr {

/// Sum of c_k P_k(x), k = 1, 2, ..., P_k the Legendre polynomials: over [-1, 1] its mean is 0. Real time: yes.
template <class P, std::same_as<P>... C>
[[nodiscard]] P legendre_sum(const P& x, const C&... c) noexcept {
  constexpr std::size_t K = sizeof...(C);
  const double at = value(x);
  const std::array<double, K> factor{value(c)...};
  std::array<double, K + 1> p{1.0, at}, slope{0.0, 1.0};  // P_k and its derivative
  double sum = factor[0] * at, along = factor[0];
  for (std::size_t k = 2; k <= K; ++k) {
    p[k] = (2.0 - 1.0 / double(k)) * at * p[k - 1] - (1.0 - 1.0 / double(k)) * p[k - 2];
    slope[k] = double(k) * p[k - 1] + at * slope[k - 1];
    sum += factor[k - 1] * p[k];
    along += factor[k - 1] * slope[k];
  }
  P result = mapped(x, sum, along);
  if constexpr (is_dual<P>) {  // by the coefficients
    auto next = p.begin();
    const auto add = [&](const P& by, double weight) {
      for (int g = 0; g < groups_of<P>; ++g) result.d[g] += weight * by.d[g];
    };
    (add(c, *++next), ...);
  }
  return result;
}

}  // namespace ctcr
