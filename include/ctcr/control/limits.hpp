#pragma once
// What no step may violate: order of the tubes, travel and speed of the joints.
#include <algorithm>
#include <cstdint>
#include <limits>

#include "ctcr/control/control_state.hpp"

namespace ctcr {

template <int N>
struct Limits {
  double base_gap = 2e-3;  ///< least distance between neighbouring bases, and from the last to the front plate [m]
  double tip_gap = 2e-3;   ///< the same of the tips [m]
  double translation_speed = 0.1;                                                  ///< [m/s]
  double rotation_speed = 10;                                                      ///< [rad/s]
  VecN<N> beta_low = VecN<N>::Constant(-std::numeric_limits<double>::infinity());  ///< travel of the stages [m]
  VecN<N> beta_high = VecN<N>::Constant(std::numeric_limits<double>::infinity());
};

/// Whether these are limits: distances finite and >= 0, speeds >= 0, no travel NaN.
/// @return ok or invalid_settings; whether they allow any positions, AllowedPositions::exist() says. Real time: yes.
template <int N>
[[nodiscard]] Status check_limits(const Limits<N>& limits) noexcept {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const auto is_gap = [](double gap) { return gap >= 0 && gap < infinity; };
  const bool possible = is_gap(limits.base_gap) && is_gap(limits.tip_gap) && limits.translation_speed >= 0 &&
                        limits.rotation_speed >= 0 && (limits.beta_low.array() < infinity).all() &&
                        (limits.beta_high.array() > -infinity).all();
  return possible ? Status::ok : Status::invalid_settings;
}

/// Which limits a step was held at: bit i stands for tube i, from 0.
struct LimitReport {
  std::uint16_t base_gaps = 0;  ///< the grasped end of tube i against that of tube i + 1, or the front plate
  std::uint16_t tip_gaps = 0;   ///< the tips
  std::uint16_t travel = 0;
  bool speed = false;

  [[nodiscard]] bool any() const noexcept { return base_gaps || tip_gaps || travel || speed; }
};

/// The positions that limits allow, as intervals of beta_i and of beta_i - beta_i+1 (for the last tube, beta itself).
/// check_limits() says ok.
template <int N>
class AllowedPositions {
public:
  AllowedPositions(const Robot<N>& robot, const Limits<N>& limits) noexcept {
    for (int i = 0; i < N; ++i) {
      const auto length = [&](int k) { return k < N ? robot.tubes[std::size_t(k)].length : 0.0; };
      apart_high_[i] = -limits.base_gap;
      apart_low_[i] = limits.tip_gap - (length(i) - length(i + 1));
      low_[i] = limits.beta_low[i];
      high_[i] = limits.beta_high[i];
      if (i == 0) continue;
      // Room for the inner tubes: some beta_i-1 is allowed beside every beta_i.
      low_[i] = std::max(low_[i], low_[i - 1] - apart_high_[i - 1]);
      high_[i] = std::min(high_[i], high_[i - 1] - apart_low_[i - 1]);
    }
  }

  /// Whether any positions are allowed.
  [[nodiscard]] bool exist() const noexcept {
    bool all = (apart_low_.array() <= apart_high_.array()).all() && (low_.array() <= high_.array()).all();
    return all && std::max(low_[N - 1], apart_low_[N - 1]) <= std::min(high_[N - 1], apart_high_[N - 1]);
  }

  /// Whether these are, but for rounding.
  [[nodiscard]] bool contain(const VecN<N>& beta, double slack = 1e-9) const noexcept {
    return (clamped(beta) - beta).cwiseAbs().maxCoeff() <= slack;
  }

  /// Interval [low, high] of beta_i beside beta_i+1 `next` (for the last tube: 0).
  [[nodiscard]] std::pair<double, double> interval(int i, double next) const noexcept {
    return {std::max(low_[i], next + apart_low_[i]), std::min(high_[i], next + apart_high_[i])};
  }

