#pragma once
// The one list of the named numbers that describe a robot and its devices. Whatever speaks of a parameter
// (derivatives, calibration, the Python module) takes its name, unit and index in a vector from here.
#include <array>
#include <cstddef>
#include <limits>
#include <string_view>

#include "ctcr/robot/tube.hpp"

namespace ctcr {

/// Kinds of parameters, in the order of parameter_kinds.
enum class Parameter : int {
  youngs_modulus,
  poisson_ratio,
  density,
  inner_diameter,
  outer_diameter,
  length,
  curved_length,
  curvature,
  bending_stiffness,
  gravity,
  translation_ratio,
  rotation_ratio,
  home_translation,
  home_rotation,
  tracker_position,
  tracker_rotation,
  sensor_position,
  sensor_rotation
};

/// A kind of parameter: its properties in every robot.
struct ParameterKind {
  std::string_view name;           ///< '#' stands for the number of a tube, innermost 1, '*' for x, y or z
  std::string_view unit;           ///< SI; empty: a pure number
  double low, high;                ///< plausible magnitude, in that unit
  double Tube::* field = nullptr;  ///< where a Tube keeps it
  double lowest = -std::numeric_limits<double>::infinity(),
         highest = std::numeric_limits<double>::infinity();  ///< possible
};

/// The tracker frame is T_ref, from base to tracker coordinates, and the sensor's pose is T_tip_sensor. Rotations of both
/// are turns that leave the origin where it is: {exp(turn) R, p}, about the axes of the tracker and of the tip.
inline constexpr std::array<ParameterKind, 18> parameter_kinds{{
    {"tubes.#.youngs_modulus", "Pa", 1e9, 250e9, &Tube::youngs_modulus, 0},
    {"tubes.#.poisson_ratio", "", 0.2, 0.5, &Tube::poisson_ratio, -0.9, 0.5},
    {"tubes.#.density", "kg/m^3", 800, 20000, &Tube::density, 0},
    {"tubes.#.inner_diameter", "m", 0.05e-3, 20e-3, &Tube::inner_diameter},
    {"tubes.#.outer_diameter", "m", 0.1e-3, 20e-3, &Tube::outer_diameter, 0},
    {"tubes.#.length", "m", 5e-3, 2, &Tube::length, 0},
    {"tubes.#.curved_length", "m", 1e-3, 1, &Tube::curved_length, 0},
    {"tubes.#.curvature", "1/m", 0.1, 200, &Tube::curvature},
    {"tubes.#.bending_stiffness", "N m^2", 1e-5, 10, &Tube::bending_stiffness, 0},
    {"gravity.*", "m/s^2", 0, 9.9},
    {"actuation.translation_ratio", "m/rad", 1e-6, 2e-2},
    {"actuation.rotation_ratio", "", 1e-4, 10},
    {"actuation.home_translation.#", "m", 1e-4, 2},
    {"actuation.home_rotation.#", "rad", 0, 6.3},
    {"tracker.position.*", "m", 0, 5},
    {"tracker.rotation.*", "rad", 0, 6.3},
    {"tracker.sensor_position.*", "m", 0, 0.1},
    {"tracker.sensor_rotation.*", "rad", 0, 6.3},
}};

/// A full name such as "tubes.2.length".
struct ParameterName {
  std::array<char, 32> text{};
  std::size_t size = 0;
  constexpr operator std::string_view() const noexcept { return {text.data(), size}; }
};

/// The parameters of a robot with N tubes as one vector: kind after kind, and within a kind tube after tube or x, y, z.
/// Real time: yes.
template <int N>
struct ParameterVector {
  static_assert(N >= 1 && N <= 9, "a tube has one digit in a name");

private:
  /// Where each kind begins, and the end.
  static constexpr auto first = [] {
    std::array<int, parameter_kinds.size() + 1> first{};
    for (std::size_t k = 0; k < parameter_kinds.size(); ++k) {
      const std::string_view name = parameter_kinds[k].name;
      first[k + 1] = first[k] + (name.find('#') != name.npos ? N : name.find('*') != name.npos ? 3 : 1);
    }
    return first;
  }();

public:
  /// Entries of a kind.
  static constexpr int size(Parameter kind) noexcept { return first[std::size_t(kind) + 1] - first[std::size_t(kind)]; }
  /// Index of a kind's entry i: tube i + 1, or axis i.
  static constexpr int index(Parameter kind, int i = 0) noexcept { return first[std::size_t(kind)] + i; }
  static constexpr int robot_count = index(Parameter::translation_ratio, 0);  ///< those of Robot<N>: tubes and gravity
  static constexpr int count = index(Parameter(int(parameter_kinds.size())), 0);  ///< all

  /// The kind at an index, and the entry within it.
  struct Entry {
    Parameter kind;
    int i;
  };
  static constexpr Entry entry(int index) noexcept {
    int k = 0;
    while (index >= size(Parameter(k))) index -= size(Parameter(k++));
    return {Parameter(k), index};
  }
  static constexpr ParameterName name(int index) noexcept {
    const Entry e = entry(index);
    ParameterName name;
    for (const char c : info(e.kind).name)
      name.text[name.size++] = c == '#' ? char('1' + e.i) : c == '*' ? char('x' + e.i) : c;
    return name;
  }
  static constexpr const ParameterKind& info(Parameter kind) noexcept { return parameter_kinds[std::size_t(kind)]; }
};

}  // namespace ctcr
