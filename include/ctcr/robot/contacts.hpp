#pragma once
#include <array>
#include <cstddef>

#include "ctcr/robot/robot.hpp"

namespace ctcr {

/// Where tubes may touch: each tube and the next outer one at the tips and at the curved starts of all tubes, and in the
/// front plate. These stations have the numbers of Events, and the plate the last one.
template <int N>
struct Contacts {
  static constexpr int plate = 2 * N, stations = 2 * N + 1, count = (N - 1) * stations;
  /// Place of a contact of a tube, from 0, with the next outer one.
  [[nodiscard]] static constexpr std::size_t place(int tube, int station) noexcept {
    return std::size_t(tube * stations + station);
  }
};

/// By how much more each tube is turned against the next outer one at each contact than at their bases [rad]. Where one of
/// them has ended, or the station is behind the plate, it is that of the nearest place at which both are in front of it.
template <int N, class P = double>
using Twist = std::array<P, std::size_t(Contacts<N>::count)>;

/// By how much the bending moment of all tubes inside each contact jumps there, and at last that of all tubes in the plate
/// [N m]: how hard they press on what is around them. 0 where there is no contact; as usual where it is not known.
template <int N>
struct MomentJumps : std::array<double, std::size_t(Contacts<N>::count) + 1> {
  static constexpr double usual = 0.05;
  constexpr MomentJumps() noexcept { this->fill(usual); }
};

/// Where each tube slides and turns in what is around it: its outer radius [m]; as usual where that is not known.
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
