#pragma once
// Systems with every effect that is known here, compiled for recordings and shared with control.
#include <ctcr/effects/catalogue.hpp>
#include <ctcr/effects/profile_table.hpp>

#include "plain_system.hpp"
#include "solver_of.hpp"

namespace ctcr::python {

/// The catalogue, and what effects that are written in Python do along the tubes.
template <class>
struct WithProfiles;
template <template <int, class> class... E>
struct WithProfiles<EffectList<E...>> {
  using type = EffectList<E..., ProfileTable>;
};
using AllEffects = WithProfiles<Catalogue>::type;

/// @param values    of all parameters of the catalogue; empty: neutral ones
/// @param profiles  must outlive the system; or null
template <int N>
System<N, AllEffects> with_effects(const System<N>& plain, const Eigen::VectorXd& values,
                                   const Profiles<N>* profiles = nullptr) {
  typename AllEffects::On<N> effects;
  effects.for_each([&](auto& effect, int first) {
    for (std::size_t k = 0; k < effect.values.size() && values.size() > 0; ++k)
      effect.values[k] = values[first + Eigen::Index(k)];
    if constexpr (requires { effect.profiles; }) effect.profiles = profiles;
  });
  return {plain.transmission, Model<N, AllEffects>(plain.model.robot(), effects), plain.sensor, plain.settings};
}

}  // namespace ctcr::python

// Evaluations with effects, compiled once for all files of this module, in recording_of_N.cpp.
#define CTCR_EFFECT_EVALUATION(kind, D, N)                                                                         \
  kind void evaluate<Derivatives::D, Loading::weight, MagnusRk4, N>(                                               \
      const EffectCoefficients<N, python::AllEffects>&, const Joints<N>&, const TipLoad&, const TipGuess<N>&, int, \
      Evaluation<N, Loading::weight, Derivatives::D>&) noexcept;
#define CTCR_EFFECT_EVALUATIONS(kind, N)    \
  CTCR_EFFECT_EVALUATION(kind, none, N)     \
  CTCR_EFFECT_EVALUATION(kind, jacobian, N) \
  CTCR_EFFECT_EVALUATION(kind, compliance, N)

namespace ctcr {
CTCR_EFFECT_EVALUATIONS(extern template, 1)
CTCR_EFFECT_EVALUATIONS(extern template, 2)
CTCR_EFFECT_EVALUATIONS(extern template, 3)
CTCR_EFFECT_EVALUATIONS(extern template, 4)
}  // namespace ctcr
