#pragma once
// What effects share that return with every turn of a gear or of a screw: parameters, and the error.
#include "ctcr/effects/hooks.hpp"

namespace ctcr {

/// Amplitudes of the error, then what says how often it returns, then amplitudes of what returns twice as often.
/// @param once    unit, deviation and bounds of an amplitude
/// @param twice   the same of one that returns twice as often
/// @param period  how often it returns
constexpr std::array<EffectParameter, 5> periodic_error(const EffectParameter& once, const EffectParameter& twice,
                                                        const EffectParameter& period) noexcept {
  std::array<EffectParameter, 5> all{once, once, period, twice, twice};
  const auto call = [&](std::size_t k, std::string_view name, std::string_view meaning) {
    all[k].name = name;
    all[k].meaning = meaning;
    all[k].per_tube = true;
  };
  call(0, "cosine", "where the joint stands at 0");
  call(1, "sine", "a quarter of the period on");
  call(3, "cosine_twice", "of what returns twice as often");
  call(4, "sine_twice", "of what returns twice as often");
  for (const std::size_t k : {3, 4}) all[k].role = Role::detail;
  return all;
}

/// The error of a tube's joint where it stands at `phase` [rad] of its period. @param effect  with these parameters
template <class P, class Effect>
[[nodiscard]] P error_at(const P& phase, const Effect& effect, int tube) noexcept {
  P s, c;
  sincos(phase, s, c);
  const P &cosine = effect.template get<3>(tube), &sine = effect.template get<4>(tube);
  P error = effect.template get<0>(tube) * c + effect.template get<1>(tube) * s;
  if (!vanishes(cosine) || !vanishes(sine)) error = error + cosine * (c * c - s * s) + sine * (2.0 * (s * c));
  return error;
}

}  // namespace ctcr
