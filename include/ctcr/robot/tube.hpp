#pragma once
// One precurved elastic tube, as its data sheet gives it.
#include <numbers>

namespace ctcr {

/// A tube: straight from the grasped point, precurved over `curved_length` before the tip. Precurvature is about the
/// tube's x axis. Ref: Boyer et al., Table II.
struct Tube {
  double youngs_modulus = 0;     ///< E [Pa]
  double poisson_ratio = 0.3;    ///< nu [-]
  double density = 0;            ///< [kg/m^3]
  double inner_diameter = 0;     ///< [m]
  double outer_diameter = 0;     ///< [m]
  double length = 0;             ///< l, from the grasped point to the tip [m]
  double curved_length = 0;      ///< l_kappa, ends at the tip [m]
  double curvature = 0;          ///< kappa [1/m]
  double bending_stiffness = 0;  ///< EI [N m^2] where it is known directly; 0: from E and the diameters

  /// Second moment of area of the annulus [m^4].
  [[nodiscard]] constexpr double second_moment() const noexcept {
    const double i2 = inner_diameter * inner_diameter, o2 = outer_diameter * outer_diameter;
    return std::numbers::pi / 64.0 * (o2 * o2 - i2 * i2);
  }
  /// EI [N m^2].
  [[nodiscard]] constexpr double EI() const noexcept {
    return bending_stiffness > 0 ? bending_stiffness : youngs_modulus * second_moment();
  }
  /// GJ = EI / (1 + nu) [N m^2]: J = 2 I for an annulus.
  [[nodiscard]] constexpr double GJ() const noexcept { return EI() / (1.0 + poisson_ratio); }
  /// Mass per length [kg/m].
  [[nodiscard]] constexpr double mass_per_length() const noexcept {
    return density * std::numbers::pi / 4.0 * (outer_diameter * outer_diameter - inner_diameter * inner_diameter);
  }
};

}  // namespace ctcr
