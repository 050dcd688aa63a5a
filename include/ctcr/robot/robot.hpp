#pragma once
#include <array>

#include "ctcr/core/types.hpp"
#include "ctcr/robot/tube.hpp"

namespace ctcr {

/// N concentric tubes, innermost first, and the gravity they feel.
template <int N>
struct Robot {
  static_assert(N >= 1, "a robot has at least one tube");
  std::array<Tube, N> tubes{};
  Vec3 gravity = Vec3::Zero();  ///< base frame [m/s^2]; zero: weightless
};

}  // namespace ctcr
