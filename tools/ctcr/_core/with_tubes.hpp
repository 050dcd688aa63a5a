#pragma once
#include <cstddef>
#include <stdexcept>
#include <type_traits>

namespace ctcr::python {

inline constexpr int max_tubes = 4;

/// Calls f with the number of tubes as a constant. @throws std::invalid_argument for other numbers than 1 to max_tubes
template <int N = 1, class F>
auto with_tubes(std::ptrdiff_t tubes, const F& f) {
  if (tubes == N) return f(std::integral_constant<int, N>{});
  if constexpr (N < max_tubes)
    return with_tubes<N + 1>(tubes, f);
  else
    throw std::invalid_argument("a robot has 1 to 4 tubes");
}

}  // namespace ctcr::python
