#pragma once
#include <algorithm>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/dual.hpp"

namespace ctcr {
namespace creep {
inline constexpr EffectInfo info{
    .id = "creep",
    .title = "Creep of the precurvature",
    .physics =
        "Polymer tubes that others hold straight lose curvature; stored straight, they regain it during the session.",
    .signature = "The error grows with time, fast at first, and only where curved parts are deployed.",
    .measure = "Return to the same joints every 20 readings, with much and with little of each curved part deployed.",
    .look_alikes = "frame_drift",
    .reference = "Findley, Lai & Onaran 1976; polymer tubes: Morimoto & Okamura 2016",
    .needs = {.order = true, .time = true},
    .starts = {{{"half_time", 30.0}}, {{"half_time", 3000.0}}},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "loss",
                    .neutral = 0,
                    .sigma = 0.02,
                    .soft = {-0.2, 0.2},
                    .hard = {-1, 0.9},
                    .per_tube = true,
                    .meaning = "part of the curvature of the first row that is lost at last"},
    EffectParameter{.name = "half_time",
                    .unit = "s",
                    .neutral = 300,
                    .sigma = 300,
                    .soft = {10, 1e4},
                    .hard = {1, 1e6},
                    .role = Role::shape,
                    .meaning = "after which half of it is lost"},
};
}  // namespace creep

/// kappa (1 - loss t / (t + half_time)), t the time since the first row. Where a clock starts anew the time between is
/// unknown and counts as none.
template <int N, class P = double>
struct Creep : EffectValues<creep::parameters, N, P, 2> {
  static constexpr const EffectInfo& info = creep::info;

  /// Internal state: t [s], and t / (t + half_time).
  void update_history(const Path<N, P>& path, std::size_t row) noexcept {
    auto& [elapsed, part] = this->history.state;
    if (row > 0 && !path.time.empty()) elapsed = elapsed + std::max(0.0, path.time[row] - path.time[row - 1]);
    part = elapsed * inverse(P(elapsed + this->template get<1>()));
  }

  void material(const TubePoint<P>& at, Material<P>& m) const noexcept {
    const P left = 1.0 - this->template get<0>(at.tube) * this->history.state[1];
    for (P& x : m.curvature) x = left * x;
  }
};

}  // namespace ctcr
