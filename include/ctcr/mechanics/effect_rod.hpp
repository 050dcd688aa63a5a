#pragma once
// The general path: the rod with effects, for any scalar S, integrated from the robot tip to the front plate. Every tube
// may bend anywhere and by any constitutive law of Material. Tubes may exchange torque along their length and at
// breakpoints, and there the frame may kink. Without effects it computes what the fast path of shooting.hpp computes; a
// test holds both equal.
#include "ctcr/math/frame_algebra.hpp"
#include "ctcr/mechanics/effect_state.hpp"
#include "ctcr/mechanics/events.hpp"
#include "ctcr/mechanics/moment_sharing.hpp"
#include "ctcr/mechanics/steppers.hpp"
#include "ctcr/mechanics/steps.hpp"

namespace ctcr {

template <int N, class S, class Fx>
class EffectRod {
public:
  using State = EffectState<N, S>;
  using Inputs = RodInputs<N, S, Fx>;
  using Section = CrossSection<N, S>;
  using Sharing = MomentSharing<N, S>;
  using Side = typename Breakpoint<S, N>::Side;

  explicit EffectRod(const Inputs& inputs) noexcept
    : in_(inputs),
      varied_(inputs.effects.acts_on_material()),
      distributed_friction_(inputs.effects.acts_by_distributed_friction()) {}

  /// Integrates from the state at the tip to the grasped side of the front plate.
  /// @param frame  out: Bishop frame there as seen from the tip frame
  /// @param met    called as met(breakpoint, frame, state, moments) at each breakpoint of Contacts<N> but the robot tip;
  ///               moments() are those of the tubes on its far and on its near side, Bishop axes
  /// @param node   called as node(s, section, state, frame, rod) at both ends of every step
  /// Real time: yes (2N segments).
  template <class Met, class Node>
  void run(const Events<N>& events, const Steps<N>& steps, State& y, Frame<S>& frame, const Met& met,
           const Node& node) const noexcept {
    Section section;
    frame = frame_of<S>(Pose{});
    S here = event_position(events.id[0]);
    for (std::size_t e = 0; e < 2 * N && (events.s[e] > 0 || section.present < N); ++e) {
      const int id = events.id[e];
      const bool last = e + 1 == 2 * N || !(events.s[e + 1] > 0);
      const S next = last ? S(0.0) : event_position(events.id[e + 1]);
      const Section near = behind(id, section);
      if (section.present > 0)
        apply_breakpoint(id, section, near, last ? Contacts<N>::plate : events.id[e + 1], here - next, y, frame);
      if (id > 0) met(id, frame, y, [&] { return std::pair(moments(section, y), moments(near, y)); });
      section = near;
      section.knows_u = false;
      set_friction_between(id, last ? Contacts<N>::plate : events.id[e + 1], next - here, section);
      const int count = steps.after(id);
      const S h = (1.0 / count) * (next - here);
      for (int i = 0; i < count; ++i) {
        if constexpr (!std::is_same_v<Node, NoNode>) node(here + double(i) * h, section, y, frame, *this);
        step(section, h, y, frame);
      }
      if constexpr (!std::is_same_v<Node, NoNode>) node(next, section, y, frame, *this);
      here = next;
    }
    met(Contacts<N>::plate, frame, y, [&] { return std::pair(moments(section, y), moments_behind_plate(section, y)); });
    apply_breakpoint(Contacts<N>::plate, section, section, Contacts<N>::plate, S(0.0), y, frame);
  }

  struct NoNode {};

  /// How the tubes share the bending moment of a state, and the curvatures that follow.
  [[nodiscard]] CTCR_NOINLINE Sharing shared_moment(const Section& section, const State& y) const noexcept {
    return {section, y, varied_};
  }

  /// Rate of the angle of a tube [rad/m].
  [[nodiscard]] S twist_rate(int i, const State& y) const noexcept {
    return y.torque(i) * inverse(in_.tubes[std::size_t(i)].kz);
  }

  /// One integration step of length h inside a segment: the scheme of MagnusRk4.
  void step(Section& section, const S& h, State& y, Frame<S>& frame) const noexcept {
    const S half = 0.5 * h;
    const auto moved = [](const State& y0, const S& k, const State& d) {
      State r;
      for (std::size_t i = 0; i < State::size; ++i) r.y[i] = y0.y[i] + k * d.y[i];
      return r;
    };
    const auto advance = [&] {
      if (has_distributed_friction())
        for (std::size_t i = 0; i < N; ++i) section.friction[i] = section.friction[i] + half * section.friction_rate[i];
      if (!varied_) return;
      for (std::size_t i = 0; i < std::size_t(section.present); ++i) section.along[i] = section.along[i] + half;
      locate(section);
    };
    std::array<S, 2> u1, u2, u3, u4;
    const State k1 = rates(section, y, u1);
    advance();
    const State k2 = rates(section, moved(y, half, k1), u2);
    const State k3 = rates(section, moved(y, half, k2), u3);
    advance();
    const State k4 = rates(section, moved(y, h, k3), u4);
    const S sixth = (1.0 / 6.0) * h;
    for (std::size_t i = 0; i < State::size; ++i)
      y.y[i] = y.y[i] + sixth * (k1.y[i] + 2.0 * (k2.y[i] + k3.y[i]) + k4.y[i]);
    move_frame(frame, u1, std::array<S, 2>{0.5 * (u2[0] + u3[0]), 0.5 * (u2[1] + u3[1])}, u4, h);
  }

private:
  [[nodiscard]] bool has_curve(int i) const noexcept { return value(in_.tubes[std::size_t(i)].curved_length) > 0; }

