#pragma once
// Effects of the material of a tube once more, for the independent rod: they share no code with include/ctcr/effects.
#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "ctcr/robot/tube.hpp"

namespace ctcr::test {

/// What a tube is made of beside its data sheet, as the parameters of the catalogue say it; by default nothing.
struct IndependentMaterial {
  double softening = 0, plateau = 0.25, sharpness = 2;  ///< [m^2], -, -
  double along = 0, across = 0;                         ///< of the anisotropy
  std::array<double, 5> profile{};                      ///< weights of Legendre polynomials 1 to 5 over the curved part
  Eigen::Vector2d bend{0, 0};                           ///< of the straight part, tube axes [1/m]
  double slope = 0, bow = 0;                            ///< weights of Legendre polynomials 1 and 2 of that bend
  double twist = 0;                                     ///< of the plane of precurvature [rad/m]

  /// Curvature of the unloaded tube, its own axes [1/m]. @param along_tube  from its base [m]
  [[nodiscard]] Eigen::Vector2d free_curvature(const Tube& tube, double along_tube, bool curved) const {
    const double straight = tube.length - tube.curved_length;
    if (!curved) {
      const double x = 2 * along_tube / straight - 1;
      return bend * (1 + slope * std::legendre(1, x) + bow * std::legendre(2, x));
    }
    const double within = along_tube - straight, x = 2 * within / tube.curved_length - 1;
    double sum = 1;
    for (unsigned k = 0; k < profile.size(); ++k) sum += profile[k] * std::legendre(k + 1, x);
    return tube.curvature * sum * Eigen::Vector2d(std::cos(twist * within), std::sin(twist * within));
  }

  /// Moment by change of curvature, tube axes, in units of EI.
  [[nodiscard]] Eigen::Matrix2d stiffness(const Eigen::Vector2d& change) const {
    Eigen::Matrix2d A;
    A << 1 + along, across, across, 1 - along;
    const double yielding = 2 * softening * change.dot(A * change) / (1 - plateau);
    return (plateau + (1 - plateau) * std::pow(1 + std::pow(yielding, sharpness / 2), -1 / sharpness)) * A;
  }

  [[nodiscard]] double least_stiffness() const {
    return (1 - std::hypot(along, across)) * (softening > 0 ? plateau : 1);
  }
  /// A bound of the free curvature [1/m].
  [[nodiscard]] double most_curvature(const Tube& tube, bool curved) const {
    if (!curved) return bend.norm() * (1 + std::abs(slope) + std::abs(bow));
    double sum = 1;
    for (const double weight : profile) sum += std::abs(weight);
    return std::abs(tube.curvature) * sum;
  }
};

}  // namespace ctcr::test
