#pragma once
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/frame_algebra.hpp"

namespace ctcr {
namespace sensor_offset {
inline constexpr EffectInfo info{
    .id = "sensor_offset",
    .title = "Sensor beside the tip",
    .physics = "The coil stands off the tip of the tube and is turned against it.",
    .signature = "A constant lever arm in the frame of the tip.",
    .measure = "Turn the innermost tube alone; record the orientation too.",
    .look_alikes = "precurvature_profile helical_precurvature field_distortion",
    .reference = "Hummel et al. 2005",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "x",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.001,
                    .soft_low = -0.003,
                    .soft_high = 0.003,
                    .hard_low = -0.03,
                    .hard_high = 0.03,
                    .meaning = "tube frame at its tip"},
    EffectParameter{.name = "y",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.001,
                    .soft_low = -0.003,
                    .soft_high = 0.003,
                    .hard_low = -0.03,
                    .hard_high = 0.03,
                    .meaning = "tube frame at its tip"},
    EffectParameter{.name = "z",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.001,
                    .soft_low = -0.003,
                    .soft_high = 0.003,
                    .hard_low = -0.03,
                    .hard_high = 0.03,
                    .meaning = "along the tube"},
    EffectParameter{.name = "turn_x",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.017,
                    .soft_low = -0.05,
                    .soft_high = 0.05,
                    .hard_low = -0.5,
                    .hard_high = 0.5,
                    .meaning = "of the sensor against the tip"},
    EffectParameter{.name = "turn_y",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.017,
                    .soft_low = -0.05,
                    .soft_high = 0.05,
                    .hard_low = -0.5,
                    .hard_high = 0.5,
                    .meaning = "of the sensor against the tip"},
    EffectParameter{.name = "turn_z",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.017,
                    .soft_low = -0.05,
                    .soft_high = 0.05,
                    .hard_low = -3.2,
                    .hard_high = 3.2,
                    .meaning = "of the sensor about the tube"},
};
}  // namespace sensor_offset

/// The sensor is not where the tip is, and not turned as it is: T_tip_sensor.
template <int N, class P = double>
struct SensorOffset : EffectValues<sensor_offset::parameters, N, P> {
  static constexpr const EffectInfo& info = sensor_offset::info;

  void sense(const Occasion&, Frame<P>& reading) const noexcept {
    reading =
        composed(reading, displacement<P>({this->template get<0>(), this->template get<1>(), this->template get<2>()},
                                          {this->template get<3>(), this->template get<4>(), this->template get<5>()}));
  }
};

}  // namespace ctcr
