#pragma once
#include "ctcr/effects/hooks.hpp"

namespace ctcr {
namespace delay {
inline constexpr EffectInfo info{
    .id = "delay",
    .title = "Time delay between joints and tracker",
    .physics = "The tracker filters and transmits: a pose belongs to joints of a while ago. A run begins at rest.",
    .signature =
        "The error is the velocity of the tip times the delay: it grows with speed, reverses with direction and "
        "vanishes at rest.",
    .measure = "Move along the same path at two speeds, or stop before each reading.",
    .look_alikes = "backlash_rotation friction",
    .reference = "Furgale, Rehder & Siegwart 2013",
    .needs = {.order = true, .time = true},
    .starts = {{{"spread", 0.5}}},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "delay",
                    .unit = "s",
                    .neutral = 0,
                    .sigma = 0.05,
                    .soft = {0, 0.3},
                    .hard = {-0.05, 1},
                    .quantity = Quantity::lag,
                    .meaning = "by which poses are late"},
    EffectParameter{.name = "spread",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.3,
                    .soft = {0, 1},
                    .hard = {0, 1},
                    .role = Role::detail,
                    .meaning = "share of the delay: standard deviation of the moments over which the tracker averages"},
};
}  // namespace delay

/// A reading shows the pose of joints `delay` ago. Where the tracker averages, the joints are the mean of those delay (1 -
/// spread) and delay (1 + spread) ago, which agrees with any filter to second order. Before its first row a run is at rest.
template <int N, class P = double>
struct Delay : EffectValues<delay::parameters, N, P, 2 * N> {
  static constexpr const EffectInfo& info = delay::info;

  /// Internal state: joints then minus joints now, beta and alpha of each tube.
  void update_history(const Path<N, P>& path, std::size_t row) noexcept {
    auto& state = this->history.state;
    for (auto& x : state) x = 0.0;
    const std::size_t first = path.first.empty() ? 0 : path.first[row];
    if (path.time.empty() || row <= first || !(path.time[row - 1] < path.time[row])) return;
    const P &delay = this->template get<0>(), apart = delay * this->template get<1>();
    const double now = path.time[row];
    const auto add_half = [&](const P& late) {
      const double then = now - value(late);
      std::size_t k = row;  // `then` lies between rows k - 1 and k, or before the first known row
      while (k > first + 1 && path.time[k - 1] > then && path.time[k - 2] < path.time[k - 1]) --k;
      const bool at_rest = !path.first.empty() && then < path.time[first];
      const P part = at_rest ? P(1.0) : (path.time[k] - now + late) * (1 / (path.time[k] - path.time[k - 1]));
      const auto &a = path.q[k], &b = path.q[k - 1], &here = path.q[row];
      for (std::size_t i = 0; i < N; ++i) {
        state[i] = state[i] + 0.5 * ((a.beta[i] - here.beta[i]) + part * (b.beta[i] - a.beta[i]));
        state[N + i] = state[N + i] + 0.5 * ((a.alpha[i] - here.alpha[i]) + part * (b.alpha[i] - a.alpha[i]));
      }
    };
    add_half(delay - apart);
    add_half(delay + apart);
  }

  void actuate(const Occasion&, std::array<P, N>& beta, std::array<P, N>& alpha) const noexcept {
    for (std::size_t i = 0; i < N; ++i) {
      beta[i] = beta[i] + this->history.state[i];
      alpha[i] = alpha[i] + this->history.state[N + i];
    }
  }
};

}  // namespace ctcr