  /// The allowed positions next to `beta`, outermost tube first. From allowed positions no joint is moved farther than
  /// the fastest one wanted to: clamping keeps to speed limits.
  [[nodiscard]] VecN<N> clamped(VecN<N> beta, LimitReport* report = nullptr) const noexcept {
    constexpr double rounding = 1e-12;
    double next = 0;
    for (int i = N - 1; i >= 0; --i) {
      const auto [low, high] = interval(i, next);
      const double x = std::max(low, std::min(beta[i], high));
      if (report && std::abs(x - beta[i]) > rounding) note(i, x, next, *report);
      next = beta[i] = x;
    }
    return beta;
  }

private:
  void note(int i, double beta, double next, LimitReport& report) const noexcept {
    const auto bit = std::uint16_t(1u << unsigned(i));
    constexpr double near = 1e-9;
    if (std::abs(beta - next - apart_high_[i]) < near)
      report.base_gaps |= bit;
    else if (std::abs(beta - next - apart_low_[i]) < near)
      report.tip_gaps |= bit;
    else
      report.travel |= bit;
  }

  VecN<N> apart_low_, apart_high_, low_, high_;
};

/// How a step meets a limit.
enum class AtLimits : std::uint8_t {
  hold,         ///< the joint stays there, the others move as planned (the paper's scheme)
  redistribute  ///< and the others take over its part: the goals are solved anew with that joint held
};

/// The minimum of the goals that keeps the limits over one period.
/// @param limits    check_limits() says ok
/// @param beta      positions now [m]; where they are not allowed, the step leads back to allowed ones, within the speed
/// @param velocity  q'; 0 where there is no minimum
/// @return as LeastSquares::minimum(). Real time: yes, at most N + 1 minima.
template <int N>
Status limited_minimum(LeastSquares<N> goals, const AllowedPositions<N>& allowed, const Limits<N>& limits,
                       const VecN<N>& beta, double period, AtLimits at_limits, JointVelocity<N>& velocity,
                       LimitReport& report) noexcept {
  Status status = goals.minimum(velocity);
  const double heavy = 1e6 * goals.largest_weight();
  for (int round = 0; round < N && at_limits == AtLimits::redistribute && status == Status::ok; ++round) {
    const VecN<N> planned = beta + period * velocity.template head<N>();
    const VecN<N> kept = allowed.clamped(planned);
    int tube = -1;  // the one that goes farthest beyond
    double beyond = 1e-9;
    for (int i = 0; i < N; ++i)
      if (const double d = std::abs(kept[i] - planned[i]); d > beyond) beyond = d, tube = i;
    if (tube < 0) break;
    JointVelocity<N> direction = JointVelocity<N>::Unit(tube);
    double wanted = (kept[tube] - beta[tube]) / period;
    LimitReport which;
    (void)allowed.clamped(planned, &which);
    if (tube + 1 < N && !(which.travel >> tube & 1)) {  // a gap: only the difference to the next tube is bound
      direction[tube + 1] = -1;
      wanted -= (kept[tube + 1] - beta[tube + 1]) / period;
    }
    goals.add_scalar_goal(direction, wanted, heavy);
    report.base_gaps |= which.base_gaps;
    report.tip_gaps |= which.tip_gaps;
    report.travel |= which.travel;
    status = goals.minimum(velocity);
  }
  if (status != Status::ok) return status;
  // Where a limit is 0 or -0, no speed is left; 0 / 0 is none that is too high.
  const auto part = [](const VecN<N>& v, double limit) { return std::min(1.0, limit / v.cwiseAbs().maxCoeff()); };
  const double kept = std::min(part(velocity.template head<N>(), limits.translation_speed),
                               part(velocity.template tail<N>(), limits.rotation_speed));
  if (kept < 1) {
    velocity *= kept;
    report.speed = true;
  }
  const VecN<N> planned = beta + period * velocity.template head<N>();
  velocity.template head<N>() = (allowed.clamped(planned, &report) - beta) / period;
  // From outside the allowed positions the way back takes several periods.
  const double back = part(velocity.template head<N>(), limits.translation_speed);
  if (back < 1 - 1e-9) {
    velocity.template head<N>() *= back;
    report.speed = true;
  }
  return Status::ok;
}

}  // namespace ctcr
