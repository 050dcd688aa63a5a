#pragma once
// Friction and torsion at one sample: friction depends on how the tubes turn at their contacts, and that on friction.

#include "ctcr/friction/relative_torsion.hpp"

namespace ctcr {

/// Finds the relative torsion at which the equilibrium with the friction of this torsion has this torsion, by Newton's method.
/// The constitutive law of friction may be stiff: its derivative is taken at the iterate. The torsion of the equilibrium is a
/// smooth function of friction: its derivative is that of a sample before, corrected by what the iterates show (Broyden), and
/// computed anew where that does not lead on. Friction by the torsion of the sample before instead would overshoot by more
/// than it corrects, and change sides at every sample.
template <int N, class Fx>
class TorsionSolver {
  using Effects = typename Fx::template On<N>;
  static constexpr int contacts = Contacts<N>::count;
  using Vec = VecN<contacts>;
  using ByFriction = typename TorsionDerivatives<N>::ByFriction;

public:
  /// @param equilibrium  equilibrium(effects): the model with these effects, its equilibrium left in ws; or null if none
  /// @param effects_at   effects_at(torsion): the effects after the motion to this sample, if this is the torsion there
  /// @param torsion      in: a guess; out: the solution [rad], unchanged without an equilibrium
  /// @param most         equilibria that are tried
  /// @return the effects at the solution. Real time: as equilibrium and effects_at.
  Effects solve(const auto& equilibrium, const auto& effects_at, const Workspace<N>& ws, RelativeTorsion<N>& torsion,
                int most) noexcept {
    if constexpr (contacts == 0)
      return effects_at(torsion);
    else
      return iterate(equilibrium, effects_at, ws, torsion, most);
  }

  /// Takes the derivative of the torsion by friction, computed at a sample close to the next one.
  void set_derivative(const ByFriction& by_friction) noexcept {
    by_friction_ = by_friction;
    weight_ = by_friction_.colwise().squaredNorm().transpose();
  }

  /// Whether the last equilibrium that was asked for is that of the solution, so that ws holds it.
  [[nodiscard]] bool equilibrium_is_current() const noexcept { return equilibrium_is_current_; }

private:
  struct Iterate {
    RelativeTorsion<N> torsion{};
    Effects effects;             ///< with the friction of this torsion
    Vec residual = Vec::Zero();  ///< torsion of the equilibrium with these effects, minus this torsion
  };

  Effects iterate(const auto& equilibrium, const auto& effects_at, const Workspace<N>& ws, RelativeTorsion<N>& torsion,
                  int most) noexcept {
    constexpr double tolerance = 1e-4;  // [rad]
    const auto evaluate = [&](Iterate& at) {
      const Model<N, Fx>* model = equilibrium(at.effects);
      if (model == nullptr) return false;
      at.residual = as_vector(relative_torsion(*model, ws, at.torsion)) - as_vector(at.torsion);
      return true;
    };
    Iterate best;
    Vec step = Vec::Zero();
    double fraction = 1;  // of the step
    bool derivative_is_new = false;
    for (int k = 0; k < most; ++k) {
      Iterate here{torsion, effects_at(torsion), Vec::Zero()};
      const bool found = equilibrium_is_current_ = evaluate(here);
      if (!found && k == 0) return here.effects;
      if (found && k > 0) update_derivative(best, here);
      const bool worse = k > 0 && !(found && here.residual.norm() <= best.residual.norm());
      if (worse)
        equilibrium_is_current_ = false;
      else
        best = here;
      if (best.residual.norm() < tolerance) break;
      if (worse && derivative_is_new) {
        fraction *= 0.5;
      } else {
        if (worse) {
          if (const Model<N, Fx>* model = equilibrium(best.effects))
            set_derivative(torsion_derivatives(*model, ws).by_friction);
          derivative_is_new = true;
        }
        step = newton_step(best, effects_at);
        fraction = 1;
      }
      as_vector(torsion) = as_vector(best.torsion) + fraction * step;
    }
    torsion = best.torsion;
    return best.effects;
  }

  static auto as_vector(RelativeTorsion<N>& torsion) noexcept { return Vec::Map(torsion.data()); }
  static auto as_vector(const RelativeTorsion<N>& torsion) noexcept { return Vec::Map(torsion.data()); }

  /// Friction at each contact.
  static Vec friction(const Effects& effects) noexcept {
    return Vec::Map(std::get<TorsionEffect<Fx, N>>(effects.list).history.state.data());
  }

  /// Broyden's update by what a change of friction did to the torsion. It is attributed to the contacts that can have done
  /// it: where tubes hardly press on each other, friction changes most and has no effect.
  void update_derivative(const Iterate& from, const Iterate& to) noexcept {
    const Vec change = friction(to.effects) - friction(from.effects);
    const Vec weighted = weight_.cwiseProduct(change);
    if (!(weighted.dot(change) > 1e-16)) return;
    const Vec turned = as_vector(to.torsion) + to.residual - as_vector(from.torsion) - from.residual;
    by_friction_ += (turned - by_friction_ * change) * weighted.transpose() / weighted.dot(change);
  }

  Vec newton_step(const Iterate& at, const auto& effects_at) const noexcept {
    constexpr double small = 1e-6;  // [rad]
    RelativeTorsion<N> moved = at.torsion;
    as_vector(moved).array() += small;  // friction at a contact follows the torsion there alone
    const Vec by_torsion = (friction(effects_at(moved)) - friction(at.effects)) / small;
    const ByFriction jacobian = ByFriction::Identity() - by_friction_ * by_torsion.asDiagonal();
    return solved(jacobian, Vec(at.residual));
  }

  bool equilibrium_is_current_ = false;
  Vec weight_ = Vec::Ones();
  ByFriction by_friction_ = ByFriction::Zero();
};

}  // namespace ctcr
