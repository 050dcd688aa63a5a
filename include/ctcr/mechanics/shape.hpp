#pragma once
// The shape of the robot in equilibrium: frame, curvature and internal moment of every tube at any arc length.
#include <algorithm>
#include <cmath>
#include <span>

#include "ctcr/math/frame_algebra.hpp"
#include "ctcr/mechanics/rod_in_equilibrium.hpp"
#include "ctcr/mechanics/solve.hpp"

namespace ctcr {

/// One tube at one arc length. Vectors in the tube's own frame: z along it, x the axis of its precurvature.
struct TubeShape {
  bool present = false;  ///< false: the tube ends before, or is grasped before, this arc length; all else is zero
  double angle = 0;      ///< psi, from the Bishop frame about z [rad]
  Vec3 curvature = Vec3::Zero();  ///< u: bending x, y and twist rate z [1/m]
  Vec3 moment = Vec3::Zero();     ///< internal: EI (u - kappa e_x), GJ u_z [N m]
};

/// All tubes at one arc length. The Bishop frame follows the common centreline without twisting; at the front plate it is
/// the base frame.
template <int N>
struct ShapePoint {
  double s = 0;                ///< arc length from the front plate [m]
  Pose bishop;                 ///< T_base_bishop
  Vec3 force = Vec3::Zero();   ///< internal, of all tubes together, base frame [N]
  Vec3 moment = Vec3::Zero();  ///< internal, of all tubes together, base frame [N m]
  std::array<TubeShape, N> tube;

