#pragma once
#include "ctcr/effects/lean.hpp"

namespace ctcr {
namespace clearance {
inline constexpr EffectInfo info{
    .id = "clearance",
    .title = "Clearance between the tubes",
    .physics = "Tubes fit loosely: where an outer tube ends, the inner ones lean to one side.",
    .signature =
        "A kink of constant size whose direction follows the bending moment: it does not grow with the moment.",
    .measure = "Load with different weights: a kink stays, a compliance grows.",
    .look_alikes = "entry_clearance softening sensor_offset",
    .reference = "Ha, Fagogenis & Dupont 2019; Sensors 2023, 23, 3709",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "tilt",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.0087,
                    .soft_low = -0.03,
                    .soft_high = 0.03,
                    .hard_low = -0.2,
                    .hard_high = 0.2,
                    .per_tube = true,
                    .meaning = "largest tilt at the tip of a tube (none at the innermost)"},
    leaning_moment,
    leaning_compliance,
};
}  // namespace clearance

/// Where a tube ends, the bundle inside it tilts within its clearance, towards the moment that it carries.
template <int N, class P = double>
struct Clearance : EffectValues<clearance::parameters, N, P> {
  static constexpr const EffectInfo& info = clearance::info;

  void station(Station<P, N>& s) const noexcept {
    if (s.kind != Station<P, N>::Kind::tube_tip) return;
    kink(s, lean(s.moment, this->template get<0>(s.tube), this->template get<1>(), this->template get<2>()));
  }
};

}  // namespace ctcr
