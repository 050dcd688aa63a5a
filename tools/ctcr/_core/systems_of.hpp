#pragma once
// Systems from the values of their parameters, without effects or with all of the catalogue. Their solvers take long to
// compile: they are declared here and compiled once for all files of this module.
#include <ctcr/ctcr.hpp>
#include <ctcr/derivatives/parameters.hpp>
#include <ctcr/effects/catalogue.hpp>
#include <ctcr/effects/profile_table.hpp>
#include <ctcr/friction/relative_torsion.hpp>
#include <ctcr/recording/derivatives.hpp>
#include <ctcr/system/parameters.hpp>

namespace ctcr::python {

/// The catalogue, and profiles along the tubes for effects that are written in Python.
template <class>
struct WithProfiles;
template <template <int, class> class... E>
struct WithProfiles<EffectList<E...>> {
  using type = EffectList<E..., ProfileTable>;
};
using AllEffects = WithProfiles<Catalogue>::type;
template <int N>
using AllCoefficients = EffectCoefficients<N, AllEffects>;

/// (w, x, y, z) with w >= 0.
inline Eigen::RowVector4d quaternion(const Mat3& rotation) {
  const Eigen::Quaterniond q(rotation);
  return (q.w() < 0 ? -1.0 : 1.0) * Eigen::RowVector4d(q.w(), q.x(), q.y(), q.z());
}

/// @param parameters   as ParameterVector<N>; tracker.rotation: rotation vector of T_ref
/// @param sensor_tube  from 0
template <int N>
System<N> system_of(const Eigen::VectorXd& parameters, int sensor_tube = 0, int steps = 1) {
  const System<N> empty{{}, Model<N>(Robot<N>{}), PoseSensor{{}, sensor_tube}, Settings{.steps = steps}};
  return SystemParameters<N, Standard>::with_values(empty, parameters);
}

/// @param values    of all parameters of the catalogue; empty: neutral ones
/// @param profiles  must outlive the system; or null
template <int N>
System<N, AllEffects> with_effects(const System<N>& standard, const Eigen::VectorXd& values,
                                   const Profiles<N>* profiles = nullptr) {
  typename AllEffects::On<N> effects;
  effects.for_each([&](auto& effect, int first) {
    for (std::size_t k = 0; k < effect.values.size() && values.size() > 0; ++k)
      effect.values[k] = values[first + Eigen::Index(k)];
    if constexpr (requires { effect.profiles; }) effect.profiles = profiles;
  });
  return {standard.transmission, Model<N, AllEffects>(standard.model.robot(), effects), standard.sensor,
          standard.settings};
}

/// The same for good: effects at their neutral values are switched off.
template <int N>
System<N, AllEffects> with_constant_effects(const System<N>& standard, const Eigen::VectorXd& values) {
  System<N, AllEffects> system = with_effects<N>(standard, values);
  const auto acting = system.model.effects().template seeded<double>([](double x, int) { return x; });
  system.model = Model<N, AllEffects>(system.model.robot(), acting);
  return system;
}

}  // namespace ctcr::python

#define CTCR_SOLVE(kind, D, N)                                                                                      \
  kind Status solve<Derivatives::D, MagnusRk4, N>(const Model<N>&, const Joints<N>&, const TipLoad&, Workspace<N>&, \
                                                  Solution<N>&, const Settings&) noexcept;
#define CTCR_EVALUATE(kind, D, C, N)                                                   \
  kind void evaluate<Derivatives::D, Loading::weight, MagnusRk4, N>(                   \
      const C&, const Joints<N>&, const TipLoad&, const TipGuess<N>&, const Steps<N>&, \
      Evaluation<N, Loading::weight, Derivatives::D>&) noexcept;
#define CTCR_EVALUATIONS(kind, C, N)                                                                     \
  CTCR_EVALUATE(kind, none, C, N)                                                                        \
  CTCR_EVALUATE(kind, jacobian, C, N)                                                                    \
  CTCR_EVALUATE(kind, compliance, C, N)                                                                  \
  kind bool detail::is_stable<MagnusRk4>(const C&, const Joints<N>&, const TipLoad&, const TipGuess<N>&, \
                                         const Steps<N>&) noexcept;
#define CTCR_SOLVERS(kind, N)                                                                                          \
  namespace ctcr {                                                                                                     \
  kind class Model<N, python::AllEffects>;                                                                             \
  kind class MomentSharing<N, double>;                                                                                 \
  kind class MomentSharing<N, Dual<4>>;                                                                                \
  kind class EffectRod<N, double, python::AllEffects>;                                                                 \
  kind class EffectRod<N, Dual<4>, python::AllEffects>;                                                                \
  kind TorsionDerivatives<N> torsion_derivatives<N, python::AllEffects>(const Model<N, python::AllEffects>&,           \
                                                                        const Workspace<N>&) noexcept;                 \
  CTCR_EVALUATIONS(kind, Coefficients<N>, N)                                                                           \
  CTCR_EVALUATIONS(kind, python::AllCoefficients<N>, N)                                                                \
  CTCR_SOLVE(kind, none, N)                                                                                            \
  CTCR_SOLVE(kind, compliance, N)                                                                                      \
  kind Status differentiate_tip<MagnusRk4, N>(const Model<N>&, const Workspace<N>&, int, TipDerivatives<N>&) noexcept; \
  kind Status differentiate_tip<MagnusRk4, N>(const Model<N>&, const Workspace<N>&, int, TipDerivatives<N>&,           \
                                              Mat6&) noexcept;                                                         \
  kind Status predict<N, python::AllEffects>(const System<N, python::AllEffects>&, const RecordedRow<N>&,              \
                                             const typename python::AllEffects::On<N>::History&, Workspace<N>&,        \
                                             RecordedPrediction<N, python::AllEffects>&) noexcept;                     \
  kind Status differentiate<N, python::AllEffects>(const System<N, python::AllEffects>&, const RecordedRow<N>&,        \
                                                   const Workspace<N>&,                                                \
                                                   const RecordedPrediction<N, python::AllEffects>&,                   \
                                                   std::span<const int>,                                               \
                                                   Eigen::Ref<Eigen::Matrix<double, 6, Eigen::Dynamic>>,               \
                                                   const RowHistorySensitivities&, Mat6*) noexcept;                    \
  }
#define CTCR_INSTANTIATE_SYSTEMS(N) CTCR_SOLVERS(template, N)

CTCR_SOLVERS(extern template, 1)
CTCR_SOLVERS(extern template, 2)
CTCR_SOLVERS(extern template, 3)
CTCR_SOLVERS(extern template, 4)
