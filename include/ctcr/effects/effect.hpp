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

/// Whether a parameter says how strong an effect is, adds a detail, which is fitted after these, says only of what shape an
/// effect is, or which of several forms it has: a choice has no derivatives and is never fitted.
enum class Role { amplitude, detail, shape, choice };

/// One named parameter of an effect.
struct EffectParameter {
  std::string_view name;               ///< snake_case
  std::string_view unit{};             ///< SI; empty: a pure number
  double neutral = 0;                  ///< changes nothing (amplitude, detail), or the usual value (shape)
  double sigma = 1;                    ///< plausible standard deviation about it, before any measurement
  double soft_low = 0, soft_high = 0;  ///< beyond: explains the data, but hardly by this physics
  double hard_low = -std::numeric_limits<double>::infinity(),
         hard_high = std::numeric_limits<double>::infinity();  ///< beyond: impossible
  bool per_tube = false;                                       ///< one value for each tube
  Role role = Role::amplitude;
  std::string_view meaning{};  ///< in plain words
};

/// What measurements must have for an effect to be seen.
struct Needs {
  bool order = false;        ///< rows in the order in which they were measured
  bool time = false;         ///< time stamps
  bool orientation = false;  ///< of the sensor
  bool loads = false;        ///< different known tip loads
  bool gravity = false;      ///< its direction
};

/// What is known of an effect before any data are.
struct EffectInfo {
  std::string_view id;  ///< stable: in files, on the command line and in reports
  std::string_view title;
  std::string_view physics{};      ///< what happens, in plain words
  std::string_view signature{};    ///< how the error looks
  std::string_view measure{};      ///< what to measure to see it and to tell it from its look-alikes
  std::string_view look_alikes{};  ///< ids, separated by spaces
  std::string_view reference{};
  Needs needs{};
};

/// What the joints' past left behind in an effect.
template <int States, class P>
struct EffectPast {
  std::array<P, std::size_t(States)> state{};
};

/// The values of an effect's parameters: parameter after parameter, and within one tube after tube.
/// @tparam List    its std::array of EffectParameter
/// @tparam States  numbers that it remembers from row to row
template <const auto& List, int N, class P, int States = 0>
struct EffectValues {
  static constexpr const auto& parameters = List;

  static constexpr int size(int k) noexcept { return List[std::size_t(k)].per_tube ? N : 1; }
  /// Place of parameter k's value for a tube.
  static constexpr int place(int k, int tube = 0) noexcept {
    for (int j = 0; j < k; ++j) tube += size(j);
    return tube;
  }
  static constexpr int count = place(int(List.size()));

  static constexpr int states = States;
  using Past = EffectPast<States, P>;

  std::array<P, std::size_t(count)> values = neutral();
  Past past{};
  bool active = true;  ///< false: changes nothing, nor has derivatives, so that its hooks need not be called

  /// Parameter K; that of a tube, from 0, if it is per tube.
  template <int K>
  [[nodiscard]] constexpr const P& get(int tube = 0) const noexcept {
    constexpr int first = place(K);
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
