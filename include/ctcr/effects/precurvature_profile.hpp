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

/// The weight of a Legendre polynomial.
consteval EffectParameter weight(std::string_view name, double sigma, std::string_view meaning,
                                 Role role = Role::amplitude) {
  return {.name = name,
          .unit = "",
          .neutral = 0,
          .sigma = sigma,
          .soft_low = -0.5,
          .soft_high = 0.5,
          .hard_low = -1.5,
          .hard_high = 1.5,
          .per_tube = true,
          .role = role,
          .meaning = meaning};
}
inline constexpr std::array parameters{
    weight("linear", 0.15, "relative change from the middle to the tip"),
    weight("quadratic", 0.15, "of the ends against the middle"), weight("cubic", 0.1, "of third order"),
    weight("quartic", 0.07, "of fourth order", Role::detail), weight("quintic", 0.07, "of fifth order", Role::detail)};
}  // namespace precurvature_profile

/// kappa (1 + a P1 + b P2 + ...), Legendre polynomials over the curved part: the mean stays that of the data sheet.
template <int N, class P = double>
struct PrecurvatureProfile : EffectValues<precurvature_profile::parameters, N, P> {
  static constexpr const EffectInfo& info = precurvature_profile::info;

  void material(const TubePlace<P>& place, Material<P>& m) const noexcept {
    if (!place.curved) return;
    const int i = place.tube;
    const P change = [&]<std::size_t... K>(std::index_sequence<K...>) {
      return legendre_sum(2.0 * place.part - 1.0, this->template get<K>(i)...);
    }(std::make_index_sequence<precurvature_profile::parameters.size()>{});
    m.curvature[0] = m.curvature[0] + m.curvature[0] * change;
  }
};

}  // namespace ctcr
