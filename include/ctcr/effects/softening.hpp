#pragma once
#include "ctcr/effects/hooks.hpp"

namespace ctcr {
namespace softening {
inline constexpr EffectInfo info{
    .id = "softening",
    .title = "Superelastic softening",
    .physics =
        "Nitinol gives way where it is bent far from its free shape: the tube is softer than its Young modulus says.",
    .signature =
        "Tubes bend further towards one another when their curves oppose than predicted, growing with the third power "
        "of the change of curvature.",
    .measure = "Oppose strongly curved tubes; compare with aligned ones under the same loads.",
    .look_alikes = "torsional_compliance precurvature_profile anisotropy",
    .reference = "Jang et al. 2016",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "gamma",
                    .unit = "m^2",
                    .neutral = 0,
                    .sigma = 0.004,
                    .soft = {0, 0.03},  // a knee at 5 1/m: 0.4 % strain at a diameter of 1.5 mm
                    .hard = {0, 0.08},
                    .per_tube = true,
                    .meaning = "part of the stiffness that is lost per square of the change of curvature, as long as "
                               "that is small"},
    EffectParameter{.name = "plateau",
                    .neutral = 0.25,
                    .sigma = 0.15,
                    .soft = {0.05, 0.6},
                    .hard = {0.02, 0.9},
                    .role = Role::shape,
                    .meaning = "part of the stiffness that is left in the end"},
    EffectParameter{.name = "sharpness",
                    .neutral = 2,
                    .sigma = 1.5,
                    .soft = {2, 8},
                    .hard = {2, 8},
                    .role = Role::shape,
                    .meaning = "how suddenly the tube gives way: 2 gradually, 8 at a knee"},
};
}  // namespace softening

/// Superelastic softening: m = EI d (1 - gamma |d|^2) for a small change d of curvature where the sharpness is 2, towards
/// a plateau for a large one (Material).
template <int N, class P = double>
struct Softening : EffectValues<softening::parameters, N, P> {
  static constexpr const EffectInfo& info = softening::info;

  void material(const TubePoint<P>& at, Material<P>& m) const noexcept {
    m.softening = m.softening + this->template get<0>(at.tube);
    m.plateau = this->template get<1>();
    m.sharpness = this->template get<2>();
  }
};

}  // namespace ctcr
