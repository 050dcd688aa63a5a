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
inline constexpr EffectParameter relative{
    .name = {}, .neutral = 0, .sigma = 0.03, .soft = {-0.1, 0.1}, .hard = {-0.7, 0.7}, .per_tube = true};
inline constexpr std::array parameters{
    relative.named("along", "relative, in the plane of precurvature: EI_x = EI (1 + along)"),
    relative.named("across", "relative, at 45 degrees to it")};
}  // namespace anisotropy

/// EI that depends on the direction of bending: the factor I + [a0 a1; a1 -a0] of Material, in the tube frame.
template <int N, class P = double>
struct Anisotropy : EffectValues<anisotropy::parameters, N, P> {
  static constexpr const EffectInfo& info = anisotropy::info;

  void material(const TubePoint<P>& at, Material<P>& m) const noexcept {
    m.anisotropy[0] = m.anisotropy[0] + this->template get<0>(at.tube);
    m.anisotropy[1] = m.anisotropy[1] + this->template get<1>(at.tube);
  }
};

}  // namespace ctcr
