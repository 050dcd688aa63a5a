#pragma once
// One evaluation of the shooting residual, its Jacobian B_u and everything Newton's method, J and C need of it.
#include "ctcr/math/linear_solve.hpp"
#include "ctcr/mechanics/columns.hpp"
#include "ctcr/mechanics/model.hpp"
#include "ctcr/mechanics/shooting.hpp"
#include "ctcr/robot/tip_load.hpp"

namespace ctcr {

/// The unknowns of the shooting problem.
template <int N>
struct TipGuess {
  Mat3 rotation = Mat3::Identity();  ///< R_base_tip: material frame of tube 1 at its tip
  VecN<N> psi = VecN<N>::Zero();     ///< angle of each tube at its own tip against tube 1's tip [rad]; psi[0] = 0
};

/// The equilibrium that a guess describes exactly, and how far its joints are from the wanted ones.
template <int N, Loading L, Derivatives D>
struct Evaluation {
  using Col = Columns<N, L, D>;

  Mat3 rotation;                               ///< R_base_tip
  Vec3 position;                               ///< tip in the base frame [m]
  Vec3 turn;                                   ///< loaded: turn from the guessed tip frame to this one, base axes [rad]
  VecN<N> angle;                               ///< base angles of the tubes, up to a common turn [rad]
  VecN<N> angle_error;                         ///< angle - alpha, both against tube 1 [rad]
  VecN<N> w;                                   ///< twist rate of each tube at the front plate [rad/m]
  double residual;                             ///< ||b|| of turn and angle errors [rad]
  double det;                                  ///< det B_u: 1 without interaction, 0 where the robot snaps
  TubeTips<N> tips;                            ///< tips of all tubes as seen from the robot tip
  Vec3 axis[Col::turns > 0 ? Col::turns : 1];  ///< axes of the unknown turns, base frame

  /// Rows: minus the change of the unknowns (the first Col::unknowns) by each lane of Col, then, with the Jacobian, the
  /// change of the tip position (3) and of its rotation (3) in base axes; three unknown turns are that rotation.
  static constexpr int pose_rows = Col::jacobian ? (Col::turns == 3 ? 3 : 6) : 0;
  static constexpr int rows = Col::unknowns + pose_rows;
  LaneRow<Col::system_groups> row[rows > 0 ? rows : 1];

