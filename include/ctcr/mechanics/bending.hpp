#pragma once
// The law by which one tube resists bending: that of Material. T is the scalar of the answers, S or double (its value).
#include <type_traits>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/functions.hpp"

namespace ctcr::bending {

template <class T, class S>
T as(const S& x) noexcept {
  if constexpr (std::is_same_v<T, S>)
    return x;
  else
    return value(x);
}

/// A d, d = (x, y): the unsoftened bending moment is EI times that.
template <class T, class S>
std::array<T, 2> weighed(const Material<S>& m, const T& x, const T& y) noexcept {
  const T a = as<T>(m.anisotropy[0]), c = as<T>(m.anisotropy[1]);
  return {(1.0 + a) * x + c * y, c * x + (1.0 - a) * y};
}

/// f, what softening leaves of a stiffness where d A d = z.
template <class T, class S>
T stiffness_left(const Material<S>& m, const T& z) noexcept {
  const T c = as<T>(m.softening);
  if (!(value(c) * value(z) > 1e-12)) return 1.0 - c * z;  // there the same, with the derivatives of p = 2
  const T r = as<T>(m.plateau), p = as<T>(m.sharpness), rest = 1.0 - r;
  const T t = exponential_of(T(0.5 * p * logarithm_of(T(2.0 * c * z * inverse(rest)))));
  return r + rest * exponential_of(T(-(logarithm_of(T(1.0 + t)) * inverse(p))));
}
/// df/dz.
template <class S>
double loss_slope(const Material<S>& m, double z) noexcept {
  const double c = value(m.softening), p = value(m.sharpness), rest = 1 - value(m.plateau);
  if (!(c * z > 1e-12)) return -c;
  const double t = std::pow(2 * c * z / rest, p / 2);
  return -rest / (2 * z) * t * std::pow(1 + t, -1 / p - 1);
}

/// Bending moment of a tube whose curvature differs from that of the free one by (dx, dy), its own axes [N m].
template <class T, class S>
std::array<T, 2> moment(const Material<S>& m, const T& dx, const T& dy) noexcept {
  const std::array<T, 2> e = weighed(m, dx, dy);
  const T k = as<T>(m.bending_stiffness) * stiffness_left(m, T(dx * e[0] + dy * e[1]));
  return {k * e[0], k * e[1]};
}

}  // namespace ctcr::bending
