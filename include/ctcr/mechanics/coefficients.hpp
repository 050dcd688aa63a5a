#pragma once
// Coefficients of the rod equations of a robot, computed once.
#include <array>

#include "ctcr/math/dual.hpp"
#include "ctcr/robot/robot.hpp"

namespace ctcr {

/// Stiffnesses and geometry of N tubes. P = double, or Dual to differentiate by them.
template <int N, class P = double>
struct Coefficients {
  std::array<P, N> kz{};           ///< torsional stiffness GJ [N m^2]
  std::array<P, N> a{};            ///< moment of the precurvature k kappa [N m]
  std::array<P, N> rho{};          ///< a / kz [1/m]
  std::array<P, N> length{};       ///< [m]
  std::array<P, N> curve_start{};  ///< arc length of the tube where its curved part starts [m]
  std::array<bool, N> curved{};    ///< false: straight all along
  std::array<P, N> compliance{};   ///< 1 / sum of EI of tubes 1..i+1 [1/(N m^2)]
  std::array<P, N> weight{};       ///< mass per length of tubes 1..i+1 together [kg/m]
  Vec3 gravity = Vec3::Zero();     ///< base frame [m/s^2]
};

/// Parameters of one tube in the form the mechanics uses, per tube.
template <class P>
struct TubeParameters {
  P k, kz, kappa, length, curved_length, mass;  ///< [N m^2], [N m^2], [1/m], [m], [m], [kg/m]
};

template <int N, class P>
inline Coefficients<N, P> make_coefficients(const std::array<TubeParameters<P>, N>& tubes,
                                            const Vec3& gravity) noexcept {
  Coefficients<N, P> c;
  c.gravity = gravity;
  P stiffness = 0.0, mass = 0.0;
  for (std::size_t i = 0; i < N; ++i) {
    const TubeParameters<P>& t = tubes[i];
    stiffness += t.k;
    mass += t.mass;
    c.kz[i] = t.kz;
    c.a[i] = t.k * t.kappa;
    c.rho[i] = c.a[i] * inverse(t.kz);
    c.length[i] = t.length;
    c.curve_start[i] = t.length - t.curved_length;
    c.curved[i] = value(t.kappa) != 0 && value(t.curved_length) > 0;
    c.compliance[i] = inverse(stiffness);
    c.weight[i] = mass;
  }
  return c;
}

/// The parameters of each tube that the mechanics uses. Real time: yes.
template <int N>
inline std::array<TubeParameters<double>, N> tube_parameters(const Robot<N>& robot) noexcept {
  std::array<TubeParameters<double>, N> tubes{};
  for (std::size_t i = 0; i < N; ++i) {
    const Tube& t = robot.tubes[i];
    tubes[i] = {t.EI(), t.GJ(), t.curvature, t.length, t.curved_length, t.mass_per_length()};
  }
  return tubes;
}

/// Coefficients of a robot. Real time: yes.
template <int N>
inline Coefficients<N> make_coefficients(const Robot<N>& robot) noexcept {
  return make_coefficients<N, double>(tube_parameters(robot), robot.gravity);
}

}  // namespace ctcr
