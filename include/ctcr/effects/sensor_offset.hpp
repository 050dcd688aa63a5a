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
    .variants = {{"x", "z"}, {"x", "turn_z"}},
};
inline constexpr EffectParameter offset{
    .name = {}, .unit = "m", .neutral = 0, .sigma = 0.001, .soft = {-0.003, 0.003}, .hard = {-0.03, 0.03}};
consteval EffectParameter turn(std::string_view name, double limit, std::string_view meaning) {
  return {.name = name,
          .unit = "rad",
          .neutral = 0,
          .sigma = 0.017,
          .soft = {-0.05, 0.05},
          .hard = {-limit, limit},
          .meaning = meaning};
}
inline constexpr std::array parameters{offset.named("x", "tube frame at its tip"),
                                       offset.named("y", "tube frame at its tip"),
                                       offset.named("z", "along the tube"),
                                       turn("turn_x", 0.5, "of the sensor against the tip"),
                                       turn("turn_y", 0.5, "of the sensor against the tip"),
                                       turn("turn_z", 3.2, "of the sensor about the tube")};
}  // namespace sensor_offset

/// Deviation of the sensor from PoseSensor::T_tip_sensor: displacement and rotation in the axes of the tip.
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
