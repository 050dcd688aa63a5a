#pragma once
#include <array>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <type_traits>

namespace ctcr::python {

/// Numbers of tubes of the robots that this module models: CTCR_TUBES of CMake.
inline constexpr std::array modelled_tubes{CTCR_TUBES};

/// Calls f with the number of tubes as a constant. @throws std::invalid_argument for a number that is not modelled
template <std::size_t K = 0, class F>
auto with_tubes(std::ptrdiff_t tubes, const F& f) {
  if (tubes == modelled_tubes[K]) return f(std::integral_constant<int, modelled_tubes[K]>{});
  if constexpr (K + 1 < modelled_tubes.size())
    return with_tubes<K + 1>(tubes, f);
  else
    throw std::invalid_argument("ctcr is not compiled for robots of " + std::to_string(tubes) + " tubes");
}

}  // namespace ctcr::python
