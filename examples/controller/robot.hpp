// The robot "table2": tubes, homes, frames, effects and limits, and the model of them.
// Exported by ctcr 0.1.0 on 2026-11-30 from "table2.yaml": change that, not this header.
// sha256 of the file: 5d81dc0b9c06a0d1f05f198b27c4a91fbd536aa127f52d31d6e38b3df3063de5
// SI units; tubes from the innermost outwards. `sd`: standard deviation of a value that was fitted.
// clang-format off
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <ctcr/control/limits.hpp>
#include <ctcr/ctcr.hpp>

#ifdef robot
#error "robot is a macro here: export the robot with another --namespace"
#endif
namespace robot {

inline constexpr int tube_count = 3;

inline constexpr std::array<ctcr::Tube, tube_count> tubes{{
    {
        .youngs_modulus = 58000000000.0,
        .poisson_ratio = 0.3,
        .density = 6450.0,
        .inner_diameter = 0.0013,
        .outer_diameter = 0.00152,
        .length = 0.463,
        .curved_length = 0.05,
        .curvature = 10.0,
        .bending_stiffness = 0.0,
    },
    {
        .youngs_modulus = 58000000000.0,
        .poisson_ratio = 0.3,
        .density = 6450.0,
        .inner_diameter = 0.00162,
        .outer_diameter = 0.0018,
        .length = 0.3305,
        .curved_length = 0.05,
        .curvature = 5.0,
        .bending_stiffness = 0.0,
    },
    {
        .youngs_modulus = 58000000000.0,
        .poisson_ratio = 0.3,
        .density = 6450.0,
        .inner_diameter = 0.00203,
        .outer_diameter = 0.00235,
        .length = 0.199,
        .curved_length = 0.05,
        .curvature = 7.0,
        .bending_stiffness = 0.0,
    },
}};

inline constexpr std::array<double, 3> gravity{  // base frame [m/s^2]
    0.0,
    -9.80665,
    0.0,
};
inline constexpr double translation_ratio = 0.000318309886183791;  // beta by motor angle [m/rad]
inline constexpr double rotation_ratio = -1.0;  // alpha by motor angle [rad/rad]
inline constexpr std::array<double, 3> home_translation{  // beta where the motors are at 0 [m]
    -0.298,
    -0.2205,
    -0.145,
};
inline constexpr std::array<double, 3> home_rotation{  // alpha where the motors are at 0 [rad]
    0.0,
    0.0,
    0.0,
};
inline constexpr std::array<double, 3> tracker_position{  // of the base frame in the tracker frame [m]
    -0.06,
    0.02,
    -0.18,
};
inline constexpr std::array<double, 3> tracker_rotation{  // its rotation vector there [rad]
    0.0,
    1.2,
    0.3,
};
inline constexpr int sensor_tube = 0;  // whose tip carries the sensor, from 0
inline constexpr std::array<double, 3> sensor_position{  // of the sensor in the frame of that tip [m]
    0.0,
    0.0,
    0.0,
};
inline constexpr std::array<double, 3> sensor_rotation{  // its rotation vector there [rad]
    0.0,
    0.0,
    0.0,
};

using Effects = ctcr::Standard;  // none beyond the standard model

/// The robot with its effects, motors and tracker, ready for a controller; share it between threads.
[[nodiscard]] inline ctcr::System<tube_count, Effects> system() noexcept {
  using Vector = ctcr::VecN<tube_count>;
  const ctcr::Robot<tube_count> tubes_and_gravity{tubes, ctcr::Vec3(gravity.data())};
  const ctcr::Transmission<tube_count> transmission{
      translation_ratio, rotation_ratio, Vector(home_translation.data()), Vector(home_rotation.data())};
  const ctcr::PoseSensor sensor{
      {ctcr::rotation_matrix(ctcr::Vec3(tracker_rotation.data())), ctcr::Vec3(tracker_position.data())},
      sensor_tube,
      {ctcr::rotation_matrix(ctcr::Vec3(sensor_rotation.data())), ctcr::Vec3(sensor_position.data())}};
  Effects::On<tube_count> effects;
  return {transmission, ctcr::Model<tube_count, Effects>(tubes_and_gravity, effects), sensor};
}

/// What no step of a controller may violate.
/// The library's own: a robot file knows none. `ctcr export --bench FILE` takes those of a bench.
[[nodiscard]] inline ctcr::Limits<tube_count> limits() noexcept { return {}; }

}  // namespace robot
