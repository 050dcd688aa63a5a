#pragma once
// Functions of a scalar S, a plain number or a dual one. Real time: yes, all of it.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "ctcr/math/dual.hpp"

namespace ctcr {

template <class S>
S square_root(const S& x) noexcept {
  const double root = std::sqrt(value(x));
  return mapped(x, root, 0.5 / root);
}

template <class S>
S exponential_of(const S& x) noexcept {
  const double e = std::exp(value(x));
  return mapped(x, e, e);
}

/// An angle within half a turn, [-pi, pi].
inline double wrapped(double angle) noexcept { return std::remainder(angle, 2 * std::numbers::pi); }

/// |x|.
template <class S>
S magnitude(const S& x) noexcept {
  return value(x) < 0 ? S(-x) : x;
}

/// tanh(|v|/size) v/|v|: along v, of length 1 where |v| is much larger than `size`; smooth at 0.
template <class S>
std::array<S, 2> saturated(const std::array<S, 2>& v, const S& size) noexcept {
  const S scale = inverse(size), z = (v[0] * v[0] + v[1] * v[1]) * (scale * scale);
  const double x = std::sqrt(value(z));
  S f;  // tanh(x)/x as a function of z = x^2
  if (x < 1e-2) {
    f = mapped(z, 1 - value(z) / 3 + 2 * value(z) * value(z) / 15, -1.0 / 3 + 4 * value(z) / 15);
  } else {
    const double t = std::tanh(x);
    f = mapped(z, t / x, ((1 - t * t) - t / x) / (2 * x * x));
  }
  f = f * scale;
  return {f * v[0], f * v[1]};
}

/// sqrt(|v|/size) v/|v|, but in proportion to v where |v| is much smaller than `size`; of length 1 at |v| = size.
template <class S>
std::array<S, 2> rooted(const std::array<S, 2>& v, const S& size) noexcept {
  const S scale = inverse(size), z = (v[0] * v[0] + v[1] * v[1]) * (scale * scale);
  const double f = std::sqrt(std::sqrt(2 / (1 + value(z))));
  const S along = mapped(z, f, -0.25 * f / (1 + value(z))) * scale;
  return {along * v[0], along * v[1]};
}

/// x kept within [low, high]; at a limit it has the limit's derivatives.
template <class S>
S clamped(const S& x, const S& low, const S& high) noexcept {
  if (value(x) < value(low)) return low;
  if (value(x) > value(high)) return high;
  return x;
}

}  // namespace ctcr
