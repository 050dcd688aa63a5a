#pragma once
// Outputs are defined whatever comes of a solve: finite, rotations that are rotations, positions within reach.
// Real time: yes, all of it.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "ctcr/mechanics/solution.hpp"
#include "ctcr/robot/joints.hpp"

namespace ctcr::detail {

/// How far beyond the length of the robot a position may be [m]: check_joints() forgives 1e-6 a tube.
template <int N>
inline constexpr double reach_slack = N * 1e-6;
/// Entries of R R^T - I above which a rotation is orthonormalised; one integration leaves 1e-15.
inline constexpr double rotation_error = 1e-13;
/// Entries of R R^T - I above which R is no rotation: no result that was computed with it can be trusted.
inline constexpr double no_rotation = 1e-6;
/// Part of the reach by which a position may go beyond it: the linear correction of a step of 0.1 rad moves a straight
/// robot by half of it. Where segments bend by radians, one step each can leave tips of outer tubes farther away than they
/// can be: then the integration has no meaning.
inline constexpr double overreach = 0.01;

/// A blank answer with a status; the count of evaluations stays.
template <int N>
inline Status blank(Status status, Solution<N>& out) noexcept {
  const int iterations = out.iterations;
  out = Solution<N>{};
  out.iterations = iterations;
  return out.status = status;
}

/// How far from the plate any tip can be: the length of the robot [m].
template <int N>
CTCR_INLINE double reach_of(const Robot<N>& robot, const Joints<N>& q) noexcept {
  return std::max(0.0, robot.tubes[0].length + q.beta[0]);
}

/// Four doubles from memory.
CTCR_INLINE Lanes four_at(const double* x) noexcept {
  Lanes r;
  std::memcpy(&r, x, sizeof r);
  return r;
}

/// Whether all that a solve with D writes is finite, rotations are rotations and tips are within reach [m]. The
/// cheap test of every solve: no branches, and false alarms only where numbers are beyond 1e75.
template <Derivatives D, int N>
CTCR_INLINE bool are_defined(const Solution<N>& out, double reach) noexcept {
  static_assert(sizeof(Pose) == 12 * sizeof(double), "columns of the rotation, then the position");
  const Lanes one{1, 1, 1, 1};
  Lanes error{};  // squares of the entries of R R^T - I; its last lane means nothing, but is finite
  double farthest = 0;
  for (const Pose& tip : out.tube_tips) {
    const double* x = tip.rotation.data();
    const Lanes a = four_at(x), b = four_at(x + 3), c = four_at(x + 6);
    const auto turned = [](const Lanes& v) { return Lanes{v[1], v[2], v[0], v[3]}; };
    const Lanes diagonal = a * a + (b * b + (c * c - one));
    const Lanes beside = a * turned(a) + (b * turned(b) + c * turned(c));
    error += diagonal * diagonal;
    error += beside * beside;
    error += four_at(x + 8) * 0.0;
    const double distance = tip.position.squaredNorm();
    farthest = farthest > distance ? farthest : distance;
  }
  double sum = error[0] + error[1] + error[2] + 0.0 * (error[3] + out.stability + out.residual);
  if constexpr (D != Derivatives::none) sum += 0.0 * (out.jacobian * 0.0).sum();
  if constexpr (D == Derivatives::compliance) sum += 0.0 * (out.compliance * 0.0).sum();
  const double limit = reach + reach_slack<N>;
  return sum < rotation_error * rotation_error && farthest <= limit * limit;
}

/// Length of a vector, also where the squares of its components overflow.
inline double length_of(const Vec3& v) noexcept { return std::hypot(v[0], v[1], v[2]); }

/// The axes of R made perpendicular, of length 1 and right-handed, one after the other.
inline Mat3 orthonormalised(const Mat3& R) noexcept {
  const auto normalised = [](const Vec3& v) -> Vec3 { return v / length_of(v); };
  Vec3 x = normalised(R.col(0));
  if (!(x.squaredNorm() > 0.5)) x = Vec3::UnitX();
  Vec3 y = normalised(R.col(1));
  for (int i = 0; i < 2; ++i) {
    y -= x * x.dot(y);
    if (!(y.squaredNorm() > 1e-16)) y = x.unitOrthogonal();
    y.normalize();
  }
  Mat3 r;
  r << x, y, x.cross(y);
  return r;
}

/// Makes a pose one: its rotation, and its position within reach. @return whether it was far from one
template <int N>
inline bool define(Mat3& rotation, Vec3& position, double reach, double drift) noexcept {
  const double error = (rotation * rotation.transpose() - Mat3::Identity()).cwiseAbs().maxCoeff();
  const double distance = length_of(position);
  if (!(error <= rotation_error)) rotation = orthonormalised(rotation);
  if (distance > reach + reach_slack<N>) position *= reach / distance;
  return !(error <= drift) || distance > (1 + overreach) * reach + reach_slack<N>;
}

/// Makes all outputs defined: blank where they are not finite, else the nearest possible poses. An equilibrium that needs a
/// correction beyond rounding does not count as one.
/// @param reach  of the robot [m]   @param drift  of a rotation that the scheme of integration leaves
/// @return the status
template <int N>
CTCR_NOINLINE Status define(Solution<N>& out, double reach, double drift, Workspace<N>& ws) noexcept {
  bool finite =
      all_finite(out.position, out.rotation, out.jacobian, out.compliance) && 0.0 * (out.residual + out.stability) == 0;
  for (const Pose& tip : out.tube_tips) finite = finite && all_finite(tip.position, tip.rotation);
  if (!finite) {
    ws.reset();
    return blank(Status::not_finite, out);
  }
  bool far = define<N>(out.rotation, out.position, reach, drift);
  for (Pose& tip : out.tube_tips) far = define<N>(tip.rotation, tip.position, reach, drift) || far;
  if (ws.warm) ws.guess.rotation = orthonormalised(ws.guess.rotation);
  if (far) ws.reset();
  return far && has_equilibrium(out.status) ? Status::not_converged : out.status;
}

}  // namespace ctcr::detail
