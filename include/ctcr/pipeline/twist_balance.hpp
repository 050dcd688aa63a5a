#pragma once
// Tubes that rub wind each other up: what they rub depends on how they turn at their tips, and that on what they rub.
#include <Eigen/LU>
#include <utility>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/mechanics/tip_twist.hpp"

namespace ctcr {

/// Finds the twist_between() with what is rubbed on the way to it, by Newton's method. The law of rubbing may be stiff: its
/// slope is taken where it is. What the equilibrium makes of the rubbing is smooth: its slope is learnt, from place to
/// place (Broyden). Rubbing by the twist of the place before instead would overshoot by more than it corrects, and change
/// sides at every place.
template <int N, class Fx>
class TwistBalance {
  using Effects = typename Fx::template On<N>;
  using Vec = VecN<N>;

  static constexpr int states = []<class... E>(std::type_identity<std::tuple<E...>>) {
    [[maybe_unused]] const auto size = []<class One>(std::type_identity<One>) {
      return requires { One::follows_twist; } ? int(typename One::Past{}.state.size()) : 0;
    };
    return (0 + ... + size(std::type_identity<E>{}));
  }(std::type_identity<decltype(Effects::list)>{});

public:
  /// @param equilibrium  equilibrium(effects) -> bool: whether the robot with these effects has one, left in ws
  /// @param remembered   remembered(twist): the effects after the motion to this place, if the twist there is that
  /// @param twist        in: a guess; out: the solution [rad], unchanged without an equilibrium
  /// @param most         equilibria that are tried, besides one a state where that does not lead on
  /// @return the effects at the solution. Real time: as equilibrium and remembered.
  Effects solve(const auto& equilibrium, const auto& remembered, const Workspace<N>& ws, Vec& twist,
                int most) noexcept {
    constexpr double tolerance = 1e-4;  // [rad]
    const auto find = [&](Point& at) {
      if (!equilibrium(at.effects)) return false;
      std::array<double, N> found;
      Vec::Map(found.data()) = at.twist;
      found = twist_between(ws, found);
      at.left = Vec::Map(found.data()) - at.twist;
      return true;
    };
    Point best;
    Vec step = Vec::Zero();
    double part = 1;  // of the step
    bool measured = false;
    for (int k = 0; k < most; ++k) {
      Point here{twist, remembered(twist), Vec::Zero()};
      const bool found = find(here);
      if (!found && k == 0) return here.effects;
      if (found && k > 0) learn(best, here);
      const bool worse = k > 0 && !(found && here.left.norm() <= best.left.norm());
      if (!worse) best = here;
      if (best.left.norm() < tolerance) break;
      if (worse && measured) {
        part *= 0.5;
      } else {
        if (worse) measure(find, best);
        measured = measured || worse;
        step = newton_step(best, remembered);
        part = 1;
      }
      twist = best.twist + part * step;
    }
    twist = best.twist;
    return best.effects;
  }

private:
  using Rubbing = Eigen::Matrix<double, states, 1>;

  struct Point {
    Vec twist = Vec::Zero();  ///< with which rubbing is reckoned
    Effects effects;          ///< so
    Vec left = Vec::Zero();   ///< what the equilibrium's twist differs from it
  };

  /// Calls f(state, number) for each that follows the twist.
  static void for_each_state(auto& effects, const auto& f) noexcept {
    Eigen::Index k = 0;
    effects.for_each([&](auto& e, int) {
      if constexpr (requires { e.follows_twist; })
        for (auto& state : e.past.state) f(state, k++);
    });
  }

  /// What is rubbed.
  static Rubbing rubbing(const Effects& effects) noexcept {
    Rubbing all;
    for_each_state(effects, [&](double state, Eigen::Index k) { all[k] = state; });
    return all;
  }

  /// What a change of the rubbing did to the equilibrium's twist.
  void learn(const Point& from, const Point& to) noexcept {
    const Rubbing change = rubbing(to.effects) - rubbing(from.effects);
    if (!(change.squaredNorm() > 1e-16)) return;
    const Vec turned = to.twist + to.left - from.twist - from.left;
    by_rubbing_ += (turned - by_rubbing_ * change) * change.transpose() / change.squaredNorm();
  }

  /// The same for each state on its own.
  void measure(const auto& find, const Point& at) noexcept {
    constexpr double change = 0.02;
    Point moved = at;
    for_each_state(moved.effects, [&](double& state, Eigen::Index column) {
      const double kept = std::exchange(state, state + (state > 0 ? -change : change));
      if (find(moved)) by_rubbing_.col(column) = (moved.left - at.left) / (state - kept);
      state = kept;
    });
  }

  Vec newton_step(const Point& at, const auto& remembered) const noexcept {
    constexpr double small = 1e-6;  // [rad]
    Eigen::Matrix<double, states, N> law;
    for (int i = 0; i < N; ++i)
      law.col(i) = (rubbing(remembered(at.twist + small * Vec::Unit(i))) - rubbing(at.effects)) / small;
    const Eigen::Matrix<double, N, N> slope = Eigen::Matrix<double, N, N>::Identity() - by_rubbing_ * law;
    return slope.partialPivLu().solve(at.left);
  }

  Eigen::Matrix<double, N, states> by_rubbing_ = Eigen::Matrix<double, N, states>::Zero();
};

}  // namespace ctcr
