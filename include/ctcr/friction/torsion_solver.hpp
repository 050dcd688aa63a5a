#pragma once
// Tubes that rub wind each other up: what they rub depends on how they turn where they touch, and that on what they rub.
#include <Eigen/LU>
#include <utility>

#include "ctcr/friction/relative_torsion.hpp"

namespace ctcr {

/// Finds the twist_of() the robot with what is rubbed on the way to it, by Newton's method. The law of rubbing may be
/// stiff: its slope is taken where it is. What the equilibrium makes of the rubbing is smooth: its slope is that of a place
/// before, corrected by what is seen of it (Broyden), and taken anew where that does not lead on. Rubbing by the twist of
/// the place before instead would overshoot by more than it corrects, and change sides at every place.
template <int N, class Fx>
class TwistBalance {
  using Effects = typename Fx::template On<N>;
  static constexpr int contacts = Contacts<N>::count;
  using Vec = VecN<contacts>;

public:
  /// @param equilibrium  equilibrium(effects): the model with these effects, its equilibrium left in ws; or null if none
  /// @param remembered   remembered(twist): the effects after the motion to this place, if the twist there is that
  /// @param steps        of integration, per segment
  /// @param twist        in: a guess; out: the solution [rad], unchanged without an equilibrium
  /// @param most         equilibria that are tried
  /// @return the effects at the solution. Real time: as equilibrium and remembered.
  Effects solve(const auto& equilibrium, const auto& remembered, const Workspace<N>& ws, int steps, Twist<N>& twist,
                int most) noexcept {
    if constexpr (contacts == 0)
      return remembered(twist);
    else
      return balanced(equilibrium, remembered, ws, steps, twist, most);
  }

  /// Takes slopes of the twist by what is rubbed, at a place like the next one.
  void take(const Eigen::Matrix<double, contacts, contacts>& by_rubbing) noexcept {
    by_rubbing_ = by_rubbing;
    weight_ = by_rubbing_.colwise().squaredNorm().transpose();
  }

  /// Whether the equilibrium that was asked for last is that of the solution, so that ws holds it.
  [[nodiscard]] bool left_there() const noexcept { return left_there_; }

private:
  Effects balanced(const auto& equilibrium, const auto& remembered, const Workspace<N>& ws, int steps, Twist<N>& twist,
                   int most) noexcept {
    constexpr double tolerance = 1e-4;  // [rad]
    const auto find = [&](Point& at) {
      const Model<N, Fx>* model = equilibrium(at.effects);
      if (model == nullptr) return false;
      at.left = as_vector(twist_of(*model, ws, steps, at.twist)) - as_vector(at.twist);
      return true;
    };
    Point best;
    Vec step = Vec::Zero();
    double part = 1;       // of the step
    bool renewed = false;  // the slopes
    for (int k = 0; k < most; ++k) {
      Point here{twist, remembered(twist), Vec::Zero()};
      const bool found = left_there_ = find(here);
      if (!found && k == 0) return here.effects;
      if (found && k > 0) learn(best, here);
      const bool worse = k > 0 && !(found && here.left.norm() <= best.left.norm());
      if (worse)
        left_there_ = false;
      else
        best = here;
      if (best.left.norm() < tolerance) break;
      if (worse && renewed) {
        part *= 0.5;
      } else {
        if (worse) {
          if (const Model<N, Fx>* model = equilibrium(best.effects)) take(twist_slopes(*model, ws, steps).by_rubbing);
          renewed = true;
        }
        step = newton_step(best, remembered);
        part = 1;
      }
      as_vector(twist) = as_vector(best.twist) + part * step;
    }
    twist = best.twist;
    return best.effects;
  }

  struct Point {
    Twist<N> twist{};        ///< with which rubbing is reckoned
    Effects effects;         ///< so
    Vec left = Vec::Zero();  ///< what the equilibrium's twist differs from it
  };

  static Eigen::Map<Vec> as_vector(Twist<N>& twist) noexcept { return Eigen::Map<Vec>(twist.data()); }
  static Eigen::Map<const Vec> as_vector(const Twist<N>& twist) noexcept { return Eigen::Map<const Vec>(twist.data()); }

  /// What is rubbed.
  static Vec rubbing(const Effects& effects) noexcept {
    return Vec::Map(std::get<Effects::follower>(effects.list).history.state.data());
  }

  /// What a change of the rubbing did to the equilibrium's twist, by the contacts that may have done it: where tubes hardly
  /// press on each other, what is rubbed changes most, and does nothing.
  void learn(const Point& from, const Point& to) noexcept {
    const Vec change = rubbing(to.effects) - rubbing(from.effects);
    const Vec blamed = weight_.cwiseProduct(change);
    if (!(blamed.dot(change) > 1e-16)) return;
    const Vec turned = as_vector(to.twist) + to.left - as_vector(from.twist) - from.left;
    by_rubbing_ += (turned - by_rubbing_ * change) * blamed.transpose() / blamed.dot(change);
  }

  Vec newton_step(const Point& at, const auto& remembered) const noexcept {
    constexpr double small = 1e-6;  // [rad]
    Twist<N> moved = at.twist;
    as_vector(moved).array() += small;  // what is rubbed at a contact follows the twist there alone
    const Vec law = (rubbing(remembered(moved)) - rubbing(at.effects)) / small;
    const Eigen::Matrix<double, contacts, contacts> slope =
        Eigen::Matrix<double, contacts, contacts>::Identity() - by_rubbing_ * law.asDiagonal();
    return slope.partialPivLu().solve(at.left);
  }

  bool left_there_ = false;
  Vec weight_ = Vec::Ones();
  Eigen::Matrix<double, contacts, contacts> by_rubbing_ = Eigen::Matrix<double, contacts, contacts>::Zero();
};

}  // namespace ctcr