  /// Change of unknown j by a lane.
  [[nodiscard]] CTCR_INLINE double unknown(int j, int lane) const noexcept { return -row[j][lane]; }
  /// Change of the tip (position 0-2, rotation 3-5, base axes) by a lane. Needs the Jacobian.
  [[nodiscard]] CTCR_INLINE double pose(int k, int lane) const noexcept {
    return Col::turns == 3 && k >= 3 ? unknown(k - 3, lane) : row[Col::unknowns + k][lane];
  }
};

namespace detail {

template <int G>
CTCR_INLINE void seed(Dual<G>& x, int lane, double slope) noexcept {
  x.d[lane / lane_count] += slope * unit_lane(lane % lane_count);
}

/// A vector that is constant in the base frame as the tip frame R sees it, differentiated by turns of the tip about
/// `axis` (lanes from `turn`) and by its own components (lanes from `own`; -1: not).
template <class S, int Turns, std::size_t A>
CTCR_INLINE std::array<S, 3> seen_from_tip(const Mat3& R, const Vec3& v, const Vec3 (&axis)[A], int turn, int own) noexcept {
  std::array<S, 3> body;
  for (int i = 0; i < 3; ++i) body[std::size_t(i)] = R.col(i).dot(v);
  for (int j = 0; j < Turns; ++j) {
    const Vec3 change = v.cross(axis[j]);  // d(R^T v) = R^T (v x turn)
    for (int i = 0; i < 3; ++i) seed(body[std::size_t(i)], turn + j, R.col(i).dot(change));
  }
  if (own >= 0)
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) seed(body[std::size_t(i)], own + j, R(j, i));
  return body;
}

/// Axes of the unknown turns: perpendicular to the force where only that matters, else those of the base frame.
template <Loading L, std::size_t A>
CTCR_INLINE void turn_axes(const TipLoad& load, Vec3 (&axis)[A]) noexcept {
  if constexpr (L == Loading::force) {
    const Vec3& f = load.force;
    const Vec3 side = std::abs(f[0]) < 0.5 * f.norm() ? Vec3(0, f[2], -f[1]) : Vec3(-f[2], 0, f[0]);
    axis[0] = side * (1.0 / side.norm());
    axis[1] = f.cross(axis[0]) * (1.0 / f.norm());
  } else if constexpr (L != Loading::none) {
    for (int j = 0; j < 3; ++j) axis[j] = Vec3::Unit(j);
  }
}

/// Turn from the guessed tip frame to the found one, as far as the load depends on it [rad].
template <Loading L>
CTCR_INLINE Vec3 felt_turn(const Mat3& found, const Mat3& guessed, const TipLoad& load) noexcept {
  if constexpr (L == Loading::force) {
    const Vec3 f = load.force * (1.0 / load.force.norm());
    const Vec3 g = found * (guessed.transpose() * f);
    const Vec3 sine = f.cross(g);
    const double s = sine.norm(), c = f.dot(g);
    return s > 1e-6 || c < 0 ? Vec3(sine * (std::atan2(s, c) / (s + 1e-300))) : sine;
  } else {
    return rotation_vector(found * guessed.transpose());
  }
}

template <class Col, class S, int N, std::size_t A>
CTCR_INLINE RobotState<S, N> tip_state(const Coefficients<N>& c, const TipLoad& load, const TipGuess<N>& guess,
                                  const Vec3 (&axis)[A]) noexcept {
  RobotState<S, N> tip;
  for (int i = 0; i < N; ++i) {
    tip.psi[std::size_t(i)] = guess.psi[i];
    tip.w[std::size_t(i)] = 0.0;
    if (i > 0) seed(tip.psi[std::size_t(i)], Col::psi + i - 1, 1.0);
  }
  if constexpr (Col::loaded) {
    constexpr int turns = Col::integrates_turns ? Col::turns : 0;
    const Mat3& R = guess.rotation;
    tip.n = seen_from_tip<S, turns>(R, load.force, axis, Col::turn, Col::compliance ? Col::force : -1);
    if constexpr (Col::turns == 2 && !Col::compliance) {
      tip.m = {0.0, 0.0};
    } else {
      const auto l = seen_from_tip<S, turns>(R, load.moment, axis, Col::turn, Col::compliance ? Col::moment : -1);
      tip.m = {l[0], l[1]};
      tip.w[0] = l[2] * (1.0 / c.kz[0]);
    }
    if constexpr (Col::weight) tip.g = seen_from_tip<S, turns>(R, c.gravity, axis, Col::turn, -1);
  }
  return tip;
}

/// Directions beta_2..N of each tube's events.
template <class Col, int N>
struct EventDirections {
  static constexpr int groups = Col::groups - Col::first_beta_group;
  alignas(32) double d[N + 1][groups * lane_count] = {};  ///< of each tube's events, and of the plate

