#pragma once
#include <array>
#include <cstddef>

#include "ctcr/robot/robot.hpp"

namespace ctcr {

/// Contacts between each tube and the next outer one: at the tips of all tubes, where their curved parts start, and in the
/// front plate. Breakpoints are numbered as in Events; the plate is the last one.
template <int N>
struct Contacts {
  static constexpr int plate = 2 * N, breakpoints = 2 * N + 1, count = (N - 1) * breakpoints;
  /// Index of the contact of a tube, from 0, with the next outer one at a breakpoint.
  [[nodiscard]] static constexpr std::size_t index(int tube, int breakpoint) noexcept {
    return std::size_t(tube * breakpoints + breakpoint);
  }
};

/// Relative torsion angle: by how much more each tube is turned against the next outer one at each contact than at their
/// bases [rad]. Where one of them has ended, or the breakpoint is behind the plate, it is that of the nearest arc length at
/// which both are in front of it.
template <int N, class P = double>
using RelativeTorsion = std::array<P, std::size_t(Contacts<N>::count)>;

/// Jump of the bending moment of all tubes inside each contact, and last that of all tubes in the plate [N m]: a measure of
/// the contact force. 0 where there is no contact; `usual` where it is not known.
template <int N>
struct MomentJumps : std::array<double, std::size_t(Contacts<N>::count) + 1> {
  static constexpr double usual = 0.05;
  constexpr MomentJumps() noexcept { this->fill(usual); }
};

/// Radius at which each tube slides and turns in the next outer one, its own outer radius [m]; `usual` where that is not
/// known.
template <int N>
struct ContactRadii : std::array<double, std::size_t(N)> {
  static constexpr double usual = 0.8e-3;
  constexpr ContactRadii() noexcept { this->fill(usual); }
  explicit ContactRadii(const Robot<N>& robot) noexcept : ContactRadii() {
    for (std::size_t i = 0; i < std::size_t(N); ++i)
      if (const double d = robot.tubes[i].outer_diameter; d > 0) (*this)[i] = 0.5 * d;
  }
};

}  // namespace ctcr
