#pragma once
#include <cmath>
#include <cstddef>

#include "ctcr/core/status.hpp"
#include "ctcr/robot/robot.hpp"

namespace ctcr {
namespace detail {

/// How much longer than its tube a curve may be given [m]. None can be, yet a fit and a difference quotient take the two
/// lengths of a tube that is curved from end to end independently, to some standard deviations of a calibration (1 to
/// 2.5 mm) beyond each other; the model then has the curve begin behind the grasped point, where it does nothing.
inline constexpr double curve_slack = 10e-3;
/// Rounding of diameters, relative.
inline constexpr double diameter_rounding = 1e-9;

/// Largest magnitude of a number, and inverse of the smallest of a stiffness: products of two stay finite.
inline constexpr double computable = 1e150;

/// Whether a number is positive, or at least zero, and one can compute with it.
constexpr bool is_positive(double x) noexcept { return x >= 1 / computable && x <= computable; }
constexpr bool is_magnitude(double x) noexcept { return x >= 0 && x <= computable; }

/// Whether the numbers of a tube can be those of one. Where EI is given, E and the diameters may be unknown: zero.
inline bool is_possible(const Tube& t) noexcept {
  const bool magnitudes = is_magnitude(t.youngs_modulus) && is_magnitude(t.bending_stiffness) &&
                          is_magnitude(t.density) && is_magnitude(t.inner_diameter) && is_magnitude(t.outer_diameter) &&
                          is_magnitude(t.curved_length);
  const bool unknown = t.bending_stiffness > 0 && t.outer_diameter == 0;
  // An isotropic material is stable for nu in (-1, 0.5].
  return magnitudes && t.length > 0 && is_magnitude(t.length) && t.curved_length <= t.length + curve_slack &&
         t.poisson_ratio > -1 && t.poisson_ratio <= 0.5 && (unknown || t.inner_diameter < t.outer_diameter) &&
         is_positive(t.EI()) && is_positive(t.GJ()) && is_magnitude(std::abs(t.EI() * t.curvature)) &&
         is_magnitude(std::abs(t.EI() * t.curvature / t.GJ()));
}

}  // namespace detail

/// Whether a robot can exist, and the numbers derived from it (EI, GJ, their sums, weight) can be computed: finite; E, or
/// EI where it is given, positive; -1 < nu <= 0.5; no negative density or diameter; walls of some thickness; positive
/// lengths, curves no longer than their tubes; tubes that fit into each other. Published diameters are often fitted, so a
/// tube may reach into the wall around it, up to its middle. Nothing else is bounded: neither stiffness ratios nor the
/// total angle of bending; derived numbers must lie within 1e-150 and 1e150, so that products of two stay finite.
/// @return ok or invalid_robot. Real time: yes, about 30 comparisons a tube.
template <int N>
[[nodiscard]] Status check_robot(const Robot<N>& robot) noexcept {
  bool possible = all_finite(robot.gravity);
  double stiffness = 0, mass = 0;
  for (std::size_t i = 0; i < N; ++i) {
    const Tube& t = robot.tubes[i];
    possible = possible && detail::is_possible(t);
    stiffness += t.EI();
    mass += t.mass_per_length();
    // A weight needs diameters.
    possible =
        possible && detail::is_magnitude(std::abs(mass)) && (t.mass_per_length() >= 0 || robot.gravity.isZero(0.0));
    const bool known = t.outer_diameter > 0 && (t.inner_diameter > 0 || !(t.bending_stiffness > 0));
    if (i > 0 && known && robot.tubes[i - 1].outer_diameter > 0)
      possible = possible && robot.tubes[i - 1].outer_diameter <=
                                 0.5 * (t.inner_diameter + t.outer_diameter) * (1 + detail::diameter_rounding);
  }
  possible =
      possible && detail::is_positive(stiffness) && (mass * robot.gravity).cwiseAbs().maxCoeff() <= detail::computable;
  return possible ? Status::ok : Status::invalid_robot;
}

}  // namespace ctcr
