#pragma once
#include "ctcr/effects/hooks.hpp"

namespace ctcr {
namespace contact {
inline constexpr EffectInfo info{
    .id = "contact",
    .title = "The tip touches something",
    .physics = "A wall, tissue or a stop pushes the tip where it reaches too far one way.",
    .signature = "Nothing over most of the workspace, then an error on one side of a plane that grows with the depth.",
    .measure = "Go to the same region along several ways; look.",
    .look_alikes = "field_distortion",
    .reference = "penalty contact, general practice",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "stiffness",
                    .unit = "N/m",
                    .neutral = 0,
                    .sigma = 20.0,
                    .soft_low = 0,
                    .soft_high = 1000.0,
                    .hard_low = 0,
                    .hard_high = 1000000.0,
                    .meaning = "of the surface"},
    EffectParameter{.name = "distance",
                    .unit = "m",
                    .neutral = 0.05,
                    .sigma = 0.05,
                    .soft_low = -1,
                    .soft_high = 1,
                    .hard_low = -5,
                    .hard_high = 5,
                    .role = Role::shape,
                    .meaning = "of the plane from the origin of the base frame, along its normal"},
    EffectParameter{.name = "azimuth",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 2.0,
                    .soft_low = -7,
                    .soft_high = 7,
                    .hard_low = -7,
                    .hard_high = 7,
                    .role = Role::shape,
                    .meaning = "of the normal about z, from x"},
    EffectParameter{.name = "elevation",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.7,
                    .soft_low = -1.6,
                    .soft_high = 1.6,
                    .hard_low = -1.6,
                    .hard_high = 1.6,
                    .role = Role::shape,
                    .meaning = "of the normal above the plane of x and y"},
};
}  // namespace contact

/// An elastic plane that pushes back where the tip enters it.
template <int N, class P = double>
struct Contact : EffectValues<contact::parameters, N, P> {
  static constexpr const EffectInfo& info = contact::info;

  /// The normal points into the surface: the force is -k n (n p - d) where that is deeper than 0.
  void environment(const std::array<P, 3>& p, std::array<P, 3>& force) const noexcept {
    P sa, ca, se, ce;
    sincos(this->template get<2>(), sa, ca);
    sincos(this->template get<3>(), se, ce);
    const P n[3] = {ce * ca, ce * sa, se};
    const P depth = n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - this->template get<1>();
    if (!(value(depth) > 0)) return;
    const P push = this->template get<0>() * depth;
    for (std::size_t i = 0; i < 3; ++i) force[i] = force[i] - push * n[i];
  }
};

}  // namespace ctcr