  [[nodiscard]] S event_position(int id) const noexcept {
    const auto i = std::size_t(id < N ? id : id - N);
    const S tip = in_.tubes[i].length + in_.beta[i];
    return id < N ? tip : tip - in_.tubes[i].curved_length;
  }

  [[nodiscard]] bool has_distributed_friction() const noexcept {
    return Fx::template On<N, S>::has_distributed_friction && distributed_friction_;
  }

  /// Sets the friction along the tubes from a breakpoint to the next one, a distance of h < 0 towards the base.
  void set_friction_between(int far, int near, const S& h, Section& section) const noexcept {
    if (!has_distributed_friction()) return;
    constexpr double shortest = 1e-9;  // [m]: no division by 0
    std::array<S, N> end;
    for (std::size_t i = 0; i < N; ++i) section.friction[i] = end[i] = 0.0;
    in_.effects.distributed_friction(far, section.friction);
    in_.effects.distributed_friction(near, end);
    const S per_length = value(h) < -shortest ? inverse(h) : S(0.0);
    for (std::size_t i = 0; i < N; ++i) section.friction_rate[i] = (end[i] - section.friction[i]) * per_length;
  }

  void locate(Section& section) const noexcept {
    for (int j = 0; j < section.present; ++j) section.material[std::size_t(j)] = material_of(section, j);
  }
  [[nodiscard]] Material<S> material_of(const Section& section, int j) const noexcept {
    const auto i = std::size_t(j);
    const TubeParameters<S>& t = in_.tubes[i];
    Material<S> m{.bending_stiffness = t.k, .curvature = {section.curved[i] ? t.kappa : S(0.0), S(0.0)}};
    if (varied_) {
      const S straight = t.length - t.curved_length;
      const S within = section.curved[i] ? S(section.along[i] - straight) : section.along[i];
      const S part = within * inverse(section.curved[i] ? t.curved_length : straight);
      in_.effects.material(TubePoint<S>{j, section.curved[i], section.along[i], within, part}, m);
    }
    return m;
  }

  State rates(Section& section, const State& y, std::array<S, 2>& u) const noexcept {
    const Sharing b = shared_moment(section, y);
    u = b.u;
    section.u = {value(u[0]), value(u[1])};
    section.knows_u = true;
    State d;
    S mz = 0.0, mass = 0.0;
    for (int j = 0; j < N; ++j) {
      const auto i = std::size_t(j);
      if (j < section.present) {
        d.psi(j) = twist_rate(j, y);
        d.torque(j) = b.curvature[i][1] * b.moment[i][0] - b.curvature[i][0] * b.moment[i][1];
        mz = mz + y.torque(j);
        mass = mass + in_.tubes[i].mass;
      } else {
        d.psi(j) = d.torque(j) = 0.0;
      }
    }
    if (has_distributed_friction()) {
      for (int j = 0; j + 1 < section.present; ++j) {
        d.torque(j) = d.torque(j) - section.friction[std::size_t(j)];
        d.torque(j + 1) = d.torque(j + 1) + section.friction[std::size_t(j)];
      }
    }
    const S &ux = u[0], &uy = u[1];
    d.m(0) = y.n(1) - uy * mz;
    d.m(1) = ux * mz - y.n(0);
    d.n(0) = -(uy * y.n(2)) - mass * y.g(0);
    d.n(1) = ux * y.n(2) - mass * y.g(1);
    d.n(2) = uy * y.n(0) - ux * y.n(1) - mass * y.g(2);
    d.g(0) = -(uy * y.g(2));
    d.g(1) = ux * y.g(2);
    d.g(2) = uy * y.g(0) - ux * y.g(1);
    return d;
  }

  /// The cross-section behind the event `id` of the one in front of it.
  Section behind(int id, const Section& section) const noexcept {
    Section near = section;
    if (id < N) {
      near.present = id + 1;
      near.curved[std::size_t(id)] = has_curve(id);
      near.along[std::size_t(id)] = in_.tubes[std::size_t(id)].length;
    } else {
      near.curved[std::size_t(id - N)] = false;
    }
    locate(near);
    return near;
  }

