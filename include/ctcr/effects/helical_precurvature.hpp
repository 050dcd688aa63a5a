#pragma once
#include "ctcr/effects/hooks.hpp"

namespace ctcr {
namespace helical_precurvature {
inline constexpr EffectInfo info{
    .id = "helical_precurvature",
    .title = "Helical precurvature",
    .physics = "The tube was twisted while its shape was set: its curve leaves the plane.",
    .signature = "Nearly that of a turned tube; what remains depends on how much of the curve is deployed.",
    .measure = "Record the orientation of the tip, or photograph the tube from two sides.",
    .look_alikes = "sensor_offset",
    .reference = "Gilbert & Webster 2016",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "twist",
                    .unit = "rad/m",
                    .neutral = 0,
                    .sigma = 1.0,
                    .soft_low = -5,
                    .soft_high = 5,
                    .hard_low = -30,
                    .hard_high = 30,
                    .per_tube = true,
                    .meaning = "by which the plane of precurvature turns along the curved part"},
};
}  // namespace helical_precurvature

/// The plane of precurvature turns along the curved part, from where it starts.
template <int N, class P = double>
struct HelicalPrecurvature : EffectValues<helical_precurvature::parameters, N, P> {
  static constexpr const EffectInfo& info = helical_precurvature::info;

  void material(const TubePlace<P>& place, Material<P>& m) const noexcept {
    if (!place.curved) return;
    P s, c;
    sincos(this->template get<0>(place.tube) * place.within, s, c);
    const auto [x, y] = m.curvature;
    m.curvature = {c * x - s * y, s * x + c * y};
  }
};

}  // namespace ctcr
