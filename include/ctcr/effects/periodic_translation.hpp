#pragma once
#include <numbers>

#include "ctcr/effects/periodic_error.hpp"

namespace ctcr {
namespace periodic_translation {
inline constexpr EffectInfo info{
    .id = "periodic_translation",
    .title = "Translation error once per screw turn",
    .physics = "A lead screw that wobbles moves the tube too far and then not far enough, once per turn.",
    .signature = "The error along the tube is periodic in the insertion, with the pitch of the screw.",
    .measure = "Insert in steps that are no divisor of the pitch.",
    .look_alikes = "backlash_translation",
    .reference = "lead screw metrology, general practice",
};
inline constexpr auto parameters = periodic_error({.name = {},
                                                   .unit = "m",
                                                   .sigma = 3e-05,
                                                   .soft_low = -0.0001,
                                                   .soft_high = 0.0001,
                                                   .hard_low = -0.002,
                                                   .hard_high = 0.002},
                                                  {.name = {},
                                                   .unit = "m",
                                                   .sigma = 8e-06,
                                                   .soft_low = -0.0001,
                                                   .soft_high = 0.0001,
                                                   .hard_low = -0.002,
                                                   .hard_high = 0.002},
                                                  {.name = "pitch",
                                                   .unit = "m",
                                                   .neutral = 0.002,
                                                   .sigma = 0.0001,
                                                   .soft_low = 0.0002,
                                                   .soft_high = 0.02,
                                                   .hard_low = 1e-05,
                                                   .hard_high = 0.1,
                                                   .role = Role::shape,
                                                   .meaning = "translation per turn of the screw"});
}  // namespace periodic_translation

/// Error of translation once per turn of the lead screw.
template <int N, class P = double>
struct PeriodicTranslation : EffectValues<periodic_translation::parameters, N, P> {
  static constexpr const EffectInfo& info = periodic_translation::info;

  void actuate(const Occasion&, std::array<P, N>& beta, std::array<P, N>&) const noexcept {
    const P rate = 2 * std::numbers::pi * inverse(this->template get<2>());
    for (int i = 0; i < N; ++i) {
      P& x = beta[std::size_t(i)];
      x = x + error_at(rate * x, *this, i);
    }
  }
};

}  // namespace ctcr
