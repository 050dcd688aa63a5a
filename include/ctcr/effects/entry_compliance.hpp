#pragma once
#include "ctcr/effects/lean.hpp"

namespace ctcr {
namespace entry_compliance {
inline constexpr EffectInfo info{
    .id = "entry_compliance",
    .title = "Compliance where the tubes leave the plate",
    .physics = "The front plate or its bushing gives way.",
    .signature = "The whole robot turns about the entry, in proportion to the moment there.",
    .measure = "Hang different weights; put a sensor near the plate.",
    .look_alikes = "entry_clearance tip_load",
    .reference = "practice",
    .needs = {.loads = true},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "compliance",
                    .unit = "rad/(N m)",
                    .neutral = 0,
                    .sigma = 0.5,
                    .soft_low = 0,
                    .soft_high = 3,
                    .hard_low = -5,
                    .hard_high = 50,
                    .meaning = "of the entry against bending"},
    pivot_depth,
};
}  // namespace entry_compliance

/// The tubes leave the front plate turned by the moment that they carry there.
template <int N, class P = double>
struct EntryCompliance : EffectValues<entry_compliance::parameters, N, P> {
  static constexpr const EffectInfo& info = entry_compliance::info;

  void station(Station<P, N>& s) const noexcept {
    if (s.kind != Station<P, N>::Kind::plate) return;
    const P &compliance = this->template get<0>(), &depth = this->template get<1>();
    const auto moment = moment_about(s, depth);
    kink_about(s, {compliance * moment[0], compliance * moment[1]}, depth);
  }
};

}  // namespace ctcr
