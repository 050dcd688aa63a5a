#pragma once
// A system's effects while it moves: what the past left behind in them, period after period.
#include <array>

#include "ctcr/pipeline/recorded.hpp"

namespace ctcr {

/// Follows the motion of a robot with effects. Effects that look back in time see the last `window` periods.
template <int N, class Fx>
class LiveEffects {
public:
  static constexpr std::size_t window = 64;
  using Effects = typename Fx::template On<N>;

  explicit LiveEffects(const Effects& effects) noexcept : effects_(effects) {}

  /// Takes the next joints of the motors, and their time [s]; returns the joints that the tubes have.
  /// @param before  the equilibrium of the period before; none: tubes count as stiff in torsion
  /// Real time: yes.
  Joints<N> advance(const Joints<N>& motors, double time, const Workspace<N>& before = {}) noexcept {
    if (count_ == window) {
      std::copy(rows_.begin() + 1, rows_.end(), rows_.begin());
      std::copy(times_.begin() + 1, times_.end(), times_.begin());
      --count_;
    }
    for (std::size_t i = 0; i < N; ++i) {
      rows_[count_].beta[i] = motors.beta[Eigen::Index(i)];
      rows_[count_].alpha[i] = motors.alpha[Eigen::Index(i)];
    }
    if constexpr (Effects::follows_twist) {
      twist_ = twist_between(before, twist_);
      if (before.warm && !knows_twist_)
        for (std::size_t k = 0; k < count_; ++k) rows_[k].twist = twist_;
      knows_twist_ = knows_twist_ || before.warm;
      rows_[count_].twist = twist_;
    }
    times_[count_] = time;
    at_.time = time;
    const std::size_t row = count_++;
    effects_.remember({{rows_.data(), count_}, {times_.data(), count_}}, row);
    auto [beta, alpha, twist] = rows_[row];
    effects_.actuate(at_, beta, alpha);
    return {Eigen::Map<const VecN<N>>(beta.data()), Eigen::Map<const VecN<N>>(alpha.data())};
  }

  /// With the past of now.
  [[nodiscard]] const Effects& effects() const noexcept { return effects_; }
  [[nodiscard]] const Occasion& occasion() const noexcept { return at_; }

private:
  Effects effects_;
  std::array<typename Path<N, double>::Row, window> rows_{};
  std::array<double, window> times_{};
  std::size_t count_ = 0;
  std::array<double, N> twist_{};
  bool knows_twist_ = false;
  Occasion at_;
};

}  // namespace ctcr
