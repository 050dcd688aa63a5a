#pragma once
// What a path can lead through.
#include <cmath>
#include <span>

#include "ctcr/core/types.hpp"

namespace ctcr::detail {

/// Whether points are finite, and so are their distances, which are larger than `apart` [m].
inline bool are_a_way(std::span<const Vec3> points, double apart) noexcept {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double distance = (points[i] - points[i > 0 ? i - 1 : 0]).norm();  // of the first one: 0, or NaN
    if (!(distance < HUGE_VAL && (i == 0 || distance > apart))) return false;
  }
  return !points.empty();
}

/// The first point; NaN without any, so that no robot follows it.
inline Vec3 first_of(std::span<const Vec3> points) noexcept {
  return points.empty() ? Vec3(Vec3::Constant(std::nan(""))) : points[0];
}

}  // namespace ctcr::detail
