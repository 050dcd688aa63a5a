#pragma once
// Robust location, and how surprising a sum of squares is, as a normal score: 3 is exceeded once in 740 by chance.
#include <algorithm>
#include <cmath>
#include <vector>

namespace ctcr {

/// Score from which on a finding is reported: by chance once in some thousand calibrations.
inline constexpr double surprising = 3.5;

/// The upper median of at least one value.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Median length of a vector of one, and of three, standard normal components.
inline constexpr double median_length_1 = 0.67449, median_length_3 = 1.53817;

/// Score of a chi-square value. Ref: Wilson, Hilferty, "The distribution of chi-square", 1931.
inline double chi_square_score(double chi_square, double degrees) noexcept {
  const double v = 2.0 / (9.0 * degrees);
  return (std::cbrt(std::max(0.0, chi_square) / degrees) - (1 - v)) / std::sqrt(v);
}

/// Score of the ratio of two mean squares with these degrees of freedom, good from three degrees in the denominator on.
/// Ref: Paulson, "An approximate normalization of the analysis of variance distribution", 1942.
inline double variance_ratio_score(double ratio, double degrees_above, double degrees_below) noexcept {
  const double a = 2.0 / (9.0 * degrees_above), b = 2.0 / (9.0 * degrees_below), f = std::cbrt(std::max(0.0, ratio));
  return ((1 - b) * f - (1 - a)) / std::sqrt(b * f * f + a);
}

}  // namespace ctcr
