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

/// f, what softening c leaves of a stiffness where d A d = z.
template <class T>
T stiffness_left(const T& c, const T& z) noexcept {
  constexpr double r = Material<T>::stiffness_left;
  if (value(c) == 0) return 1.0 - c * z;  // the same with its derivatives, for less
  return r + (1 - r) * inverse(square_root(1.0 + (2 / (1 - r)) * (c * z)));
}
/// df/dz.
inline double loss_slope(double c, double z) noexcept {
  constexpr double r = Material<double>::stiffness_left;
  const double q = 1 / std::sqrt(1 + 2 / (1 - r) * c * z);
  return -c * q * q * q;
}

/// Bending moment of a tube whose curvature differs from that of the free one by (dx, dy), its own axes [N m].
template <class T, class S>
std::array<T, 2> moment(const Material<S>& m, const T& dx, const T& dy) noexcept {
  const std::array<T, 2> e = weighed(m, dx, dy);
  const T k = as<T>(m.bending_stiffness) * stiffness_left(as<T>(m.softening), T(dx * e[0] + dy * e[1]));
  return {k * e[0], k * e[1]};
}

}  // namespace ctcr::bending
