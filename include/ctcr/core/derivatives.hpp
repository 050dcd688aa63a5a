#pragma once
#include <cstdint>

namespace ctcr {

/// Which derivatives of the tip pose a solve also returns.
enum class Derivatives : std::uint8_t {
  none,
  jacobian,    ///< J, by the joints
  compliance,  ///< J and C, by the joints and by the tip load
};

}  // namespace ctcr