  /// T_base_tube: the material frame of tube i.
  [[nodiscard]] Pose tube_pose(std::size_t i) const noexcept {
    return {bishop.rotation * rotation_z(tube[i].angle), bishop.position};
  }
};

/// Factor on the integration steps with which shapes are computed: converged to about 1e-8 m.
inline constexpr int shape_steps = 16;

namespace detail {

/// Arc lengths that differ by less are the same [m]: they carry rounding.
inline constexpr double same_arc_length = 1e-12;

template <bool Loaded, int N>
inline RobotState<double, N> tip_values(const Coefficients<N>& c, const TipLoad& load,
                                        const TipGuess<N>& guess) noexcept {
  RobotState<double, N> tip{};
  for (int i = 0; i < N; ++i) tip.psi[std::size_t(i)] = guess.psi[i];
  if constexpr (Loaded) {
    const Mat3 R_tip_base = guess.rotation.transpose();
    const Vec3 n = R_tip_base * load.force, l = R_tip_base * load.moment, g = R_tip_base * c.gravity;
    tip.m = {l[0], l[1]};
    tip.w[0] = l[2] / c.kz[0];
    tip.n = {n[0], n[1], n[2]};
    tip.g = {g[0], g[1], g[2]};
  }
  return tip;
}

/// Transform from the frame of the integration, which starts at the tip, to the base frame.
struct BaseView {
  Pose T_base_tip;
  double turn;  ///< of the integrated Bishop frame against that which starts as the base frame [rad]
};

template <bool Loaded, int N>
inline void fill_point(const Model<N>& model, const BaseView& base, const SegmentTubes<N>& tubes,
                       const RobotState<double, N>& y, const Frame<double>& frame, const std::array<double, 2>& u,
                       ShapePoint<N>& out) noexcept {
  const Pose T_base_here = base.T_base_tip * Pose{frame.rotation(), frame.position()};
  out.bishop = {T_base_here.rotation * rotation_z(-base.turn), T_base_here.position};
  Vec3 moment = Vec3::Zero();
  if constexpr (Loaded) {
    out.force = T_base_here.rotation * Vec3(y.n[0], y.n[1], y.n[2]);
    moment << y.m[0], y.m[1], 0;
  }
  for (std::size_t i = 0; i < std::size_t(tubes.present); ++i) {
    const Tube& tube = model.robot().tubes[i];
    TubeShape& t = out.tube[i];
    double sine, cosine;
    sincos(y.psi[i], sine, cosine);
    t.present = true;
    t.angle = y.psi[i] + base.turn;
    t.curvature << cosine * u[0] + sine * u[1], cosine * u[1] - sine * u[0], y.w[i];
    t.moment << tube.EI() * t.curvature[0], tube.EI() * t.curvature[1], tube.GJ() * y.w[i];
    moment[2] += t.moment[2];
  }
  for (int j = 0; j < tubes.curved_count; ++j) {
    const auto i = std::size_t(tubes.curved[std::size_t(j)]);
    out.tube[i].moment[0] -= model.coefficients().a[i];
  }
  out.moment = T_base_here.rotation * moment;
}

/// Behind the plate the tubes are straight and transmit torque alone.
/// @param psi, w  angle and twist rate of each tube there
template <int N>
inline void fill_behind_plate(const Robot<N>& robot, const Joints<N>& q, const BaseView& base,
                              const std::array<double, std::size_t(N)>& psi,
                              const std::array<double, std::size_t(N)>& w, ShapePoint<N>& out) noexcept {
  out.bishop.position << 0, 0, out.s;
  for (std::size_t i = 0; i < N; ++i) {
    if (out.s < q.beta[Eigen::Index(i)] - same_arc_length) continue;
    TubeShape& t = out.tube[i];
    t.present = true;
    t.angle = psi[i] + base.turn + out.s * w[i];
    t.curvature << 0, 0, w[i];
    t.moment << 0, 0, robot.tubes[i].GJ() * w[i];
    out.moment += t.moment;
  }
}

/// Fills the points beyond the robot tip. @return how many are left
template <int N>
inline std::size_t fill_beyond_tip(double tip, const BaseView& base, std::span<ShapePoint<N>> points) noexcept {
  std::size_t left = points.size();
  for (; left > 0 && points[left - 1].s > tip + same_arc_length; --left)
    points[left - 1].bishop = {base.T_base_tip.rotation * rotation_z(-base.turn), base.T_base_tip.position};
  return left;
}

/// Shape of the equilibrium that `guess` describes, at the arc lengths already set in `points`.
template <Loading L, int N>
inline void fill_shape(const Model<N>& model, const Joints<N>& q, const TipLoad& load, const TipGuess<N>& guess,
                       const Steps<N>& steps, std::span<ShapePoint<N>> points) noexcept {
  using Col = Columns<N, L, Derivatives::none>;
  using Pass = Shooting<N, double, double, double, Col::loaded, Col::weight, MagnusRk4, Col>;
  using State = RobotState<double, N>;
  struct Node {
    double s;
    SegmentTubes<N> tubes;
    State y;
    Frame<double> frame;
  };
  const Coefficients<N>& c = model.coefficients();
  const Events<N> events = sort_events(c, q.beta);
  const auto arc_length = [](int, double s) noexcept { return s; };
  const State tip = tip_values<Col::loaded>(c, load, guess);
  TubeTips<N> tips;

  // Where the plate is, as seen from the tip, is known only after a first pass.
  State plate = tip;
  Frame<double> frame;
  Pass::run(c, events, arc_length, 0.0, steps, plate, frame, tips);
  BaseView base;
  base.turn = q.alpha[0] - (plate.psi[0] + q.beta[0] * plate.w[0]);
  base.T_base_tip = Pose{rotation_z(base.turn), Vec3::Zero()} * Pose{frame.rotation(), frame.position()}.inverse();

  std::size_t left = fill_beyond_tip(events.s[0], base, points);
  Node node{events.s[0], {}, tip, {}};
  const auto fill_down_to = [&](double end) noexcept {
    for (; left > 0 && points[left - 1].s > end + same_arc_length; --left) {
      ShapePoint<N>& point = points[left - 1];
      Node here = node;
      Pass::advance(c, here.tubes, point.s - here.s, here.s, 1, here.y, here.frame, NoRecord{});
      fill_point<Col::loaded>(model, base, here.tubes, here.y, here.frame,
                              Pass::centreline_curvature(c, here.tubes, here.y), point);
    }
  };
  const auto record = [&](double s, const SegmentTubes<N>& tubes, const State& y, const Frame<double>& f) noexcept {
    fill_down_to(s);
    node = {s, tubes, y, f};
  };
  State y = tip;
  Pass::run(c, events, arc_length, 0.0, steps, y, frame, tips, record);
  fill_down_to(-2 * same_arc_length);
  for (; left > 0; --left) fill_behind_plate(model.robot(), q, base, plate.psi, plate.w, points[left - 1]);
}

/// The same for a robot with effects.
template <int N, class Fx>
inline void fill_shape_with_effects(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load,
                                    const TipGuess<N>& guess, const Steps<N>& steps,
                                    std::span<ShapePoint<N>> points) noexcept {
  using Equilibrium = RodInEquilibrium<N, Fx>;
  using Rod = typename Equilibrium::Rod;
  using State = typename Rod::State;
  using Section = typename Rod::Section;
  struct Node {
    double s;
    Section section;
    State y;
    Frame<double> frame;
  };
  const Equilibrium equilibrium(model, q, load);
  const Rod& rod = equilibrium.rod;
  const Events<N>& events = equilibrium.events;
  const auto no_breakpoint = [](int, const Frame<double>&, const State&, const auto&) noexcept {};

  const State tip = equilibrium.at_tip(guess);
  State plate = tip;
  Frame<double> frame;
  rod.run(events, steps, plate, frame, no_breakpoint, typename Rod::NoNode{});
  std::array<double, N> psi, w, torque, angle;
  for (int i = 0; i < N; ++i) {
    const auto t = std::size_t(i);
    psi[t] = plate.psi(i);
    torque[t] = plate.torque(i);
    w[t] = torque[t] / equilibrium.in.tubes[t].kz;
    angle[t] = psi[t] + q.beta[i] * w[t];
  }
  equilibrium.in.effects.base_compliance(torque, angle);
  BaseView base;
  base.turn = q.alpha[0] - angle[0];
  base.T_base_tip = Pose{rotation_z(base.turn), Vec3::Zero()} * pose_of(frame).inverse();

  std::size_t left = fill_beyond_tip(events.s[0], base, points);
  Node node{events.s[0], {}, tip, {}};
  const auto fill = [&](const Node& here, ShapePoint<N>& out) noexcept {
    const auto sharing = rod.shared_moment(here.section, here.y);
    const Pose T_base_here = base.T_base_tip * pose_of(here.frame);
    out.bishop = {T_base_here.rotation * rotation_z(-base.turn), T_base_here.position};
    out.force = T_base_here.rotation * Vec3(here.y.n(0), here.y.n(1), here.y.n(2));
    Vec3 moment(here.y.m(0), here.y.m(1), 0);
    for (int i = 0; i < here.section.present; ++i) {
      const auto k = std::size_t(i);
      TubeShape& t = out.tube[k];
      t.present = true;
      t.angle = here.y.psi(i) + base.turn;
      t.curvature << sharing.curvature[k][0], sharing.curvature[k][1], rod.twist_rate(i, here.y);
      t.moment << sharing.moment[k][0], sharing.moment[k][1], here.y.torque(i);
      moment[2] += here.y.torque(i);
    }
    out.moment = T_base_here.rotation * moment;
  };
  const auto fill_down_to = [&](double end) noexcept {
    for (; left > 0 && points[left - 1].s > end + same_arc_length; --left) {
      Node here = node;
      rod.step(here.section, points[left - 1].s - here.s, here.y, here.frame);
      fill(here, points[left - 1]);
    }
  };
  const auto record = [&](double s, const Section& section, const State& y, const Frame<double>& f,
                          const Rod&) noexcept {
    fill_down_to(s);
    node = {s, section, y, f};
  };
  State y = tip;
  rod.run(events, steps, y, frame, no_breakpoint, record);
  fill_down_to(-2 * same_arc_length);
  for (; left > 0; --left) fill_behind_plate(model.robot(), q, base, psi, w, points[left - 1]);
}

}  // namespace detail

/// Solves the model finely and gives its shape at arc lengths.
///
/// At a breakpoint, where curvatures jump and effects may kink the robot, the values are those of the base side. s < 0 is behind the front plate.
/// Beyond the robot tip no tube is present and the frame is that of the tip.
/// @param s       arc lengths from the front plate, ascending [m]
/// @param points  out: one for each s (at least as many); no tube is present where nothing is computed
/// @param ws      warm start; becomes that of the fine model, so a control loop should keep its own
/// @param out     the fine solution, without derivatives
/// @param settings  steps below shape_steps are raised to it
/// @return as solve(); invalid_settings: arc lengths that do not ascend, or too few points; not_finite: of an arc length, too;
///         then nothing is computed   Real time: yes; solve(), two integrations more, and one step for each point.
template <int N, class Fx>
Status shape(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, std::span<const double> s,
             std::span<ShapePoint<N>> points, Workspace<N>& ws, Solution<N>& out, Settings settings = {}) noexcept {
  points = points.first(std::min(s.size(), points.size()));
  Status given = points.size() == s.size() ? Status::ok : Status::invalid_settings;
  for (std::size_t k = 0; k < points.size(); ++k) {
    points[k] = ShapePoint<N>{};
    points[k].s = s[k];
    if (k > 0 && s[k] < s[k - 1] && given == Status::ok) given = Status::invalid_settings;
    if (!std::isfinite(s[k])) given = Status::not_finite;
  }
  if (given != Status::ok) {
    out.iterations = 0;
    return detail::blank(given, out);
  }
  settings.steps = std::max(settings.steps, shape_steps);
  const Status status = solve<Derivatives::none>(model, q, load, ws, out, settings);
  if (!was_computed(status)) return status;
  Steps<N> steps = ws.steps;
  steps.times = std::max(steps.times, settings.steps);
  if constexpr (!Fx::none)
    detail::fill_shape_with_effects(model, q, load, ws.guess, steps, points);
  else if (!model.coefficients().gravity.isZero(0.0) || !load.force.isZero(0.0) || !load.moment.isZero(0.0))
    detail::fill_shape<Loading::weight>(model, q, load, ws.guess, steps, points);
  else
    detail::fill_shape<Loading::none>(model, q, load, ws.guess, steps, points);
  return status;
}

/// Arc lengths at which to draw a robot: uniform from the front plate to the tip, and every breakpoint between.
/// @param points  how many uniform ones, >= 2
/// @param s       out: ascending, each once [m]; room for points + 2N
/// @return how many were written: none where joints are not finite   Real time: yes.
template <int N, class Fx>
std::size_t shape_arc_lengths(const Model<N, Fx>& model, const Joints<N>& q, std::size_t points,
                              std::span<double> s) noexcept {
  if (!all_finite(q.beta, q.alpha)) return 0;
  const auto& c = model.coefficients();
  Events<N> events;
  if constexpr (Fx::none)
    events = sort_events(c, q.beta);
  else
    events = sort_events(c.plain, q.beta);
  const double tip = std::max(events.s[0], 0.0);
  std::size_t count = 0;
  for (std::size_t k = 0; k < points; ++k) s[count++] = k + 1 == points ? tip : tip * double(k) / double(points - 1);
  for (const double at : events.s)
    if (at > 0) s[count++] = at;
  const auto end = s.begin() + std::ptrdiff_t(count);
  std::sort(s.begin(), end);
  const auto same = [](double a, double b) { return b - a <= detail::same_arc_length; };
  return std::size_t(std::unique(s.begin(), end, same) - s.begin());
}

}  // namespace ctcr
