#pragma once
// One evaluation of the shooting problem of a robot with effects: as evaluation.hpp, for the general path.
#include "ctcr/mechanics/effect_rod.hpp"
#include "ctcr/mechanics/evaluation.hpp"
#include "ctcr/mechanics/model.hpp"

namespace ctcr {

namespace detail {

using Lanes3 = std::array<Lanes, 3>;

CTCR_INLINE Lanes3 operator+(const Lanes3& a, const Lanes3& b) noexcept { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
CTCR_INLINE Lanes3 operator-(const Lanes3& a, const Lanes3& b) noexcept { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
CTCR_INLINE Lanes3 operator*(const Mat3& R, const Lanes3& v) noexcept {
  Lanes3 r;
  for (int i = 0; i < 3; ++i) r[std::size_t(i)] = R(i, 0) * v[0] + R(i, 1) * v[1] + R(i, 2) * v[2];
  return r;
}
CTCR_INLINE Lanes3 cross(const Lanes3& a, const Vec3& b) noexcept {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// The window of variables that one pass differentiates along.
template <int G>
struct Window {
  static constexpr int groups = G, size = groups * lane_count;
  /// Lane groups of the windows that hold `lanes` lanes.
  static constexpr int groups_for(int lanes) noexcept { return (lanes + size - 1) / size * groups; }
  using S = Dual<G>;
  int first = 0;

  /// `value` with derivative `slope` along a variable.
  [[nodiscard]] CTCR_INLINE S operator()(double value, int variable, double slope = 1) const noexcept {
    S x = value;
    add(x, variable, slope);
    return x;
  }
  CTCR_INLINE void add(S& x, int variable, double slope) const noexcept {
    const int lane = variable - first;
    if (lane >= 0 && lane < size) x.d[lane / lane_count] += slope * unit_lane(lane % lane_count);
  }
};

struct Ignored {
  void operator()(const auto&...) const noexcept {}
};

/// One integration of the general path, differentiated along a window of variables. The unknowns come first among them:
/// turns of the tip about the base axes, psi_2..N at the tubes' tips.
template <int N, class Fx, int Groups>
class EffectPass {
public:
  using Window = detail::Window<Groups>;
  static constexpr int turn = 0, psi = 3, unknowns = N + 2, rows = unknowns + 6;
  using S = typename Window::S;
  using Inputs = RodInputs<N, S, Fx>;
  using State = EffectState<N, S>;

  /// @param in   with derivatives along the window's variables other than the unknowns
  /// @param met   called as met(breakpoint, state) at each breakpoint of Contacts<N> but the robot tip
  /// @param node  as EffectRod::run() takes it
  template <class Met = Ignored, class Node = typename EffectRod<N, S, Fx>::NoNode>
  EffectPass(const Inputs& in, const Events<N>& events, const TipGuess<N>& guess, int tube, const Steps<N>& steps,
             const Window& window, const Met& met = {}, const Node& node = {}) noexcept
    : alpha_(in.alpha), tip_psi_(0.0) {
    using Rod = EffectRod<N, S, Fx>;
    for (int k = 0; k < 3; ++k) turn_[std::size_t(k)] = window(0, turn + k);
    State& y = plate_ = state_at_tip(in, guess, window);
    tip_ = frame_ = frame_of<S>(Pose{});
    const auto keep_tip = [&](int id, const Frame<S>& frame, const auto& state, const auto&) noexcept {
      met(id, state);
      if (id >= N) return;
      tips.frame[std::size_t(id - 1)] = frame;
      tips.psi[std::size_t(id - 1)] = state.psi(id).v;
      if (id == tube) tip_ = frame, tip_psi_ = state.psi(id);
    };
    Rod(in).run(events, steps, y, frame_, keep_tip, node);
    std::array<S, N> torque;
    for (int i = 0; i < N; ++i) {
      const auto t = std::size_t(i);
      torque[t] = y.torque(i);
      twist_rate[i] = y.torque(i).v / in.tubes[t].kz.v;
      angle_[t] = y.psi(i) + in.beta[t] * (y.torque(i) * inverse(in.tubes[t].kz));
    }
    in.effects.base_compliance(torque, angle_);
  }

  TubeTips<N> tips;    ///< tips of tubes 2..N as seen from the robot tip
  VecN<N> twist_rate;  ///< of each tube behind the front plate [rad/m]

  [[nodiscard]] double angle(int i) const noexcept {
    return angle_[std::size_t(i)].v;
  }  ///< base angle, up to a common turn
  /// State and Bishop frame behind the front plate, seen from the robot tip; angles where the tubes are driven.
  [[nodiscard]] const State& plate() const noexcept { return plate_; }
  [[nodiscard]] const Frame<S>& frame() const noexcept { return frame_; }
  [[nodiscard]] const std::array<S, N>& angles() const noexcept { return angle_; }
  /// T_base_tip of tube 1: its base stands at alpha_1.
  [[nodiscard]] Pose tip_of_robot() const noexcept {
    const Mat3 R = rotation_z(alpha_[0].v - angle_[0].v) * frame_.rotation().transpose();
    return {R, -(R * frame_.position())};
  }

  /// Writes the tangents of the equations and of the pose of the asked tube's tip (base axes) into the rows, from lane
  /// group `at` on. The equations: the tip turns as its unknowns say, and angle_i - angle_1 = alpha_i - alpha_1.
  /// Three rows more are for the position of the robot tip.
  template <int G, int R>
  void write(LaneRow<G> (&row)[R], int at) const noexcept {
    static_assert(R == rows || R == rows + 3);
    const S gamma = alpha_[0] - angle_[0];
    const Mat3 Rz = rotation_z(gamma.v);
    const Mat3 R_base_tip = Rz * frame_.rotation().transpose();
    const Mat3 R_base_tube = R_base_tip * tip_.rotation();
    const Vec3 p = R_base_tip * (tip_.position() - frame_.position());
    for (int g = 0; g < Window::groups; ++g) {
      const Lanes3 turned = about_z(gamma, g) - Rz * group(frame_.rotation_twist, g);
      const Lanes3 velocity =
          cross(turned, p) - Rz * group(frame_.translation_twist, g) + R_base_tube * group(tip_.translation_twist, g);
      const Lanes3 rotation = turned + R_base_tube * (group(tip_.rotation_twist, g) + about_z(tip_psi_, g));
      for (std::size_t i = 0; i < 3; ++i) {
        row[turn + int(i)].x[at + g] = turned[i] - turn_[i].d[g];
        row[unknowns + int(i)].x[at + g] = velocity[i];
        row[unknowns + 3 + int(i)].x[at + g] = rotation[i];
      }
      if constexpr (R > rows) {
        const Vec3 arm = R_base_tip * -frame_.position();
        const Lanes3 robot_tip = cross(turned, arm) - Rz * group(frame_.translation_twist, g);
        for (std::size_t i = 0; i < 3; ++i) row[rows + int(i)].x[at + g] = robot_tip[i];
      }
      for (std::size_t i = 1; i < N; ++i)
        row[psi + int(i) - 1].x[at + g] = (angle_[i] - angle_[0] - alpha_[i] + alpha_[0]).d[g];
    }
  }

private:
  using Twist = Lanes[3][Window::groups];
  static CTCR_INLINE Lanes3 group(const Twist& twist, int g) noexcept { return {twist[0][g], twist[1][g], twist[2][g]}; }
  static CTCR_INLINE Lanes3 about_z(const S& angle, int g) noexcept { return {Lanes{}, Lanes{}, angle.d[g]}; }

  /// A vector of the base frame as the tip frame R sees it: turning the tip by t, base axes, changes it by R^T (v x t).
  std::array<S, 3> seen_from_tip(const Mat3& R, const std::array<S, 3>& v) const noexcept {
    std::array<S, 3> w, b;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      w[i] = v[i] + (v[j] * turn_[k] - v[k] * turn_[j]);
    }
    for (int i = 0; i < 3; ++i) b[std::size_t(i)] = R(0, i) * w[0] + R(1, i) * w[1] + R(2, i) * w[2];
    return b;
  }

  State state_at_tip(const Inputs& in, const TipGuess<N>& guess, const Window& window) const noexcept {
    State y;
    std::array<S, 3> force = in.force;
    in.effects.tip_force(in.gravity, force);
    const std::array<S, 3> n = seen_from_tip(guess.rotation, force), l = seen_from_tip(guess.rotation, in.moment),
                           g = seen_from_tip(guess.rotation, in.gravity);
    for (int i = 0; i < N; ++i) {
      y.psi(i) = i == 0 ? S(guess.psi[0]) : window(guess.psi[i], psi + i - 1);
      y.torque(i) = i == 0 ? l[2] : S(0.0);
    }
    for (int i = 0; i < 2; ++i) y.m(i) = l[std::size_t(i)];
    for (int i = 0; i < 3; ++i) y.n(i) = n[std::size_t(i)], y.g(i) = g[std::size_t(i)];
    return y;
  }

  State plate_;
  std::array<S, N> alpha_, angle_;
  std::array<S, 3> turn_;  ///< unknown turn of the tip, base axes
  Frame<S> frame_, tip_;   ///< behind the front plate and at the asked tube's tip, seen from the robot tip
  S tip_psi_;
};

/// Inputs of the rod, without derivatives.
template <class S, int N, class Fx>
CTCR_INLINE RodInputs<N, S, Fx> constant_inputs(const EffectCoefficients<N, Fx>& c, const Joints<N>& q,
                                           const TipLoad& load) noexcept {
  RodInputs<N, S, Fx> in;
  for (std::size_t i = 0; i < N; ++i) {
    const TubeParameters<double>& t = c.tubes[i];
    in.tubes[i] = {t.k, t.kz, t.kappa, t.length, t.curved_length, t.mass};
    in.beta[i] = q.beta[Eigen::Index(i)];
    in.alpha[i] = q.alpha[Eigen::Index(i)];
  }
  for (int i = 0; i < 3; ++i) {
    const auto k = std::size_t(i);
    in.force[k] = load.force[i];
    in.moment[k] = load.moment[i];
    in.gravity[k] = c.gravity[i];
  }
  in.effects = c.effects.template seeded<S>(Constant<S>{});
  return in;
}

}  // namespace detail

/// As evaluate() of the standard model (evaluation.hpp). The general path has one integration scheme; where no effect
/// changes the rod, this is the evaluation of the standard model. Real time: yes.
template <Derivatives D, Loading L, class Stepper, int N, class Fx>
CTCR_NOINLINE inline void evaluate(const EffectCoefficients<N, Fx>& c, const Joints<N>& q, const TipLoad& load,
                                   const TipGuess<N>& guess, const Steps<N>& steps, Evaluation<N, L, D>& out) noexcept {
  static_assert(L == Loading::weight, "the general path has the general equations");
  if (!c.on_rod) return evaluate<D, L, Stepper>(c.plain, q, load, guess, steps, out);
  using Col = Columns<N, L, D>;
  constexpr int beta = N + 2, force = beta + (Col::jacobian ? N : 0), moment = force + 3;
  constexpr int count = Col::compliance ? moment + 3 : force;
  using Window = detail::Window<(lane_groups(count) > 2 ? 4 : 2)>;  // J and C of three tubes in one pass
  using Pass = detail::EffectPass<N, Fx, Window::groups>;
  using S = typename Window::S;
  static_assert(Pass::unknowns == beta);
  constexpr int groups = Window::groups_for(count);
  LaneRow<groups> row[Pass::rows];

  const Events<N> events = sort_events(c.plain, q.beta);
  for (Window window; window.first < count; window.first += window.size) {
    RodInputs<N, S, Fx> in = detail::constant_inputs<S>(c, q, load);
    for (int i = 0; Col::jacobian && i < N; ++i) window.add(in.beta[std::size_t(i)], beta + i, 1);
    for (int i = 0; Col::compliance && i < 3; ++i) {
      window.add(in.force[std::size_t(i)], force + i, 1);
      window.add(in.moment[std::size_t(i)], moment + i, 1);
    }
    const Pass pass(in, events, guess, 0, steps, window);
    pass.write(row, window.first / lane_count);
    if (window.first > 0) continue;
    const Pose tip = pass.tip_of_robot();
    out.rotation = tip.rotation;
    out.position = tip.position;
    out.tips = pass.tips;
    out.w = pass.twist_rate;
    for (int i = 0; i < N; ++i) {
      out.angle[i] = pass.angle(i);
      out.angle_error[i] = (out.angle[i] - out.angle[0]) - (q.alpha[i] - q.alpha[0]);
    }
  }
  for (int j = 0; j < 3; ++j) out.axis[j] = Vec3::Unit(j);
  out.turn = rotation_vector(out.rotation * guess.rotation.transpose());
  out.residual = std::sqrt(out.turn.squaredNorm() + out.angle_error.template tail<N - 1>().squaredNorm());

  // Into the lanes of the fast path.
  const auto take = [&](int from, int to) {
    LaneRow<Col::system_groups>& lanes = out.row[to];
    for (auto& x : lanes.x) x = Lanes{};
    for (int j = 0; j < Pass::unknowns; ++j) lanes.add(Col::unknown(j), row[from][j]);
    if constexpr (Col::jacobian)
      for (int i = 0; i < N; ++i) {
        lanes.add(Col::common, row[from][beta + i]);
        if (i > 0) lanes.add(Col::beta + i - 1, row[from][beta + i]);
      }
    if constexpr (Col::compliance)
      for (int j = 0; j < 6; ++j) lanes.add(Col::force + j, row[from][force + j]);
  };
  for (int k = 0; k < Col::unknowns; ++k) {
    take(k, k);
    out.row[k].add(Col::newton, k < 3 ? out.turn[k] : out.angle_error[k - 2]);
  }
  if constexpr (Col::jacobian) {
    for (int k = 0; k < 3; ++k) take(Pass::unknowns + k, Col::unknowns + k);
    // alpha_1 turns the whole robot about z.
    out.row[2].add(Col::alpha, 1.0);
    out.row[Col::unknowns].add(Col::alpha, -out.position[1]);
    out.row[Col::unknowns + 1].add(Col::alpha, out.position[0]);
    for (int i = 1; i < N; ++i) {
      out.row[2 + i].add(Col::alpha, 1.0);
      out.row[2 + i].add(Col::alpha + i, -1.0);
    }
  }
  constexpr auto lane = [](int j) constexpr { return Col::unknown(j); };
  out.det = -eliminate<Col::unknowns>(out.row, lane);  // three rows carry the opposite sign
}

}  // namespace ctcr
