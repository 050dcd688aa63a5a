#pragma once
#include "ctcr/effects/hooks.hpp"

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
};
}  // namespace straight_curvature

/// Precurvature of the part that should be straight.
template <int N, class P = double>
struct StraightCurvature : EffectValues<straight_curvature::parameters, N, P> {
  static constexpr const EffectInfo& info = straight_curvature::info;

  void material(const TubePlace<P>& place, Material<P>& m) const noexcept {
    if (place.curved) return;
    m.curvature[0] = m.curvature[0] + this->template get<0>(place.tube);
    m.curvature[1] = m.curvature[1] + this->template get<1>(place.tube);
  }
};

}  // namespace ctcr
