#pragma once
#include <type_traits>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/mechanics/coefficients.hpp"
#include "ctcr/robot/robot_check.hpp"

namespace ctcr {

/// Coefficients for the general path, in which effects, and derivatives by the precurvature, bend a curved part even
/// where its precurvature is 0. Real time: yes.
template <int N>
inline Coefficients<N> with_all_curves(const Robot<N>& robot) noexcept {
  Coefficients<N> c = make_coefficients(robot);
  for (std::size_t i = 0; i < N; ++i) c.curved[i] = robot.tubes[i].curved_length > 0;
  return c;
}

/// Coefficients of the general path of a robot, and its effects on the rod.
template <int N, class Fx>
struct EffectCoefficients {
  std::array<TubeParameters<double>, N> tubes;
  Coefficients<N> plain;  ///< without effects: where tubes end and curve
  Vec3 gravity;           ///< base frame [m/s^2]
  typename Fx::OnRod::template On<N> effects;
  bool on_rod;  ///< whether effects change the equilibrium of the rod: else `plain` has the same
};

/// Whether coefficients C are those of a model with effects.
template <class C>
inline constexpr bool has_effects = false;
template <int N, class Fx>
inline constexpr bool has_effects<EffectCoefficients<N, Fx>> = true;

/// A robot ready to be solved: its description and the numbers derived from it. Immutable; share it between threads.
/// @tparam Fx  EffectList<...> of its effects beyond the standard model
template <int N, class Fx = Standard>
class Model {
public:
  using Effects = typename Fx::template On<N>;
  using Numbers = std::conditional_t<Fx::none, Coefficients<N>, EffectCoefficients<N, Fx>>;

  explicit Model(const Robot<N>& robot, const Effects& effects = {}) noexcept
    : robot_(robot), effects_(effects), check_(check_robot(robot)) {
    if constexpr (Fx::none)
      coefficients_ = make_coefficients(robot);
    else
      coefficients_ = {tube_parameters(robot), with_all_curves(robot), robot.gravity, effects.on_rod(),
                       effects.act_on_rod()};
  }

  /// ok, or invalid_robot: then no equilibrium is looked for. Real time: yes.
  [[nodiscard]] Status check() const noexcept { return check_; }
  [[nodiscard]] const Robot<N>& robot() const noexcept { return robot_; }
  [[nodiscard]] const Effects& effects() const noexcept { return effects_; }
  [[nodiscard]] const Numbers& coefficients() const noexcept { return coefficients_; }

private:
  Robot<N> robot_;
  [[no_unique_address]] Effects effects_;
  Numbers coefficients_;
  Status check_;
};

}  // namespace ctcr
