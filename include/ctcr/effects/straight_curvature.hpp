#pragma once
#include "ctcr/effects/hooks.hpp"
#include "ctcr/effects/legendre.hpp"

namespace ctcr {
namespace straight_curvature {
inline constexpr EffectInfo info{
    .id = "straight_curvature",
    .title = "The straight part is not straight",
    .physics = "Tubes come from coils and keep some of the bend.",
    .signature = "The error grows with the deployed straight length, also where all curves oppose.",
    .measure = "Deploy the straight parts far; roll a tube on a table.",
    .look_alikes = "tip_load anisotropy",
    .reference = "coiled stock, general practice",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "bend_x",
                    .unit = "1/m",
                    .neutral = 0,
                    .sigma = 0.2,
                    .soft_low = -1,
                    .soft_high = 1,
                    .hard_low = -5,
                    .hard_high = 5,
                    .per_tube = true,
                    .meaning = "about the axis of precurvature"},
    EffectParameter{.name = "bend_y",
                    .unit = "1/m",
                    .neutral = 0,
                    .sigma = 0.2,
                    .soft_low = -1,
                    .soft_high = 1,
                    .hard_low = -5,
                    .hard_high = 5,
                    .per_tube = true,
                    .meaning = "across it"},
    EffectParameter{.name = "slope",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.3,
                    .soft_low = -1,
                    .soft_high = 1,
                    .hard_low = -3,
                    .hard_high = 3,
                    .per_tube = true,
                    .role = Role::shape,
                    .meaning = "relative change of the bend from the middle of the straight part to its end"},
    EffectParameter{.name = "bow",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.3,
                    .soft_low = -1,
                    .soft_high = 1,
                    .hard_low = -3,
                    .hard_high = 3,
                    .per_tube = true,
                    .role = Role::shape,
                    .meaning = "of the ends against the middle"},
};
}  // namespace straight_curvature

/// Precurvature of the part that should be straight, with Legendre polynomials where it is uneven.
template <int N, class P = double>
struct StraightCurvature : EffectValues<straight_curvature::parameters, N, P> {
  static constexpr const EffectInfo& info = straight_curvature::info;

  void material(const TubePlace<P>& place, Material<P>& m) const noexcept {
    if (place.curved) return;
    const int i = place.tube;
    const P &x = this->template get<0>(i), &y = this->template get<1>(i);
    const P uneven = 1.0 + legendre_sum(2.0 * place.part - 1.0, this->template get<2>(i), this->template get<3>(i));
    m.curvature[0] = m.curvature[0] + x * uneven;
    m.curvature[1] = m.curvature[1] + y * uneven;
  }
};

}  // namespace ctcr
