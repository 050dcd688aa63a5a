#pragma once
// The internal state of a system's effects while the robot moves, updated period after period.
#include <array>

#include "ctcr/friction/torsion_solver.hpp"

namespace ctcr {

/// Follows the motion of a robot with effects. Effects that look back in time see the last `window` periods. Joints that the
/// model refuses (check_joints(): NaN, out of order, behind the plate) leave no trace: the robot never was there.
template <int N, class Fx>
class LiveEffects {
public:
  static constexpr std::size_t window = 64;
  using Effects = typename Fx::template On<N>;

  explicit LiveEffects(const Model<N, Fx>& model) noexcept
    : effects_(model.effects()), robot_(model.robot()), radius_(model.robot()) {}

  /// Takes the next joints of the motors, and their time [s]; returns the joints that the tubes have, or would have.
  /// @param equilibrium  equilibrium(effects, joints of the tubes): the model with these effects, its equilibrium left in
  ///                     ws; or null if none
  /// Real time: as `equilibrium`, which is called at most 9 times.
  Joints<N> advance(const Joints<N>& motors, double time, const Workspace<N>& ws, const auto& equilibrium) noexcept {
    at_.time = time;
    constexpr double displaced = 10e-3;  // [m]: effects set the joints of motors and tubes apart by less
    if (check_joints(robot_, motors, displaced) != Status::ok) return motors;
    const std::size_t row = add(motors, time);
    const auto effects_at = [&](const RelativeTorsion<N>& torsion) {
      Effects now = effects_;
      rows_[row].torsion = torsion;
      now.update_history(
          {{rows_.data(), count_}, {times_.data(), count_}, {start.data(), forgot_ ? 0 : count_}, radius_}, row);
      return now;
    };
    const auto moved = [&]() -> Effects {
      if constexpr (Effects::depends_on_torsion) {
        if (effects_.act_by_torsion()) {
          const Model<N, Fx>* last = nullptr;
          const auto found = [&](const Effects& with) { return last = equilibrium(with, tubes(with, motors)); };
          rows_[row].jumps = jumps_;  // of the period before: they change slowly
          const Effects now = torsion_solver_.solve(found, effects_at, ws, torsion_, most);
          if (last) jumps_ = moment_jumps(*last, ws, jumps_);
          rows_[row].torsion = torsion_;
          return now;
        }
      }
      return effects_at(torsion_);
    };
    const Effects now = moved();
    const Joints<N> q = tubes(now, motors);
    if (check_joints(robot_, q) == Status::ok) {
      effects_ = now;
      make_room();
    } else {
      --count_;
    }
    return q;
  }

  /// The same for tubes that are stiff in torsion. Real time: yes.
  Joints<N> advance(const Joints<N>& motors, double time) noexcept {
    return advance(motors, time, {}, [](const Effects&, const Joints<N>&) -> const Model<N, Fx>* { return nullptr; });
  }

  /// The effects with their present internal state.
  [[nodiscard]] const Effects& effects() const noexcept { return effects_; }
  [[nodiscard]] const Occasion& occasion() const noexcept { return at_; }

private:
  static constexpr int most = 8;                             // equilibria of a period
  static constexpr std::array<std::size_t, window> start{};  // where the run of each period begins: at the first one

  void make_room() noexcept {
    if (count_ < window) return;
    forgot_ = true;
    std::copy(rows_.begin() + 1, rows_.end(), rows_.begin());
    std::copy(times_.begin() + 1, times_.end(), times_.begin());
    --count_;
  }

  std::size_t add(const Joints<N>& motors, double time) noexcept {
    for (std::size_t i = 0; i < N; ++i) {
      rows_[count_].beta[i] = motors.beta[Eigen::Index(i)];
      rows_[count_].alpha[i] = motors.alpha[Eigen::Index(i)];
    }
    times_[count_] = time;
    return count_++;
  }

  Joints<N> tubes(const Effects& effects, const Joints<N>& motors) const noexcept {
    std::array<double, N> beta, alpha;
    VecN<N>::Map(beta.data()) = motors.beta;
    VecN<N>::Map(alpha.data()) = motors.alpha;
    effects.actuate(at_, beta, alpha);
    return {VecN<N>::Map(beta.data()), VecN<N>::Map(alpha.data())};
  }

  Effects effects_;
  Robot<N> robot_;
  ContactRadii<N> radius_;
  std::array<typename Path<N, double>::Row, window> rows_{};
  std::array<double, window> times_{};
  std::size_t count_ = 0;
  bool forgot_ = false;  // the first period
  RelativeTorsion<N> torsion_{};
  MomentJumps<N> jumps_;
  TorsionSolver<N, Fx> torsion_solver_;
  Occasion at_;
};

}  // namespace ctcr
