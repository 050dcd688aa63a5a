#pragma once
// Free shapes of a tube other than a straight part and a planar arc of constant curvature.
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
    .variants = {{"linear", "linear"}, {"quadratic", "quadratic"}, {"linear", "quadratic"}, {"linear", "cubic"}},
};

/// The weight of a Legendre polynomial.
consteval EffectParameter weight(std::string_view name, double sigma, std::string_view meaning,
                                 Role role = Role::amplitude) {
  return {.name = name,
          .neutral = 0,
          .sigma = sigma,
          .soft = {-0.5, 0.5},
          .hard = {-1.5, 1.5},
          .per_tube = true,
          .role = role,
          .meaning = meaning};
}
inline constexpr std::array parameters{
    weight("linear", 0.15, "relative change from the middle to the tip"),
    weight("quadratic", 0.15, "of the ends against the middle"), weight("cubic", 0.1, "of third order"),
    weight("quartic", 0.07, "of fourth order", Role::detail), weight("quintic", 0.07, "of fifth order", Role::detail)};
}  // namespace precurvature_profile

namespace straight_curvature {
inline constexpr EffectInfo info{
    .id = "straight_curvature",
    .title = "The straight part is not straight",
    .physics = "Tubes come from coils and keep some of the bend.",
    .signature = "The error grows with the deployed straight length, also where all curves oppose.",
    .measure = "Deploy the straight parts far; roll a tube on a table.",
    .look_alikes = "tip_load anisotropy",
    .reference = "coiled stock, general practice",
    .variants = {{"bend_x", "bend_x"}, {"bend_x", "bend_y"}},
};
inline constexpr EffectParameter bend{
    .name = {}, .unit = "1/m", .neutral = 0, .sigma = 0.2, .soft = {-1, 1}, .hard = {-5, 5}, .per_tube = true};
inline constexpr EffectParameter unevenness{
    .name = {}, .neutral = 0, .sigma = 0.3, .soft = {-1, 1}, .hard = {-3, 3}, .per_tube = true, .role = Role::shape};
inline constexpr std::array parameters{
    bend.named("bend_x", "about the axis of precurvature"), bend.named("bend_y", "across it"),
    unevenness.named("slope", "relative change of the bend from the middle of the straight part to its end"),
    unevenness.named("bow", "of the ends against the middle")};
}  // namespace straight_curvature

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
                    .soft = {-5, 5},
                    .hard = {-30, 30},
                    .per_tube = true,
                    .meaning = "by which the plane of precurvature turns along the curved part"},
};
}  // namespace helical_precurvature

/// kappa (1 + a P1 + b P2 + ...), Legendre polynomials over the curved part: the mean stays that of the data sheet.
template <int N, class P = double>
struct PrecurvatureProfile : EffectValues<precurvature_profile::parameters, N, P> {
  static constexpr const EffectInfo& info = precurvature_profile::info;

  void material(const TubePoint<P>& at, Material<P>& m) const noexcept {
    if (!at.curved) return;
    const P change = [&]<std::size_t... K>(std::index_sequence<K...>) {
      return legendre_sum(2.0 * at.part - 1.0, this->template get<K>(at.tube)...);
    }(std::make_index_sequence<precurvature_profile::parameters.size()>{});
    m.curvature[0] = m.curvature[0] + m.curvature[0] * change;
  }
};

/// Precurvature of the part that should be straight, about two axes, with Legendre polynomials where it is uneven.
template <int N, class P = double>
struct StraightCurvature : EffectValues<straight_curvature::parameters, N, P> {
  static constexpr const EffectInfo& info = straight_curvature::info;

  void material(const TubePoint<P>& at, Material<P>& m) const noexcept {
    if (at.curved) return;
    const int i = at.tube;
    const P &x = this->template get<0>(i), &y = this->template get<1>(i);
    const P uneven = 1.0 + legendre_sum(2.0 * at.part - 1.0, this->template get<2>(i), this->template get<3>(i));
    m.curvature[0] = m.curvature[0] + x * uneven;
    m.curvature[1] = m.curvature[1] + y * uneven;
  }
};

/// The plane of precurvature turns at a constant rate along the curved part, from where it starts.
template <int N, class P = double>
struct HelicalPrecurvature : EffectValues<helical_precurvature::parameters, N, P> {
  static constexpr const EffectInfo& info = helical_precurvature::info;

  void material(const TubePoint<P>& at, Material<P>& m) const noexcept {
    if (!at.curved) return;
    P s, c;
    sincos(this->template get<0>(at.tube) * at.within, s, c);
    const auto [x, y] = m.curvature;
    m.curvature = {c * x - s * y, s * x + c * y};
  }
};

}  // namespace ctcr
