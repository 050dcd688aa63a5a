#pragma once
// Frames that carry derivatives: made, composed and moved. Real time: yes, all of it.
#include <array>

#include "ctcr/math/se3.hpp"

namespace ctcr {

template <class S>
using Triple = std::array<S, 3>;

/// a - b.
template <class S>
Triple<S> difference(const Triple<S>& a, const Triple<S>& b) noexcept {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

/// A pose without derivatives.
template <class S>
Frame<S> frame_of(const Pose& T) noexcept {
  Frame<S> f{};
  const Mat3& R = T.rotation;
  f.x = Lanes{R(0, 0), R(1, 0), R(2, 0), 0};
  f.y = Lanes{R(0, 1), R(1, 1), R(2, 1), 0};
  f.z = Lanes{R(0, 2), R(1, 2), R(2, 2), 0};
  f.p = Lanes{T.position[0], T.position[1], T.position[2], 0};
  if constexpr (is_dual<S>)
    for (int i = 0; i < 3; ++i)
      for (std::size_t g = 0; g < std::size_t(groups_of<S>); ++g)
        f.rotation_twist[i][g] = f.translation_twist[i][g] = Lanes{};
  return f;
}

template <class S>
Pose pose_of(const Frame<S>& f) noexcept {
  return {f.rotation(), f.position()};
}

/// A translation by `p` after a rotation by the rotation vector `o`: coordinates x become exp(o) x + p.
template <class S>
Frame<S> displacement(const Triple<S>& p, const Triple<S>& o) noexcept {
  const Triple<S> zero{0.0, 0.0, 0.0};
  Frame<S> f = frame_of<S>(Pose{Mat3::Identity(), Vec3::Zero()});
  const S none[3] = {zero[0], zero[1], zero[2]}, turn[3] = {o[0], o[1], o[2]};
  move_by_exponential(f, none, p[0], p[1], p[2]);
  move_by_exponential(f, turn, zero[0], zero[1], zero[2]);
  return f;
}

/// a b: first b, then a.
template <class S>
Frame<S> composed(const Frame<S>& a, const Frame<S>& b) noexcept {
  const Mat3 Ra = a.rotation(), Rb = b.rotation();
  Frame<S> f = frame_of<S>({Ra * Rb, Ra * b.position() + a.position()});
  if constexpr (is_dual<S>) {
    const Vec3 p = b.position();
    for (std::size_t g = 0; g < std::size_t(groups_of<S>); ++g) {
      const auto &w = a.rotation_twist, &v = a.translation_twist;
      const Lanes moved[3] = {v[0][g] + w[1][g] * p[2] - w[2][g] * p[1], v[1][g] + w[2][g] * p[0] - w[0][g] * p[2],
                              v[2][g] + w[0][g] * p[1] - w[1][g] * p[0]};
      for (int i = 0; i < 3; ++i) {
        f.rotation_twist[i][g] = b.rotation_twist[i][g] + Rb(0, i) * w[0][g] + Rb(1, i) * w[1][g] + Rb(2, i) * w[2][g];
        f.translation_twist[i][g] =
            b.translation_twist[i][g] + Rb(0, i) * moved[0] + Rb(1, i) * moved[1] + Rb(2, i) * moved[2];
      }
    }
  }
  return f;
}

/// The position of a frame, in the outer coordinates.
template <class S>
Triple<S> position_of(const Frame<S>& f) noexcept {
  Triple<S> p{f.p[0], f.p[1], f.p[2]};
  if constexpr (is_dual<S>) {
    const Mat3 R = f.rotation();
    for (int i = 0; i < 3; ++i)
      for (int g = 0; g < groups_of<S>; ++g)
        for (int j = 0; j < 3; ++j) p[std::size_t(i)].d[g] += R(i, j) * f.translation_twist[j][g];
  }
  return p;
}

/// Shifts a frame in the outer coordinates.
template <class S>
void shift(Frame<S>& f, const Triple<S>& by) noexcept {
  f.p += Lanes{value(by[0]), value(by[1]), value(by[2]), 0};
  if constexpr (is_dual<S>) {
    const Mat3 R = f.rotation();
    for (int j = 0; j < 3; ++j)
      for (int g = 0; g < groups_of<S>; ++g)
        for (int i = 0; i < 3; ++i) f.translation_twist[j][g] += R(i, j) * by[std::size_t(i)].d[g];
  }
}

/// Turns a frame where it is by a rotation vector in the outer coordinates.
template <class S>
void turn_in_place(Frame<S>& f, const Triple<S>& by) noexcept {
  const Triple<S> at = position_of(f);
  shift(f, {-at[0], -at[1], -at[2]});
  f = composed(displacement<S>({0.0, 0.0, 0.0}, by), f);
  shift(f, at);
}

}  // namespace ctcr
