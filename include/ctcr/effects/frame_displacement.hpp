#pragma once
// What effects share that displace the tracker frame about the centre of all readings: parameters, and the hook.
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/frame_algebra.hpp"

namespace ctcr {

/// Displacements along, then turns about the tracker's axes, then what says when.
/// @param sigma       plausible standard deviation of a displacement [m]
/// @param turn_sigma  and of a turn [rad]
constexpr std::array<EffectParameter, 7> frame_displacement(double sigma, double turn_sigma,
                                                            const EffectParameter& course) noexcept {
  const EffectParameter along{.name = {},
                              .unit = "m",
                              .sigma = sigma,
                              .soft_low = -0.003,
                              .soft_high = 0.003,
                              .hard_low = -0.1,
                              .hard_high = 0.1};
  const EffectParameter about{.name = {},
                              .unit = "rad",
                              .sigma = turn_sigma,
                              .soft_low = -0.03,
                              .soft_high = 0.03,
                              .hard_low = -0.5,
                              .hard_high = 0.5};
  std::array<EffectParameter, 7> all{along, along, along, about, about, about, course};
  constexpr std::string_view names[]{"x", "y", "z", "turn_x", "turn_y", "turn_z"};
  constexpr std::string_view meanings[]{"along the tracker axis x", "along the tracker axis y",
                                        "along the tracker axis z", "about the tracker axis x",
                                        "about the tracker axis y", "about the tracker axis z"};
  for (std::size_t i = 0; i < 6; ++i) all[i].name = names[i], all[i].meaning = meanings[i];
  return all;
}

/// Displaces a reading by a part of the first six values.
template <class P, std::size_t Count>
void displace_frame(const Occasion& at, const P& part, const std::array<P, Count>& values, Frame<P>& reading) noexcept {
  const Triple<P> about{-at.centre[0], -at.centre[1], -at.centre[2]}, back{at.centre[0], at.centre[1], at.centre[2]};
  const auto by = [&](std::size_t k) { return part * values[k]; };
  shift(reading, about);
  reading = composed(displacement<P>({by(0), by(1), by(2)}, {by(3), by(4), by(5)}), reading);
  shift(reading, back);
}

}  // namespace ctcr
