#pragma once
#include "ctcr/effects/hooks.hpp"

namespace ctcr {
namespace tip_load {
inline constexpr EffectInfo info{
    .id = "tip_load",
    .title = "Weight of an end cap, or another constant force at the tip",
    .physics = "Something hangs on the tip or pulls at it, all the time, in a direction fixed in space.",
    .signature = "The error points along the force and grows with the compliance: with the deployed length.",
    .measure = "Weigh the cap. Repeat with the base tilted: a weight keeps pointing down, a cable does not.",
    .look_alikes = "entry_compliance sensor_offset",
    .reference = "Rucker & Webster 2011; disturbance wrenches",
    .needs = {.gravity = true},
    .variants = {{"mass", "mass"}, {"force_x", "force_z"}},
};
inline constexpr EffectParameter force{.name = {},
                                       .unit = "N",
                                       .neutral = 0,
                                       .sigma = 0.01,
                                       .soft = {-0.2, 0.2},
                                       .hard = {-0.5, 0.5},
                                       .quantity = Quantity::tip_force};
inline constexpr std::array parameters{EffectParameter{.name = "mass",
                                                       .unit = "kg",
                                                       .neutral = 0,
                                                       .sigma = 0.001,
                                                       .soft = {0, 0.02},
                                                       .hard = {0, 0.05},
                                                       .meaning = "hanging on the tip"},
                                       force.named("force_x", "base frame"), force.named("force_y", "base frame"),
                                       force.named("force_z", "base frame")};
}  // namespace tip_load

/// A constant force at the robot tip that is not among the known loads: of an end cap, a sensor, its cable.
template <int N, class P = double>
struct TipWeight : EffectValues<tip_load::parameters, N, P> {
  static constexpr const EffectInfo& info = tip_load::info;

  void tip_force(const std::array<P, 3>& gravity, std::array<P, 3>& force) const noexcept {
    const P& mass = this->template get<0>();
    force[0] = force[0] + mass * gravity[0] + this->template get<1>();
    force[1] = force[1] + mass * gravity[1] + this->template get<2>();
    force[2] = force[2] + mass * gravity[2] + this->template get<3>();
  }
};

}  // namespace ctcr