  constexpr EventDirections() noexcept {
    constexpr int first = Col::first_beta_group * lane_count;
    for (int tube = 1; tube < N; ++tube) d[tube][Col::beta + tube - 1 - first] = 1.0;
    d[N][Col::common - first] = -1.0;
  }
};
template <class Col, int N>
inline constexpr EventDirections<Col, N> event_directions{};

/// Arc length of an event, or of the plate (event 2N), with its derivatives by beta_2..N and by the common shift. The
/// robot tip stays where it is: beta_1 is left to the common shift, which moves the plate back, not the events forward.
template <class Col, int N, class H>
CTCR_INLINE H event_arc_length(int event, double s) noexcept {
  if constexpr (std::is_same_v<H, double>) {
    return s;
  } else {
    H h;
    h.v = s;
    __builtin_memcpy(h.d, event_directions<Col, N>.d[event < N ? event : event - N], sizeof(h.d));
    return h;
  }
}

/// Lanes of alpha_1..N and of the residual: they start with what alpha_1 does.
template <class Col>
CTCR_INLINE void joint_lanes(LaneRow<Col::system_groups>& row, double alpha_1) noexcept {
  for (int g = 0; g < Col::joint_groups; ++g) row.x[Col::groups + g] = Lanes{};
  if (alpha_1 != 0) row.x[Col::groups] = alpha_1 * unit_lane(0);
}

/// Columns of tip turns from those of force and moment: turning the tip by t turns the loads it sees by -t.
template <Loading L, class Col, std::size_t A>
CTCR_INLINE void turns_from_loads(LaneRow<Col::system_groups>& row, const TipLoad& load, const Vec3 (&axis)[A]) noexcept {
  const Vec3 f(row[Col::force], row[Col::force + 1], row[Col::force + 2]);
  Vec3 t = f.cross(load.force);
  if constexpr (L == Loading::force) {
    const double a = t.dot(axis[0]), b = t.dot(axis[1]);
    row.x[Col::turn / lane_count] = Lanes{a, b, a, b};
  } else {
    t += Vec3(row[Col::moment], row[Col::moment + 1], row[Col::moment + 2]).cross(load.moment);
    row.x[Col::turn / lane_count] = Lanes{t[0], t[1], t[2], t[2]};
  }
}

/// The integration that differentiates along the columns Col.
template <int N, class Stepper, class Col>
using Pass = Shooting<
    N, Dual<Col::groups>, double,
    std::conditional_t<(Col::first_beta_group < Col::groups), TailDual<Col::groups, Col::first_beta_group>, double>,
    Col::loaded, Col::weight, Stepper, Col>;

/// Integrates from the state at the tip to the front plate. @param record  as Shooting::run() takes it
template <class Stepper, class Col, int N, class S, class Record = NoRecord>
CTCR_INLINE void integrate(const Coefficients<N>& c, const Joints<N>& q, const Steps<N>& steps, RobotState<S, N>& state,
                      Frame<S>& frame, TubeTips<N>& tips, const Record& record = {}) noexcept {
  using H = typename Pass<N, Stepper, Col>::Length;
  const auto arc_length = [](int event, double s) noexcept { return event_arc_length<Col, N, H>(event, s); };
  Pass<N, Stepper, Col>::run(c, sort_events(c, q.beta), arc_length, arc_length(2 * N, 0.0), steps, state, frame, tips,
                             record);
}

/// Computes the outputs from state and frame at the front plate; out.axis and out.tips are set already.
template <Derivatives D, Loading L, int N, class S>
CTCR_INLINE void assemble(const Joints<N>& q, const TipLoad& load, const TipGuess<N>& guess, const RobotState<S, N>& base,
                     const Frame<S>& f, Evaluation<N, L, D>& out) noexcept {
  using Ev = Evaluation<N, L, D>;
  using Col = typename Ev::Col;
  constexpr int G = Col::groups;

  for (int i = 0; i < N; ++i) {
    const auto t = std::size_t(i);
    out.w[i] = base.w[t].v;
    out.angle[i] = base.psi[t].v + q.beta[i] * out.w[i];
    out.angle_error[i] = (out.angle[i] - out.angle[0]) - (q.alpha[i] - q.alpha[0]);
  }
  // R_base_tip = Rz(gamma) H^T and r = -Rz(gamma) H^T p, where gamma brings tube 1's base to alpha_1.
  double sg, cg;
  sincos(q.alpha[0] - out.angle[0], sg, cg);
  for (int j = 0; j < 3; ++j) {
    out.rotation(0, j) = cg * f.x[j] - sg * f.y[j];
    out.rotation(1, j) = sg * f.x[j] + cg * f.y[j];
    out.rotation(2, j) = f.z[j];
  }
  const Vec3 r = out.position = -(out.rotation * f.position());
  double square = 0;
  if constexpr (Col::loaded) {
    out.turn = felt_turn<L>(out.rotation, guess.rotation, load);
    square = out.turn.squaredNorm();
  }
  for (int i = 1; i < N; ++i) square += out.angle_error[i] * out.angle_error[i];
  out.residual = std::sqrt(square);

  // Tangents at the front plate, turned into the base frame: base angles, tip rotation, tip position.
  using Row = LaneRow<Col::system_groups>;
  Row angle[N], scratch[6];
  Row* const position = Ev::pose_rows > 0 ? &out.row[Col::unknowns] : scratch;
  Row* const rotation = Ev::pose_rows == 6 ? position + 3 : scratch + 3;
  for (int g = 0; g < G; ++g) {
    for (int i = 0; i < N; ++i) angle[i].x[g] = base.psi[std::size_t(i)].d[g] + base.w[std::size_t(i)].d[g] * q.beta[i];
    if constexpr (Col::jacobian) {
      // Behind the plate a tube twists over the length -beta_i, which changes with its own column and the common shift.
      for (int i = 0; i < N; ++i) {
        if (g == Col::common / lane_count) angle[i].x[g] += out.w[i] * unit_lane(Col::common % lane_count);
        const int beta = Col::beta + i - 1;
        if (i > 0 && g == beta / lane_count) angle[i].x[g] += out.w[i] * unit_lane(beta % lane_count);
      }
    }
    if constexpr (Col::loaded || Col::jacobian) {
      if (Col::starts_with(g) > N + 1) {
        for (int k = 0; k < 3; ++k) rotation[k].x[g] = position[k].x[g] = Lanes{};
        continue;
      }
      const Lanes bx = f.rotation_twist[0][g], by = f.rotation_twist[1][g];
      const Lanes ox = sg * by - cg * bx, oy = -(sg * bx + cg * by), oz = -(angle[0].x[g] + f.rotation_twist[2][g]);
      rotation[0].x[g] = ox;
      rotation[1].x[g] = oy;
      rotation[2].x[g] = oz;
      if constexpr (Col::jacobian) {
        const Lanes vx = f.translation_twist[0][g], vy = f.translation_twist[1][g];
        position[0].x[g] = sg * vy - cg * vx + oy * r[2] - oz * r[1];
        position[1].x[g] = oz * r[0] - ox * r[2] - (sg * vx + cg * vy);
        position[2].x[g] = ox * r[1] - oy * r[0] - f.translation_twist[2][g];
      }
    }
  }
  if constexpr (Col::jacobian) {
    // alpha_1 turns the whole robot about z.
    for (int i = 0; i < N; ++i) joint_lanes<Col>(angle[i], 0.0);
    for (int k = 0; k < 3; ++k) joint_lanes<Col>(rotation[k], k == 2 ? 1.0 : 0.0);
    joint_lanes<Col>(position[0], -r[1]);
    joint_lanes<Col>(position[1], r[0]);
    joint_lanes<Col>(position[2], 0.0);
  }
  if constexpr (Col::loaded && !Col::integrates_turns) {
    for (int i = 0; i < N; ++i) turns_from_loads<L, Col>(angle[i], load, out.axis);
    for (int k = 0; k < 3; ++k) {
      turns_from_loads<L, Col>(rotation[k], load, out.axis);
      turns_from_loads<L, Col>(position[k], load, out.axis);
    }
  }

  // The equations, all terms on one side: felt turn - unknown turn = 0, angle_i - angle_1 - (alpha_i - alpha_1) = 0.
  for (int i = 0; i < Col::turns; ++i) {
    Row& equation = out.row[i];
    const Vec3& a = out.axis[i];
    if constexpr (Col::turns == 3)
      equation = rotation[i];
    else
      for (int g = 0; g < Col::system_groups; ++g)
        equation.x[g] = a[0] * rotation[0].x[g] + a[1] * rotation[1].x[g] + a[2] * rotation[2].x[g];
    // A turn of the guess about the force is not felt, so there may be any between the guessed and the found frame.
    if constexpr (Col::turns == 2)
      for (int j = 0; j < 2; ++j)
        equation.add(Col::turn + j, -a.dot(out.rotation * (guess.rotation.transpose() * out.axis[j])));
    else
      equation.add(Col::turn + i, -1.0);
    equation.add(Col::newton, Col::turns == 3 ? out.turn[i] : a.dot(out.turn));
  }
  for (int i = 1; i < N; ++i) {
    Row& equation = out.row[Col::turns + i - 1];
    for (int g = 0; g < Col::system_groups; ++g) equation.x[g] = angle[i].x[g] - angle[0].x[g];
    equation.add(Col::newton, out.angle_error[i]);
    if constexpr (Col::jacobian) {
      equation.add(Col::alpha, 1.0);
      equation.add(Col::alpha + i, -1.0);
    }
  }
  constexpr auto lane = [](int j) constexpr { return Col::unknown(j); };
  out.det = eliminate<Col::unknowns>(out.row, lane);
  if constexpr (Col::turns == 3) out.det = -out.det;  // three rows carry the opposite sign
}

}  // namespace detail

/// Integrates once from the guess and eliminates the unknowns.
/// @param q, load  base frame, must be valid (check_joints)
/// Real time: yes. Never inlined: it is large and called from many places.
template <Derivatives D, Loading L, class Stepper, int N>
CTCR_NOINLINE inline void evaluate(const Coefficients<N>& c, const Joints<N>& q, const TipLoad& load,
                                   const TipGuess<N>& guess, const Steps<N>& steps, Evaluation<N, L, D>& out) noexcept {
  using Col = Columns<N, L, D>;
  detail::turn_axes<L>(load, out.axis);
  using S = Dual<Col::groups>;
  RobotState<S, N> state = detail::tip_state<Col, S>(c, load, guess, out.axis);
  Frame<S> frame;
  detail::integrate<Stepper, Col>(c, q, steps, state, frame, out.tips);
  detail::assemble<D, L>(q, load, guess, state, frame, out);
}

}  // namespace ctcr
