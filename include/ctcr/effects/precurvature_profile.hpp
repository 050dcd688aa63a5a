#pragma once
#include "ctcr/effects/hooks.hpp"
#include "ctcr/effects/legendre.hpp"

namespace ctcr {
namespace precurvature_profile {
inline constexpr EffectInfo info{
    .id = "precurvature_profile",
    .title = "Precurvature not constant along the tube",
    .physics = "Shape setting leaves more curvature here and less there, or blurs where the curve starts.",
    .signature = "The error depends on how much of the curved part is deployed.",
    .measure =
        "Deploy each tube in small steps, one at a time; put a second sensor along the robot, or photograph the tube.",
    .look_alikes = "sensor_offset softening field_distortion",
    .reference = "Gilbert & Webster 2016 (shape setting)",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "linear",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.15,
                    .soft_low = -0.5,
                    .soft_high = 0.5,
                    .hard_low = -1.5,
                    .hard_high = 1.5,
                    .per_tube = true,
                    .meaning = "relative change from the middle to the tip"},
    EffectParameter{.name = "quadratic",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.15,
                    .soft_low = -0.5,
                    .soft_high = 0.5,
                    .hard_low = -1.5,
                    .hard_high = 1.5,
                    .per_tube = true,
                    .meaning = "of the ends against the middle"},
    EffectParameter{.name = "cubic",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.1,
                    .soft_low = -0.5,
                    .soft_high = 0.5,
                    .hard_low = -1.5,
                    .hard_high = 1.5,
                    .per_tube = true,
                    .meaning = "of third order"},
    EffectParameter{.name = "quartic",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.07,
                    .soft_low = -0.5,
                    .soft_high = 0.5,
                    .hard_low = -1.5,
                    .hard_high = 1.5,
                    .per_tube = true,
                    .role = Role::detail,
                    .meaning = "of fourth order"},
    EffectParameter{.name = "quintic",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.07,
                    .soft_low = -0.5,
                    .soft_high = 0.5,
                    .hard_low = -1.5,
                    .hard_high = 1.5,
                    .per_tube = true,
                    .role = Role::detail,
                    .meaning = "of fifth order"},
};
}  // namespace precurvature_profile

/// kappa (1 + a P1 + b P2 + ...), Legendre polynomials over the curved part: the mean stays that of the data sheet.
template <int N, class P = double>
struct PrecurvatureProfile : EffectValues<precurvature_profile::parameters, N, P> {
  static constexpr const EffectInfo& info = precurvature_profile::info;

  void material(const TubePlace<P>& place, Material<P>& m) const noexcept {
    if (!place.curved) return;
    const int i = place.tube;
    const P change = legendre_sum(2.0 * place.part - 1.0, this->template get<0>(i), this->template get<1>(i),
                                  this->template get<2>(i), this->template get<3>(i), this->template get<4>(i));
    m.curvature[0] = m.curvature[0] + m.curvature[0] * change;
  }
};

}  // namespace ctcr
