#pragma once
// A straight elastic rod, clamped at one end, with a dead load across it: exact, however far it bends.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace ctcr {

/// Shape of the rod from the clamp to the load, lengths in those of that part.
struct Elastica {
  double load;        ///< F a^2 / EI, for force F at arc length a
  double angle;       ///< of the rod at the load, from the clamped direction, < pi/2 [rad]
  double deflection;  ///< along the force
};

namespace elastica {

/// Abscissas and weights of Gauss and Legendre on [-1, 1].
template <int n>
struct GaussLegendre {
  std::array<double, n> x{}, w{};
  GaussLegendre() {
    for (int i = 0; i < n; ++i) {
      double z = std::cos(std::numbers::pi * (i + 0.75) / (n + 0.5)), slope = 1;
      for (int newton = 0; newton < 8; ++newton) {
        double p = 1, before = 0;
        for (int k = 1; k <= n; ++k) {
          const double next = ((2 * k - 1) * z * p - (k - 1) * before) / k;
          before = p;
          p = next;
        }
        slope = n * (z * p - before) / (z * z - 1);
        z -= p / slope;
      }
      x[std::size_t(i)] = z;
      w[std::size_t(i)] = 2 / ((1 - z * z) * slope * slope);
    }
  }
};

}  // namespace elastica

/// The rod that stands at `angle` < pi/2 where the load is. With 1 + sin theta = (1 + sin angle) cos^2 chi, arc length
/// and deflection are regular integrals over chi from 0 at the load to atan sqrt(sin angle) at the clamp; panels halve
/// towards chi = 0, where the integrand steepens as the angle nears pi/2. Real time: yes.
/// Ref: Bisshopp, Drucker, "Large deflection of cantilever beams", 1945.
inline Elastica elastica_at(double angle) {
  static const elastica::GaussLegendre<16> rule;
  // 1 - sin angle without cancellation.
  const double s = std::sin(angle), half = std::sin(0.5 * (0.5 * std::numbers::pi - angle)), rest = 2 * half * half;
  double length = 0, fall = 0, high = std::atan(std::sqrt(s));
  while (high > 0) {
    const double low = high * high > rest ? 0.5 * high : 0;
    for (std::size_t i = 0; i < rule.x.size(); ++i) {
      const double chi = 0.5 * (low + high) + 0.5 * (high - low) * rule.x[i], q = std::sin(chi);
      const double density = 0.5 * (high - low) * rule.w[i] * std::sqrt(2 / (rest + (1 + s) * q * q));
      length += density;
      fall += density * (s - (1 + s) * q * q);
    }
    high = low;
  }
  return {.load = length * length, .angle = angle, .deflection = fall / length};
}

/// The rod under F a^2 / EI = `load` > 0, to rounding up to a load of about 400. The angle grows with it and stays below
/// both that of small deflections and pi/2: false position between bounds (Illinois) cannot fail. Real time: yes.
inline Elastica elastica_under(double load) {
  const double wanted = std::sqrt(load);
  const auto excess_of = [&](const Elastica& rod) { return std::sqrt(rod.load) - wanted; };
  double low = 0, at_low = -wanted, high = std::min(0.5 * load, 0.5 * std::numbers::pi - 1e-8);
  Elastica rod = elastica_at(high);
  double at_high = excess_of(rod);
  int kept = 0;  // which end stayed: -1 low, 1 high
  for (int k = 0; k < 200 && std::abs(excess_of(rod)) > 4e-16 * wanted && high - low > 4e-16 * high; ++k) {
    const double angle = (low * at_high - high * at_low) / (at_high - at_low);
    rod = elastica_at(angle);
    const double excess = excess_of(rod);
    if (excess < 0) {
      low = angle;
      at_low = excess;
      if (kept == 1) at_high *= 0.5;
      kept = 1;
    } else {
      high = angle;
      at_high = excess;
      if (kept == -1) at_low *= 0.5;
      kept = -1;
    }
  }
  return rod;
}

}  // namespace ctcr
