#pragma once
// The constitutive law of one tube in bending, that of Material. T is the scalar of the results: S, or double (its value).
// Real time: yes, all of it.
#include <array>
#include <cmath>
#include <type_traits>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/dual.hpp"

namespace ctcr::constitutive {

template <class T, class S>
T as(const S& x) noexcept {
  if constexpr (std::is_same_v<T, S>)
    return x;
  else
    return value(x);
}

/// Whether the law is EI times the change of curvature, in all directions.
template <class S>
bool is_isotropic_and_linear(const Material<S>& m) noexcept {
  return vanishes(m.softening) && vanishes(m.anisotropy[0]) && vanishes(m.anisotropy[1]);
}

/// A d, d = (x, y): the unsoftened bending moment is EI times that.
template <class T, class S, class D>
std::array<T, 2> weighed(const Material<S>& m, const D& x, const D& y) noexcept {
  const T a = as<T>(m.anisotropy[0]), c = as<T>(m.anisotropy[1]);
  return {(1.0 + a) * x + c * y, c * x + (1.0 - a) * y};
}

/// The factor f by which softening reduces the stiffness where d A d = z, and its derivatives.
struct Left {
  double f, by_z, by_softening, by_plateau, by_sharpness;
};

/// f = r + (1 - r) (1 + t)^(-1/p), t = (2 c z / (1 - r))^(p/2), with z [1/m^2], the softening c [m^2], the plateau r and the
/// sharpness p.
/// @param by_shape  whether the derivative by the sharpness is wanted, too
inline Left stiffness_left(double z, double c, double r, double p, bool by_shape) noexcept {
  if (!(c * z > 1e-12)) return {1 - c * z, -c, -z, 0, 0};  // there the same, with the derivatives of p = 2
  const double rest = 1 - r, ratio = 2 * c * z / rest;
  const bool gradual = p == 2 && !by_shape;  // the usual one needs a root alone
  const double power = gradual ? 0 : std::log(ratio), t = gradual ? ratio : std::exp(0.5 * p * power);
  const double fall = gradual ? 0 : std::log(1 + t) / p,
               left = rest * (gradual ? 1 / std::sqrt(1 + t) : std::exp(-fall));
  const double part = t / (1 + t), by_power = -0.5 * left * part;
  return {r + left, by_power / z, by_power / c, (rest - left + by_power) / rest,
          left * (fall - 0.5 * part * power) / p};
}

/// A symmetric 2 x 2 matrix.
struct Slope {
  double xx = 0, xy = 0, yy = 0;

  template <class T>
  std::array<T, 2> operator*(const std::array<T, 2>& v) const noexcept {
    return {xx * v[0] + xy * v[1], xy * v[0] + yy * v[1]};
  }
  Slope& operator+=(const Slope& o) noexcept {
    xx += o.xx, xy += o.xy, yy += o.yy;
    return *this;
  }
  [[nodiscard]] Slope inverted() const noexcept {
    const double det = 1.0 / (xx * yy - xy * xy);
    return {yy * det, -xy * det, xx * det};
  }
  /// R (this) R^T, R the turn by the angle of this sine and cosine.
  [[nodiscard]] Slope turned(double sine, double cosine) const noexcept {
    const double ss = sine * sine, sc = sine * cosine, cc = cosine * cosine;
    return {cc * xx - 2 * sc * xy + ss * yy, sc * (xx - yy) + (cc - ss) * xy, ss * xx + 2 * sc * xy + cc * yy};
  }
};

/// f EI A, the tangent stiffness at a constant factor f.
template <class S>
Slope stiffness(const Material<S>& m, double f) noexcept {
  const double k = f * value(m.bending_stiffness), a = value(m.anisotropy[0]);
  return {k * (1 + a), k * value(m.anisotropy[1]), k * (1 - a)};
}

/// Moment and tangent stiffness of a tube, its own axes.
template <class T>
struct Response {
  std::array<T, 2> moment;  ///< [N m]
  Slope slope;              ///< of the moment by the curvature [N m^2]
};

/// Response of a tube to a change of curvature (dx, dy) from its free shape, its own axes [1/m]. Where D is double, that
/// change carries no derivatives, and the response those by the material alone.
template <class T, class S, class D>
Response<T> response(const Material<S>& m, const D& dx, const D& dy) noexcept {
  const std::array<T, 2> e = weighed<T>(m, dx, dy);
  T k = as<T>(m.bending_stiffness);
  if (value(m.softening) == 0 && !is_dual<T>) return {{k * e[0], k * e[1]}, stiffness(m, 1)};
  const T z = dx * e[0] + dy * e[1];
  const bool by_shape = !vanishes(as<T>(m.sharpness) - value(m.sharpness));
  const Left left = stiffness_left(value(z), value(m.softening), value(m.plateau), value(m.sharpness), by_shape);
  const double loss = 2 * value(m.bending_stiffness) * left.by_z, x = value(e[0]), y = value(e[1]);
  Slope slope = stiffness(m, left.f);
  slope += {loss * x * x, loss * x * y, loss * y * y};
  k = k * (mapped(z, left.f, left.by_z) + mapped(as<T>(m.softening), 0, left.by_softening) +
           mapped(as<T>(m.plateau), 0, left.by_plateau) + mapped(as<T>(m.sharpness), 0, left.by_sharpness));
  return {{k * e[0], k * e[1]}, slope};
}

}  // namespace ctcr::constitutive
