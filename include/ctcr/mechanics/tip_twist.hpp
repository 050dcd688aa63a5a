#pragma once
#include "ctcr/math/functions.hpp"
#include "ctcr/mechanics/solution.hpp"

namespace ctcr {

/// By how much more each tube is turned against the next outer one at their tips than at their bases, in equilibrium;
/// 0 for the outermost. Tubes rub by their motion at the tips.
/// @param ws    as solve() left it, else `last` is returned
/// @param last  of the configuration before; this one differs from it by less than half a turn
/// @return [rad]   Real time: yes.
template <int N>
[[nodiscard]] std::array<double, std::size_t(N)> twist_between(const Workspace<N>& ws,
                                                               std::array<double, std::size_t(N)> last) noexcept {
  if (!ws.warm) return last;
  const VecN<N>&at_tip = ws.guess.psi, &at_base = ws.q.alpha;
  for (int i = 0; i + 1 < N; ++i) {
    double& twist = last[std::size_t(i)];
    twist += wrapped(at_tip[i] - at_tip[i + 1] - (at_base[i] - at_base[i + 1]) - twist);
  }
  return last;
}

}  // namespace ctcr
