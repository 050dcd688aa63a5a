#pragma once
// Arc lengths at which tubes end and start to curve; they divide the robot into segments.
#include <array>

#include "ctcr/mechanics/coefficients.hpp"
#include "ctcr/robot/joints.hpp"

namespace ctcr {

/// The 2N events of a configuration in the order met from the robot tip to its base. At equal arc lengths tips come before
/// curved starts and inner tubes before outer ones, so each event changes one tube and no segment is negative.
template <int N>
struct Events {
  std::array<double, 2 * N> s{};  ///< arc length from the front plate [m], descending
  std::array<int, 2 * N> id{};  ///< i < N: tube i ends here (appears); N + i: its curved part starts (becomes straight)
};

/// Real time: yes (sorting by rank, no branch).
template <int N, class P>
CTCR_INLINE Events<N> sort_events(const Coefficients<N, P>& c, const VecN<N>& beta) noexcept {
  double s[2 * N];
  int rank[2 * N] = {};
  for (std::size_t i = 0; i < N; ++i) {
    const double b = beta[Eigen::Index(i)];
    s[i] = value(c.length[i]) + b;
    if (i > 0) s[i] = s[i] < s[i - 1] ? s[i] : s[i - 1];  // recorded joints may break the order by their rounding
    s[N + i] = c.curved[i] ? value(c.curve_start[i]) + b : -1.0;
    rank[i] = int(i);
  }
  for (int i = 0; i < 2 * N; ++i)
    for (int j = i < N ? N : i + 1; j < 2 * N; ++j) {
      const int later = s[j] > s[i];
      rank[i] += later;
      rank[j] += 1 - later;
    }
  Events<N> events;
  for (int i = 0; i < 2 * N; ++i) {
    events.s[std::size_t(rank[i])] = s[i];
    events.id[std::size_t(rank[i])] = i;
  }
  return events;
}

}  // namespace ctcr
