#pragma once
#include "ctcr/core/types.hpp"

namespace ctcr {

/// Wrench applied at the robot tip, of constant direction in the base frame.
struct TipLoad {
  Vec3 force = Vec3::Zero();   ///< f [N]
  Vec3 moment = Vec3::Zero();  ///< l [N m]
};

}  // namespace ctcr
