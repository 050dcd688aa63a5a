#pragma once
#include "ctcr/effects/hooks.hpp"

namespace ctcr {
namespace torsional_compliance {
inline constexpr EffectInfo info{
    .id = "torsional_compliance",
    .title = "Torsional compliance of a drive or a tube",
    .physics = "Couplings, grips and belts twist; so does a tube whose shear modulus is lower than stated.",
    .signature =
        "The tube stands behind its motor in proportion to the torque that it transmits, the same way from both "
        "directions.",
    .measure = "Measure the angle of a tube at its grasped end. No configuration tells the drive from the tube.",
    .look_alikes = "softening anisotropy",
    .reference = "Boyer et al. 2024, Table II (Poisson ratio)",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "compliance",
                    .unit = "rad/(N m)",
                    .neutral = 0,
                    .sigma = 2.0,
                    .soft = {-2, 30},  // half the compliance of the inner tube of Table II: -beta / GJ = 55
                    .hard = {-30, 100},
                    .per_tube = true,
                    .meaning = "of the drive of a tube"},
};
}  // namespace torsional_compliance

/// Torsion angle of the drive in proportion to the torque of its tube, in addition to the torsion of the tube.
template <int N, class P = double>
struct TorsionalCompliance : EffectValues<torsional_compliance::parameters, N, P> {
  static constexpr const EffectInfo& info = torsional_compliance::info;

  void base_compliance(const std::array<P, N>& torque, std::array<P, N>& angle) const noexcept {
    for (std::size_t i = 0; i < N; ++i) angle[i] = angle[i] - this->template get<0>(int(i)) * torque[i];
  }
};

}  // namespace ctcr
