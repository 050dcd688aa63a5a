#pragma once
#include "ctcr/effects/lean.hpp"

namespace ctcr {
namespace entry_clearance {
inline constexpr EffectInfo info{
    .id = "entry_clearance",
    .title = "Clearance in the front plate",
    .physics = "The bore is wider than the outer tube, which leans to one side.",
    .signature = "The whole robot tilts about the entry by a constant angle whose direction follows the moment there.",
    .measure = "Hang different weights: a tilt stays, a compliance grows.",
    .look_alikes = "entry_compliance clearance",
    .reference = "practice",
    .needs = {.loads = true},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "tilt",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.0087,
                    .soft_low = 0,
                    .soft_high = 0.03,
                    .hard_low = -0.1,
                    .hard_high = 0.2,
                    .meaning = "largest tilt"},
    leaning_moment,
    leaning_compliance,
    pivot_depth,
};
}  // namespace entry_clearance

/// The tubes tilt within the bore of the front plate, towards the moment that they carry there.
template <int N, class P = double>
struct EntryClearance : EffectValues<entry_clearance::parameters, N, P> {
  static constexpr const EffectInfo& info = entry_clearance::info;

  void station(Station<P, N>& s) const noexcept {
    if (s.kind != Station<P, N>::Kind::plate) return;
    const P& depth = this->template get<3>();
    const auto moment = moment_about(s, depth);
    kink_about(s, lean(moment, this->template get<0>(), this->template get<1>(), this->template get<2>()), depth);
  }
};

}  // namespace ctcr
