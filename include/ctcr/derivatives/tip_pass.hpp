#pragma once
// One integration from the tip that differentiates the shooting equations and the pose of a tube's tip along some of
// everything that they depend on: unknowns, joints, tubes and gravity.
#include "ctcr/mechanics/solve.hpp"

namespace ctcr::detail {

/// Where the variables stand: unknowns first, then gravity; the load at the robot tip last.
/// @tparam Loaded  by the equations with load and weight, whether or not there are any
template <int N, bool Loaded>
struct TipVariables {
  static constexpr int turn = 0;              ///< of the tip (3), its own axes
  static constexpr int psi = Loaded ? 3 : 0;  ///< of tube 2
  static constexpr int unknowns = psi + N - 1;
  static constexpr int gravity = unknowns;
  static constexpr int beta = gravity + (Loaded ? 3 : 0);
  static constexpr int k = beta + N;  ///< then the others of TubeParameters, N of each
  static constexpr int kz = k + N, kappa = kz + N, length = kappa + N, curved_length = length + N;
  static constexpr int mass = curved_length + N;
  static constexpr int alpha = mass + (Loaded ? N : 0);
  static constexpr int load = alpha + N;  ///< force (3), moment (3), base axes
  static constexpr int count = load + (Loaded ? 6 : 0);

  static constexpr int pass_groups = 2;  ///< groups of four variables that one pass carries
  static constexpr int pass_lanes = pass_groups * lane_count;
  static constexpr int passes(int variables) { return (variables + pass_lanes - 1) / pass_lanes; }
  static constexpr int groups = passes(count) * pass_groups;

  using Row = LaneRow<groups>;
  static constexpr int rows = unknowns + 6;  ///< equations, then the pose
};

/// One integration that differentiates along pass_lanes of the variables.
template <int N, bool Loaded, class Stepper>
class TipPass {
  using V = TipVariables<N, Loaded>;
  static constexpr int G = V::pass_groups;
  using S = Dual<G>;
  struct WholeFrame {
    static constexpr bool jacobian = true;
  };
  using Rod = Shooting<N, S, S, S, Loaded, Loaded, Stepper, WholeFrame>;

public:
  /// @param first  the variables first..first + pass_lanes - 1 are differentiated along
  TipPass(const Robot<N>& robot, const Workspace<N>& at, int tube, int first) noexcept : first_(first) {
    const Coefficients<N, S> c = coefficients(robot);
    for (int i = 0; i < N; ++i) {
      beta_[std::size_t(i)] = variable(at.q.beta[i], V::beta + i);
      alpha_[std::size_t(i)] = variable(at.q.alpha[i], V::alpha + i);
    }
    for (int i = 0; i < 3; ++i) turn_[std::size_t(i)] = Loaded ? variable(0, V::turn + i) : S(0.0);
    const auto arc_length = [&](int event, double) noexcept {
      return event < N ? c.length[std::size_t(event)] + beta_[std::size_t(event)]
                       : c.curve_start[std::size_t(event - N)] + beta_[std::size_t(event - N)];
    };
    bool reached = false;
    const auto keep_tip = [&](double, const SegmentTubes<N>& tubes, const RobotState<S, N>& y,
                              const Frame<S>& frame) noexcept {
      if (reached || tubes.present <= tube) return;
      reached = true;
      tip_ = frame;
      tip_psi_ = y.psi[std::size_t(tube)];
    };
    base_ = state_at_tip(robot, at, c);
    TubeTips<N> tips;
    Rod::run(c, sort_events(c, at.q.beta), arc_length, 0.0, at.steps, base_, frame_, tips, keep_tip);
  }

