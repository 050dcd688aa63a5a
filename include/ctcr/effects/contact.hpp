#pragma once
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/functions.hpp"

namespace ctcr {
namespace contact {
inline constexpr EffectInfo info{
    .id = "contact",
    .title = "The tip touches something",
    .physics = "A wall, tissue or a stop pushes the tip where it reaches too far one way.",
    .signature = "Nothing over most of the workspace, then an error beyond a surface that grows with the depth.",
    .measure = "Go to the same region along several ways; look.",
    .look_alikes = "field_distortion",
    .reference = "penalty contact, general practice; a sphere or a soft wall: Hertz 1882",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "stiffness",
                    .unit = "N/m",
                    .neutral = 0,
                    .sigma = 20.0,
                    .soft = {0, 1000.0},
                    .hard = {0, 1000000.0},
                    .meaning = "of the surface"},
    EffectParameter{.name = "distance",
                    .unit = "m",
                    .neutral = 0.05,
                    .sigma = 0.05,
                    .soft = {-1, 1},
                    .hard = {-5, 5},
                    .role = Role::shape,
                    .quantity = Quantity::surface,
                    .meaning = "of the surface from the origin of the base frame, along the normal"},
    EffectParameter{.name = "azimuth",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 2.0,
                    .soft = {-7, 7},
                    .hard = {-7, 7},
                    .role = Role::shape,
                    .quantity = Quantity::surface,
                    .meaning = "of the normal about z, from x"},
    EffectParameter{.name = "elevation",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.7,
                    .soft = {-1.6, 1.6},
                    .hard = {-1.6, 1.6},
                    .role = Role::shape,
                    .quantity = Quantity::surface,
                    .meaning = "of the normal above the plane of x and y"},
    EffectParameter{.name = "rounding",
                    .unit = "m",
                    .neutral = 2e-3,
                    .sigma = 2e-3,
                    .soft = {0, 0.01},
                    .hard = {0, 0.05},
                    .role = Role::shape,
                    .meaning = "depth on either side of the surface over which the push sets in"},
    EffectParameter{.name = "curvature",
                    .unit = "1/m",
                    .neutral = 0,
                    .sigma = 10,
                    .soft = {-100, 100},
                    .hard = {-100, 100},
                    .role = Role::shape,
                    .meaning = "of the surface: 0 of a plane, 1 / radius of a ball, negative inside a hollow"},
};
}  // namespace contact

/// An elastic plane, ball or hollow that pushes back where the tip enters it.
template <int N, class P = double>
struct Contact : EffectValues<contact::parameters, N, P> {
  static constexpr const EffectInfo& info = contact::info;

  /// The normal n points into the surface, through the middle of a ball. The force along its outward normal is k d, d the
  /// depth where that is beyond the rounding r, (d + r)^2 / (4 r) within it, and nothing before.
  void environment(const std::array<P, 3>& p, std::array<P, 3>& force) const noexcept {
    P sa, ca, se, ce;
    sincos(this->template get<2>(), sa, ca);
    sincos(this->template get<3>(), se, ce);
    const P &distance = this->template get<1>(), &r = this->template get<4>(), &curvature = this->template get<5>();
    const P n[3] = {ce * ca, ce * sa, se};
    P along = 0.0, square = 0.0, length = 0.0, inwards[3];
    for (std::size_t i = 0; i < 3; ++i) {
      const P v = p[i] - distance * n[i];
      inwards[i] = n[i] - curvature * v;
      along = along + n[i] * v;
      square = square + v * v;
      length = length + inwards[i] * inwards[i];
    }
    length = square_root(length);
    // 1 / curvature less the distance from the middle of the ball, without the difference of two large numbers.
    const P depth = (2.0 * along - curvature * square) * inverse(1.0 + length);
    if (!(value(depth + r) > 0)) return;
    // A push that set in with a jump of its slope would stop fits wherever a reading just touches.
    const P pressed = value(depth) < value(r) ? (depth + r) * (depth + r) * inverse(4.0 * r) : depth;
    const P push = this->template get<0>() * pressed * inverse(length);
    for (std::size_t i = 0; i < 3; ++i) force[i] = force[i] - push * inwards[i];
  }
};

}  // namespace ctcr
