#pragma once
// What effects on the profile of a tube share.
#include <array>
#include <cstddef>

#include "ctcr/math/functions.hpp"

namespace ctcr {

/// Sum of c_k P_k(x), k = 1 to K, P_k the Legendre polynomials: over [-1, 1] its mean is 0. Real-time safe.
template <class P, std::size_t K>
[[nodiscard]] P legendre_sum(const P& x, const std::array<P, K>& c) noexcept {
  std::size_t order = K;
  while (order > 1 && vanishes(c[order - 1])) --order;
  P before = 1.0, last = x, sum = c[0] * x;
  for (std::size_t k = 2; k <= order; ++k) {
    const P next = (2.0 - 1.0 / double(k)) * (x * last) - (1.0 - 1.0 / double(k)) * before;
    sum = sum + c[k - 1] * next;
    before = last;
    last = next;
  }
  return sum;
}

}  // namespace ctcr
