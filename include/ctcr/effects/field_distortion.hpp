#pragma once
#include <algorithm>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/effects/metal_distortion.hpp"
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
    .measure =
        "Read known points of a plate; move the robot base within the field; look for metal where metal_x, metal_y and "
        "metal_z say.",
    .look_alikes = "sensor_offset precurvature_profile",
    .reference = "Hummel et al. 2005; Jackson, Classical Electrodynamics",
    .variants = {{"scale", "scale"}, {"scale", "z_yz"}, {"metal_volume", "coils_z"}, {"scale", "turn_z_yz"}},
};

/// Of a displacement along the axis that its name begins with [m], or of a turn about it [rad].
consteval EffectParameter coefficient(std::string_view name, double sigma, Role role) {
  const bool turn = name.starts_with("turn");
  return {.name = name,
          .unit = turn ? "rad" : "m",
          .neutral = 0,
          .sigma = sigma,
          .soft = {turn ? -0.02 : -0.001, turn ? 0.02 : 0.001},
          .role = role,
          .meaning = turn ? "turn about the first axis at 50 mm from the centre, by the product of the others"
                          : "displacement along the first axis at 50 mm from the centre, by the product of the others"};
}

inline constexpr std::string_view quadratic[] = {"x_xx", "x_yy", "x_zz", "x_xy", "x_xz", "x_yz",
                                                 "y_xx", "y_yy", "y_zz", "y_xy", "y_xz", "y_yz",
                                                 "z_xx", "z_yy", "z_zz", "z_xy", "z_xz", "z_yz"};
inline constexpr std::string_view shear[] = {"x_x", "y_y", "x_y", "x_z", "y_z"};
inline constexpr std::string_view cubic[] = {"x_xxx", "x_yyy", "x_zzz", "x_xxy", "x_xxz", "x_xyy", "x_yyz", "x_xzz",
                                             "x_yzz", "x_xyz", "y_xxx", "y_yyy", "y_zzz", "y_xxy", "y_xxz", "y_xyy",
                                             "y_yyz", "y_xzz", "y_yzz", "y_xyz", "z_xxx", "z_yyy", "z_zzz", "z_xxy",
                                             "z_xxz", "z_xyy", "z_yyz", "z_xzz", "z_yzz", "z_xyz"};
inline constexpr std::string_view turn[] = {
    "turn_x_x",  "turn_x_y",  "turn_x_z",  "turn_y_x",  "turn_y_y",  "turn_y_z",  "turn_z_x",
    "turn_z_y",  "turn_z_z",  "turn_x_xx", "turn_x_yy", "turn_x_zz", "turn_x_xy", "turn_x_xz",
    "turn_x_yz", "turn_y_xx", "turn_y_yy", "turn_y_zz", "turn_y_xy", "turn_y_xz", "turn_y_yz",
    "turn_z_xx", "turn_z_yy", "turn_z_zz", "turn_z_xy", "turn_z_xz", "turn_z_yz"};

consteval EffectParameter coordinate(std::string_view name, double usual, double sigma, std::string_view meaning) {
  return {.name = name,
          .unit = "m",
          .neutral = usual,
          .sigma = sigma,
          .soft = {-1, 1},
          .hard = {-3, 3},
          .role = Role::shape,
          .quantity = Quantity::source,
          .meaning = meaning};
}

inline constexpr EffectParameter metal[] = {
    {.name = "metal_volume",
     .unit = "m^3",
     .neutral = 0,
     .sigma = 1e-5,
     .soft = {-1e-3, 1e-3},
     .hard = {-0.1, 0.1},
     .role = Role::detail,
     .quantity = Quantity::source,
     .meaning = "of a small piece of metal beside the tracker; negative: of iron that strengthens the field"},
    coordinate("metal_x", 0.1, 0.3, "of the piece of metal, tracker frame"),
    coordinate("metal_y", 0.1, 0.3, "the same"),
    coordinate("metal_z", -0.1, 0.3, "the same"),
    coordinate("coils_x", 0, 0.05, "of the middle of the tracker's coils, tracker frame"),
    coordinate("coils_y", 0, 0.05, "the same"),
    coordinate("coils_z", 0, 0.05, "the same")};