  /// Writes the tangents of the equations and of the pose into the rows. The equations: the tip turns as
  /// its unknowns say, and angle_i - angle_1 = alpha_i - alpha_1.
  /// @return R_base_tip
  Mat3 write(typename V::Row (&row)[V::rows]) const noexcept {
    std::array<S, N> angle;
    for (std::size_t i = 0; i < N; ++i) angle[i] = base_.psi[i] + beta_[i] * base_.w[i];
    // T_base_tip = Rz(gamma) frame^-1, where gamma brings tube 1's base to alpha_1.
    const S gamma = alpha_[0] - angle[0];
    const Mat3 Rz = rotation_z(gamma.v);
    const Mat3 R_base_tip = Rz * frame_.rotation().transpose();
    const Mat3 R_base_tube = R_base_tip * tip_.rotation();
    const Vec3 p = R_base_tip * (tip_.position() - frame_.position());
    const Mat3 R_tip_base = R_base_tip.transpose();
    for (int g = 0; g < G; ++g) {
      const Lanes3 turn = about_z(gamma, g) - Rz * group(frame_.rotation_twist, g);
      const Lanes3 felt = R_tip_base * turn;
      const Lanes3 velocity =
          cross(turn, p) - Rz * group(frame_.translation_twist, g) + R_base_tube * group(tip_.translation_twist, g);
      const Lanes3 rotation = turn + R_base_tube * (group(tip_.rotation_twist, g) + about_z(tip_psi_, g));
      const int at = first_ / lane_count + g;
      for (std::size_t i = 0; i < 3; ++i) {
        if constexpr (Loaded) row[V::turn + int(i)].x[at] = felt[i] - turn_[i].d[g];
        row[V::unknowns + int(i)].x[at] = velocity[i];
        row[V::unknowns + 3 + int(i)].x[at] = rotation[i];
      }
      for (std::size_t i = 1; i < N; ++i)
        row[V::psi + int(i) - 1].x[at] = (angle[i] - angle[0] - alpha_[i] + alpha_[0]).d[g];
    }
    return R_base_tip;
  }

private:
  static CTCR_INLINE Lanes3 group(const Lanes (&twist)[3][G], int g) noexcept {
    return {twist[0][g], twist[1][g], twist[2][g]};
  }
  static CTCR_INLINE Lanes3 about_z(const S& angle, int g) noexcept { return {Lanes{}, Lanes{}, angle.d[g]}; }

  CTCR_INLINE S variable(double value, int column) const noexcept {
    S x = value;
    const int lane = column - first_;
    if (lane >= 0 && lane < V::pass_lanes) x.d[lane / lane_count] = unit_lane(lane % lane_count);
    return x;
  }

  Coefficients<N, S> coefficients(const Robot<N>& robot) const noexcept {
    std::array<TubeParameters<S>, N> tubes;
    for (int i = 0; i < N; ++i) {
      const Tube& t = robot.tubes[std::size_t(i)];
      tubes[std::size_t(i)] = {variable(t.EI(), V::k + i),
                               variable(t.GJ(), V::kz + i),
                               variable(t.curvature, V::kappa + i),
                               variable(t.length, V::length + i),
                               variable(t.curved_length, V::curved_length + i),
                               Loaded ? variable(t.mass_per_length(), V::mass + i) : S(0.0)};
    }
    Coefficients<N, S> c = make_coefficients<N, S>(tubes, robot.gravity);
    // A curvature that is zero still has derivatives by it.
    for (std::size_t i = 0; i < N; ++i) c.curved[i] = robot.tubes[i].curved_length > 0;
    return c;
  }

  /// A vector that is constant in the base frame as the tip frame R sees it: turning the tip by t changes it by . x t.
  std::array<S, 3> seen_from_tip(const Mat3& R, const std::array<S, 3>& v) const noexcept {
    std::array<S, 3> b, turned;
    for (int i = 0; i < 3; ++i) b[std::size_t(i)] = R(0, i) * v[0] + R(1, i) * v[1] + R(2, i) * v[2];
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      turned[i] = b[i] + (b[j] * turn_[k] - b[k] * turn_[j]);
    }
    return turned;
  }

  RobotState<S, N> state_at_tip(const Robot<N>& robot, const Workspace<N>& at,
                                const Coefficients<N, S>& c) const noexcept {
    RobotState<S, N> y;
    for (int i = 0; i < N; ++i) {
      y.psi[std::size_t(i)] = i == 0 ? S(at.guess.psi[0]) : variable(at.guess.psi[i], V::psi + i - 1);
      y.w[std::size_t(i)] = 0.0;
    }
    if constexpr (Loaded) {
      const auto seen = [&](const Vec3& v, int column) noexcept {
        return seen_from_tip(at.guess.rotation,
                             {variable(v[0], column), variable(v[1], column + 1), variable(v[2], column + 2)});
      };
      y.n = seen(at.load.force, V::load);
      const std::array<S, 3> moment = seen(at.load.moment, V::load + 3);
      y.m = {moment[0], moment[1]};
      y.w[0] = moment[2] * inverse(c.kz[0]);
      y.g = seen(robot.gravity, V::gravity);
    }
    return y;
  }

  int first_;
  std::array<S, N> beta_, alpha_;
  std::array<S, 3> turn_;  ///< unknown turn of the tip
  RobotState<S, N> base_;
  Frame<S> frame_, tip_;  ///< of the front plate and of the tube's tip, seen from the robot tip
  S tip_psi_;
};

}  // namespace ctcr::detail
