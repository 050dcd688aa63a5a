#pragma once
#include <cstddef>
#include <stdexcept>
#include <type_traits>

namespace ctcr::python {

/// Calls f with the number of tubes as a constant. @throws std::invalid_argument for other numbers
template <class F>
auto with_tubes(std::ptrdiff_t tubes, const F& f) {
  switch (tubes) {
    case 1: return f(std::integral_constant<int, 1>{});
    case 2: return f(std::integral_constant<int, 2>{});
    case 3: return f(std::integral_constant<int, 3>{});
    case 4: return f(std::integral_constant<int, 4>{});
  }
  throw std::invalid_argument("a robot has 1 to 4 tubes");
}

}  // namespace ctcr::python