consteval auto all() {
  constexpr std::size_t terms = 1 + std::size(quadratic) + std::size(shear) + std::size(cubic) + std::size(turn);
  std::array<EffectParameter, terms + std::size(metal)> list;
  list[0] = {.name = "scale",
             .unit = "",
             .neutral = 0,
             .sigma = 0.003,
             .soft = {-0.01, 0.01},
             .hard = {-0.1, 0.1},
             .meaning = "relative"};
  std::size_t k = 1;
  for (const auto& name : quadratic) list[k++] = coefficient(name, 3e-4, Role::amplitude);
  for (const auto& name : shear) list[k++] = coefficient(name, 2e-4, Role::detail);
  for (const auto& name : cubic) list[k++] = coefficient(name, 1e-4, Role::detail);
  for (const auto& name : turn) list[k++] = coefficient(name, 3e-3, Role::detail);
  for (const auto& parameter : metal) list[k++] = parameter;
  return list;
}
inline constexpr auto parameters = all();
}  // namespace field_distortion

/// Readings distorted by metal near the tracker: a scale and a quadratic field of the position read, about the centre of
/// all readings. Its details are a shear, terms of third order, a field by which readings are turned, and one small piece
/// of metal.
template <int N, class P = double>
struct FieldDistortion : EffectValues<field_distortion::parameters, N, P> {
  static constexpr const EffectInfo& info = field_distortion::info;

  void sense(const Occasion& at, Frame<P>& reading) const noexcept {
    constexpr double unit = 0.05;
    const Triple<P> p = position_of(reading);
    Triple<P> v, by;
    for (std::size_t i = 0; i < 3; ++i) v[i] = (p[i] - at.centre[Eigen::Index(i)]) * (1 / unit);
    const auto& [x, y, z] = v;
    const P square[6] = {x * x, y * y, z * z, x * y, x * z, y * z};
    for (std::size_t i = 0; i < 3; ++i) {
      by[i] = this->values[0] * (unit * v[i]);
      for (std::size_t k = 0; k < 6; ++k) by[i] = by[i] + this->values[1 + 6 * i + k] * square[k];
    }
    const auto detail = this->values.begin() + 1 + std::size(field_distortion::quadratic);
    if (std::all_of(detail, this->values.end(), [](const P& c) { return vanishes(c); })) return shift(reading, by);

    const auto &xx = detail[0], &yy = detail[1], &xy = detail[2], &xz = detail[3], &yz = detail[4];
    by[0] = by[0] + xx * x + xy * y + xz * z;
    by[1] = by[1] + xy * x + yy * y + yz * z;
    by[2] = by[2] + xz * x + yz * y - (xx + yy) * z;  // the scale is the rest
    const P cube[10] = {square[0] * x, square[1] * y, square[2] * z, square[0] * y, square[0] * z,
                        square[1] * x, square[1] * z, square[2] * x, square[2] * y, square[3] * z};
    const auto third = detail + std::size(field_distortion::shear), turn = third + std::size(field_distortion::cubic);
    Triple<P> rotation;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t k = 0; k < 10; ++k) by[i] = by[i] + third[10 * i + k] * cube[k];
      rotation[i] = turn[3 * i] * x + turn[3 * i + 1] * y + turn[3 * i + 2] * z;
      for (std::size_t k = 0; k < 6; ++k) rotation[i] = rotation[i] + turn[9 + 6 * i + k] * square[k];
    }
    const P* const piece = turn + std::size(field_distortion::turn);
    if (!vanishes(piece[0])) {
      const Triple<P> metal{piece[1], piece[2], piece[3]}, coils{piece[4], piece[5], piece[6]};
      const ReadingError<P> off = metal_distortion<P>(difference(p, coils), difference(metal, coils), piece[0]);
      for (std::size_t i = 0; i < 3; ++i) {
        by[i] = by[i] + off.shift[i];
        rotation[i] = rotation[i] + off.turn[i];
      }
    }
    shift(reading, by);
    turn_in_place(reading, rotation);
  }
};

}  // namespace ctcr
