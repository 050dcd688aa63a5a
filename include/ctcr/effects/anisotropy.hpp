#pragma once
#include "ctcr/effects/hooks.hpp"

namespace ctcr {
namespace anisotropy {
inline constexpr EffectInfo info{
    .id = "anisotropy",
    .title = "Bending stiffness that depends on direction",
    .physics = "Oval or eccentric cross-sections, or notches, make a tube stiffer one way than the other.",
    .signature = "The error changes sign twice per turn of one tube in another.",
    .measure = "Turn one tube through full turns inside the others.",
    .look_alikes = "straight_curvature softening",
    .reference = "Rucker, Jones & Webster 2010",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "along",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.03,
                    .soft_low = -0.1,
                    .soft_high = 0.1,
                    .hard_low = -0.7,
                    .hard_high = 0.7,
                    .per_tube = true,
                    .meaning = "relative, in the plane of precurvature: EI_x = EI (1 + along)"},
    EffectParameter{.name = "across",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.03,
                    .soft_low = -0.1,
                    .soft_high = 0.1,
                    .hard_low = -0.7,
                    .hard_high = 0.7,
                    .per_tube = true,
                    .meaning = "relative, at 45 degrees to it"},
};
}  // namespace anisotropy

/// EI that depends on the direction of bending: EI (1 + e) and EI (1 - e), about axes turned by a constant angle.
template <int N, class P = double>
struct Anisotropy : EffectValues<anisotropy::parameters, N, P> {
  static constexpr const EffectInfo& info = anisotropy::info;

  void material(const TubePlace<P>& place, Material<P>& m) const noexcept {
    m.anisotropy[0] = m.anisotropy[0] + this->template get<0>(place.tube);
    m.anisotropy[1] = m.anisotropy[1] + this->template get<1>(place.tube);
  }
};

}  // namespace ctcr
