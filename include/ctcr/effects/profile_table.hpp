#pragma once
// Precurvature and stiffness along the tubes as tables of run time, for effects that are not compiled in.
#include <algorithm>
#include <vector>

#include "ctcr/effects/hooks.hpp"

namespace ctcr {

/// Differences from the data sheet at one arc length of a tube.
struct ProfileNode {
  std::array<double, 2> curvature{};  ///< of the free tube about its x and y axes, added [1/m]
  double stiffness = 0;               ///< relative change of EI
};

/// One table a tube: nodes at equal distances from the grasped point (0) to `length`, linear between them.
template <int N>
struct Profiles {
  std::array<std::vector<ProfileNode>, N> nodes;  ///< empty, or at least two
  std::array<double, N> length{};                 ///< [m]

  [[nodiscard]] bool empty() const noexcept {
    return std::all_of(nodes.begin(), nodes.end(), [](const auto& tube) { return tube.size() < 2; });
  }
};

namespace profile_table {
inline constexpr EffectInfo info{
    .id = "profile_table",
    .title = "Profiles along the tubes",
    .physics = "Precurvature and stiffness of a tube change along it.",
};
inline constexpr std::array<EffectParameter, 0> parameters{};
}  // namespace profile_table

/// Profiles of `profiles`, which must outlive it; without any it changes nothing. The table is no parameter.
template <int N, class P = double>
struct ProfileTable : EffectValues<profile_table::parameters, N, P> {
  static constexpr const EffectInfo& info = profile_table::info;

  const Profiles<N>* profiles = nullptr;

  void material(const TubePoint<P>& at, Material<P>& m) const noexcept {
    if (profiles == nullptr) return;
    const auto tube = std::size_t(at.tube);
    const std::vector<ProfileNode>& nodes = profiles->nodes[tube];
    if (nodes.size() < 2) return;
    const P x = at.along * (double(nodes.size() - 1) / profiles->length[tube]);
    const auto first = std::size_t(std::clamp(value(x), 0.0, double(nodes.size() - 2)));
    const ProfileNode &a = nodes[first], &b = nodes[first + 1];
    const P part = x - double(first);
    for (std::size_t i = 0; i < 2; ++i)
      m.curvature[i] = m.curvature[i] + part * (b.curvature[i] - a.curvature[i]) + a.curvature[i];
    m.bending_stiffness = m.bending_stiffness * (part * (b.stiffness - a.stiffness) + (1.0 + a.stiffness));
  }
};

}  // namespace ctcr