  /// Lets the effects act at a breakpoint of Contacts<N>.
  /// @param next   the next one towards the base
  /// @param reach  distance to it [m]
  void apply_breakpoint(int id, const Section& far, const Section& near, int next, const S& reach, State& y,
                        Frame<S>& frame) const noexcept {
    if constexpr (Fx::template On<N, S>::has_breakpoint) {
      if (!in_.effects.acts_at_breakpoints()) return;
      using Kind = typename Breakpoint<S, N>::Kind;
      const bool at_plate = id == Contacts<N>::plate;
      Breakpoint<S, N> s{
          .kind = at_plate ? Kind::plate
                  : id < N ? Kind::tube_tip
                           : Kind::curve_start,
          .tube = at_plate ? -1 : id % N,
          .moment = {y.m(0), y.m(1)},
          .force = {y.n(0), y.n(1)},
          .far = side(far, y),
          .near = at_plate ? Side{.present = near.present, .moment = moments_behind_plate(near, y)} : side(near, y),
          .reach = reach};
      s.beyond = s.near;
      if (s.kind == Kind::tube_tip && next != Contacts<N>::plate && in_.effects.look_beyond()) {
        Section there = near;
        for (std::size_t i = 0; i < std::size_t(near.present); ++i) there.along[i] = there.along[i] - reach;
        s.beyond = side(behind(next, there), y);
      }
      for (std::size_t i = 0; i < N; ++i) {
        s.stiffness[i] = in_.tubes[i].k;
        s.torque[i] = 0.0;
      }
      s.kink = s.shift = {0.0, 0.0};
      in_.effects.breakpoint(s);
      for (int i = 0; i < near.present; ++i) y.torque(i) = y.torque(i) + s.torque[std::size_t(i)];
      if (!vanishes(s.shift[0]) || !vanishes(s.shift[1])) {
        const S straight[3] = {0.0, 0.0, 0.0};
        move_by_exponential(frame, straight, S(-s.shift[0]), S(-s.shift[1]), S(0.0));
      }
      kink(s.kink, near.present, y, frame);
    }
  }

  std::array<std::array<S, 2>, N> moments(const Section& section, const State& y) const noexcept {
    return side(section, y).moment;
  }
  Side side(const Section& section, const State& y) const noexcept {
    const Sharing b = shared_moment(section, y);
    Side r{.present = section.present, .curvature = b.u, .moment = {}};
    for (int j = 0; j < N; ++j) {
      const auto i = std::size_t(j);
      if (j < section.present) {
        r.moment[i] = {b.cosine[i] * b.moment[i][0] - b.sine[i] * b.moment[i][1],
                       b.sine[i] * b.moment[i][0] + b.cosine[i] * b.moment[i][1]};
      } else {
        r.moment[i] = {0.0, 0.0};
      }
    }
    return r;
  }

  /// The guide behind the plate keeps the tubes straight: each carries what straightens it, Bishop frame.
  std::array<std::array<S, 2>, N> moments_behind_plate(const Section& section, const State& y) const noexcept {
    std::array<std::array<S, 2>, N> m;
    for (int j = 0; j < N; ++j) {
      const auto i = std::size_t(j);
      const Material<S> mat = material_of(section, j);
      const std::array<S, 2> q = constitutive::response<S>(mat, mat.curvature[0], mat.curvature[1]).moment;
      S s, c;
      sincos(y.psi(j), s, c);
      m[i] = {s * q[1] - c * q[0], -(s * q[0] + c * q[1])};
    }
    return m;
  }

  /// Passes a kink towards the base: the near frame is the far one turned back by it. Tubes keep their torque, as in a
  /// joint of constant velocity. A kink along the moment then has a potential if that is the moment seen from the frame
  /// halfway through the kink, which differs from the far one by kink x torque / 2.
  void kink(std::array<S, 2> turn, int present, State& y, Frame<S>& frame) const noexcept {
    S mz = 0.0;
    for (int i = 0; i < present; ++i) mz = mz + y.torque(i);
    const S square = y.m(0) * y.m(0) + y.m(1) * y.m(1);
    if (value(square) > 1e-30) {
      const S half = 0.5 * mz * (turn[0] * y.m(0) + turn[1] * y.m(1)) * inverse(square);
      turn = {turn[0] + half * turn[1], turn[1] - half * turn[0]};
    }
    const S z = turn[0] * turn[0] + turn[1] * turn[1];
    const ExpCoefficients q = exp_coefficients(value(z));
    const S A = mapped(z, 1 - value(z) * q.C, -q.C - value(z) * q.dC), B = mapped(z, q.B, q.dB);
    const auto turned = [&](S& x, S& y_, S& z_) {  // v + A t x v + B t x (t x v)
      const S &a = turn[0], &b = turn[1];
      const S cx = b * z_, cy = -(a * z_), cz = a * y_ - b * x;
      const S dx = b * cz, dy = -(a * cz), dz = a * cy - b * cx;
      x = x + A * cx + B * dx;
      y_ = y_ + A * cy + B * dy;
      z_ = z_ + A * cz + B * dz;
    };
    turned(y.m(0), y.m(1), mz);
    turned(y.n(0), y.n(1), y.n(2));
    turned(y.g(0), y.g(1), y.g(2));
    const S back[3] = {-turn[0], -turn[1], S(0.0)};
    move_by_exponential(frame, back, S(0.0), S(0.0), S(0.0));
  }

  const Inputs& in_;
  bool varied_;                ///< whether effects change what tubes are made of
  bool distributed_friction_;  ///< whether friction acts along the tubes
};

}  // namespace ctcr
