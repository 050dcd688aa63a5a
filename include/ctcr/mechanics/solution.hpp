#pragma once
#include <array>
#include <limits>

#include "ctcr/core/status.hpp"
#include "ctcr/core/types.hpp"
#include "ctcr/mechanics/evaluation.hpp"
#include "ctcr/mechanics/settings.hpp"

namespace ctcr {

/// The answer of a solve or a step. Every field is defined whatever the status.
template <int N>
struct Solution {
  Status status = Status::not_converged;
  int iterations = 0;                                         ///< evaluations used
  double residual = std::numeric_limits<double>::infinity();  ///< ||b|| [rad]
  double stability = 0;  ///< det B_u: 1 without interaction between tubes or load, 0 where the robot snaps or buckles
  /// Estimated error of the tip position by the steps of integration [m], as found where it was last checked: at a solve,
  /// and again whenever the robot has moved far. Infinity: not checked.
  double integration_error = std::numeric_limits<double>::infinity();
  /// Whether the equilibrium lies on the branch of the warm start's, which the robot follows if it moves from there without
  /// a snap. False: that is not known, as after a cold start, a snap, or a motion too far to tell.
  bool kept_branch = false;

  Vec3 position = Vec3::Zero();      ///< tip, base frame [m]
  Mat3 rotation = Mat3::Identity();  ///< R_base_tip: material frame of tube 1 at its tip
  std::array<Pose, N> tube_tips{};   ///< T_base_tip of each tube, material frame

  /// J: rows tip velocity [m], angular velocity [rad], base frame; columns beta_1..N [m], alpha_1..N [rad].
  Eigen::Matrix<double, 6, 2 * N> jacobian = Eigen::Matrix<double, 6, 2 * N>::Zero();
  /// C: rows as J; columns tip force [N], tip moment [N m], base frame.
  Mat6 compliance = Mat6::Zero();

  [[nodiscard]] Pose pose() const noexcept { return {rotation, position}; }
};

/// Where a solve may begin: a guess, and what is known of the equilibrium there. A solve nearby does not check that again.
/// Joints, load and parameters of the robot may all have changed.
template <int N>
struct WarmStart {
  TipGuess<N> guess;
  Joints<N> q;  ///< joints and load that the guess belongs to
  TipLoad load;
  bool stable = false;  ///< whether the guess describes a stable equilibrium that is not about to snap
  Steps<N> steps;       ///< integration steps that the guess belongs to
  /// Error of the tip position by these steps [m], and how far the robot has moved since it was found: turns of the tip
  /// and of the tubes [rad], travel as a part of the robot's length.
  double integration_error = std::numeric_limits<double>::infinity(), moved = 0;
};

/// Scratch and warm start of one thread. Reused from call to call; nothing is allocated. reset() it before it serves another
/// robot, which may be unstable where this one is stable.
template <int N>
struct Workspace : WarmStart<N> {
  bool warm = false;          ///< whether the guess may be used
  bool knows_joints = false;  ///< whether the change of the guess with the joints is known
  bool knows_load = false;    ///< and with the load
  /// Change of the unknowns (turn of the tip in base axes, psi_2..N) by beta, alpha, force, moment.
  Eigen::Matrix<double, N + 2, 2 * N + 6> sensitivity = Eigen::Matrix<double, N + 2, 2 * N + 6>::Zero();

  void reset() noexcept {
    begin_at(WarmStart<N>{});
    warm = false;
  }
  /// Lets the next solve begin there, whatever was solved before.
  void begin_at(const WarmStart<N>& start) noexcept {
    static_cast<WarmStart<N>&>(*this) = start;
    warm = true;
    knows_joints = knows_load = false;
  }
  /// The same for a guess of which nothing else is known.
  void begin_at(const TipGuess<N>& other) noexcept {
    WarmStart<N> start;
    start.guess = other;
    begin_at(start);
  }
};

}  // namespace ctcr
