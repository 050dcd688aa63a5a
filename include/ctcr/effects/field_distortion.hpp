#pragma once
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/frame_algebra.hpp"

namespace ctcr {
namespace field_distortion {
inline constexpr EffectInfo info{
    .id = "field_distortion",
    .title = "Distorted field of the tracker",
    .physics =
        "Metal near an electromagnetic tracker bends its field: readings are off by an amount that depends on where "
        "the sensor is.",
    .signature = "The same place read with other joints has the same error.",
    .measure = "Read known points of a plate; move the robot base within the field.",
    .look_alikes = "sensor_offset precurvature_profile",
    .reference = "Hummel et al. 2005; Harish et al.",
};
inline constexpr std::array parameters{
    EffectParameter{.name = "scale",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.003,
                    .soft_low = -0.01,
                    .soft_high = 0.01,
                    .hard_low = -0.1,
                    .hard_high = 0.1,
                    .meaning = "relative"},
    EffectParameter{.name = "x_xx",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along x at 50 mm from the centre, x times x"},
    EffectParameter{.name = "x_yy",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along x at 50 mm from the centre, y times y"},
    EffectParameter{.name = "x_zz",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along x at 50 mm from the centre, z times z"},
    EffectParameter{.name = "x_xy",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along x at 50 mm from the centre, x times y"},
    EffectParameter{.name = "x_xz",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along x at 50 mm from the centre, x times z"},
    EffectParameter{.name = "x_yz",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along x at 50 mm from the centre, y times z"},
    EffectParameter{.name = "y_xx",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along y at 50 mm from the centre, x times x"},
    EffectParameter{.name = "y_yy",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along y at 50 mm from the centre, y times y"},
    EffectParameter{.name = "y_zz",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along y at 50 mm from the centre, z times z"},
    EffectParameter{.name = "y_xy",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along y at 50 mm from the centre, x times y"},
    EffectParameter{.name = "y_xz",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along y at 50 mm from the centre, x times z"},
    EffectParameter{.name = "y_yz",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along y at 50 mm from the centre, y times z"},
    EffectParameter{.name = "z_xx",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along z at 50 mm from the centre, x times x"},
    EffectParameter{.name = "z_yy",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along z at 50 mm from the centre, y times y"},
    EffectParameter{.name = "z_zz",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along z at 50 mm from the centre, z times z"},
    EffectParameter{.name = "z_xy",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along z at 50 mm from the centre, x times y"},
    EffectParameter{.name = "z_xz",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along z at 50 mm from the centre, x times z"},
    EffectParameter{.name = "z_yz",
                    .unit = "m",
                    .neutral = 0,
                    .sigma = 0.0003,
                    .soft_low = -0.001,
                    .soft_high = 0.001,
                    .meaning = "displacement along z at 50 mm from the centre, y times z"},
};
}  // namespace field_distortion

/// Readings distorted by metal near the tracker: a scale and a quadratic field of the position read, about the centre of
/// all readings.
template <int N, class P = double>
struct FieldDistortion : EffectValues<field_distortion::parameters, N, P> {
  static constexpr const EffectInfo& info = field_distortion::info;

  void sense(const Occasion& at, Frame<P>& reading) const noexcept {
    constexpr double unit = 0.05;
    const Triple<P> p = position_of(reading);
    Triple<P> x, by;
    for (std::size_t i = 0; i < 3; ++i) x[i] = (p[i] - at.centre[Eigen::Index(i)]) * (1 / unit);
    const P products[6] = {x[0] * x[0], x[1] * x[1], x[2] * x[2], x[0] * x[1], x[0] * x[2], x[1] * x[2]};
    for (std::size_t i = 0; i < 3; ++i) {
      by[i] = this->values[0] * (unit * x[i]);
      for (std::size_t k = 0; k < 6; ++k) by[i] = by[i] + this->values[1 + 6 * i + k] * products[k];
    }
    shift(reading, by);
  }
};

}  // namespace ctcr
