#pragma once
// The contract of a physical effect that the standard model leaves out.
//
// An effect is a struct template over the number of tubes N and the scalar P of its parameters. It has a description
// (`info`), a list of named parameters whose neutral values change nothing, and any of the hooks of hooks.hpp; a hook
// that it lacks compiles to nothing. A list of effects is part of a model's type, Model<3, EffectList<Softening>>; the
// standard model is the empty list.
#include <array>
#include <cstddef>
#include <limits>
#include <string_view>

namespace ctcr {

/// The part that a parameter plays in its effect. It decides when a fit frees the parameter.
enum class Role {
  amplitude,  ///< the effect vanishes where all its amplitudes and details are neutral; fitted first
  detail,     ///< a further amplitude, fitted once the effect is known to act
  shape,      ///< changes the form of an effect that acts; fitted with the details
  choice      ///< selects one of several forms or constitutive laws; has no derivatives and is never fitted
};

/// The physical quantity of a parameter, where a program can use more than its value. Parameters of an effect with the
/// same quantity belong together, in the order given here.
enum class Quantity {
  other,
  tip_force,  ///< x, y, z of a force at the robot tip, base frame [N]
  lag,        ///< time by which readings are later than the joints [s]
  moment,     ///< part of the session, 0 to 1, before which the effect changes nothing; no slope leads there
  surface,  ///< distance [m], azimuth, elevation [rad] of a surface that pushes the tip: base frame, outside is nearer
            ///< to the origin. The response is zero, with no slope, where the tip does not reach it
  source,   ///< volume [m^3], position x, y, z [m] of a small source of field, then of the tracker's coils, both in the
            ///< tracker frame. Many local optima; independent of the other parameters of its effect
  screw_pitch,  ///< translation per turn of the motor [m]: the transmission of the robot tells the usual value
  gear_ratio    ///< turns of the motor per turn of the tube: the same
};

struct Interval {
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
};

/// One named parameter of an effect.
struct EffectParameter {
  std::string_view name;    ///< snake_case
  std::string_view unit{};  ///< SI; empty: a pure number
  double neutral = 0;       ///< changes nothing (amplitude, detail), or the usual value (shape, choice)
  double sigma = 1;         ///< plausible standard deviation about it, before any measurement
  Interval soft{0, 0};      ///< beyond it a value may explain the data, but hardly by this physics
  Interval hard{};          ///< beyond it a value is impossible
  bool per_tube = false;    ///< one value for each tube
  Role role = Role::amplitude;
  Quantity quantity = Quantity::other;
  std::string_view meaning{};  ///< in plain words

  /// One of several parameters that differ in their names alone.
  [[nodiscard]] constexpr EffectParameter named(std::string_view own_name, std::string_view own_meaning) const {
    EffectParameter p = *this;
    p.name = own_name;
    p.meaning = own_meaning;
    return p;
  }
};

/// Selects one of several constitutive laws, numbered from 0; the meaning says which.
[[nodiscard]] constexpr EffectParameter choice_of_law(int laws, std::string_view meaning) {
  const Interval numbers{0.0, laws - 1.0};
  return {.name = "law", .soft = numbers, .hard = numbers, .role = Role::choice, .meaning = meaning};
}

/// Properties that measurements must have to show an effect.
struct Needs {
  bool order = false;        ///< rows in the order in which they were measured
  bool time = false;         ///< time stamps
  bool orientation = false;  ///< of the sensor
  bool loads = false;        ///< different known tip loads
  bool gravity = false;      ///< its direction
};

/// A way in which an effect may act: the parameters `first` to `last` of its list, the others being neutral.
struct Variant {
  std::string_view first, last;
};

/// A value, other than the usual one, of a detail, a shape or a choice.
struct StartValue {
  std::string_view parameter;
  double value = 0;
};

/// Prior knowledge of an effect: its description, and how exact its form is.
struct EffectInfo {
  std::string_view id;  ///< stable: in files, on the command line and in reports
  std::string_view title;
  std::string_view physics{};      ///< what happens, in plain words
  std::string_view signature{};    ///< how the error looks
  std::string_view measure{};      ///< what to measure to see it and to tell it from its look-alikes
  std::string_view look_alikes{};  ///< ids, separated by spaces
  std::string_view reference{};
  Needs needs{};
  /// Part of the amplitude of its signal, as a calibration leaves it, by which its lumped form errs: a prior standard
  /// deviation. The default covers most forms; docs/effect_forms.md measures them against fuller models.
  double form_error = 0.15;
  /// Ways to act that differ in physics or in the number of parameters, for model selection; a fit tries each of them,
  /// and the evidence pays for the parameters. None: all amplitudes at once. Unused ones are empty.
  Variant variants[4]{};
  /// Further points from which a fit must start, since the usual values lead to another local optimum; each is tried with
  /// each variant. Unused ones are empty.
  StartValue starts[2][2]{};
};

/// Internal state of an effect that depends on the motion so far.
template <int States, class P>
struct EffectHistory {
  std::array<P, std::size_t(States)> state{};
};

/// The values of an effect's parameters: parameter after parameter, and within one tube after tube.
/// @tparam List    its std::array of EffectParameter
/// @tparam States  length of its internal state, which the motion changes from row to row
template <const auto& List, int N, class P, int States = 0>
struct EffectValues {
  static constexpr const auto& parameters = List;

  static constexpr int size(int k) noexcept { return List[std::size_t(k)].per_tube ? N : 1; }
  /// Index of parameter k's value for a tube.
  static constexpr int index(int k, int tube = 0) noexcept {
    for (int j = 0; j < k; ++j) tube += size(j);
    return tube;
  }
  static constexpr int count = index(int(List.size()), 0);

  static constexpr int states = States;
  using History = EffectHistory<States, P>;

  std::array<P, std::size_t(count)> values = neutral();
  History history{};
  bool active =
      true;  ///< false: all amplitudes and details are neutral and carry no derivatives; hooks need not be called

  /// Value of parameter K; that of a tube, from 0, if it is per tube.
  template <int K>
  [[nodiscard]] constexpr const P& get(int tube = 0) const noexcept {
    constexpr int first = index(K);
    return values[std::size_t(first + tube)];
  }

  static constexpr std::array<P, std::size_t(count)> neutral() noexcept {
    std::array<P, std::size_t(count)> v{};
    auto next = v.begin();
    for (int k = 0; k < int(List.size()); ++k)
      for (int i = 0; i < size(k); ++i) *next++ = List[std::size_t(k)].neutral;
    return v;
  }
};

}  // namespace ctcr
