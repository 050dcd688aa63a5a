#pragma once
#include <algorithm>

#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/functions.hpp"

namespace ctcr {
namespace friction {
inline constexpr EffectInfo info{
    .id = "friction",
    .title = "Friction between the tubes",
    .physics =
        "Tubes that turn inside one another rub: where they press on each other, at their ends, where they start to "
        "curve and in the front plate, or all along. The inner tube lags behind its base.",
    .signature =
        "The same joints give another pose when they are reached from the other side; the difference lasts until the "
        "motion reverses, and grows with the bending moments or with the length over which tubes overlap.",
    .measure = "Visit the same joints from both directions, each time after turning by at least 40 degrees.",
    .look_alikes = "backlash_rotation delay",
    .reference =
        "Lock & Dupont 2011; Ha, Fagogenis & Dupont 2019; bristle: Dahl 1968; contact: as plasticity with one "
        "circular yield surface, Simo & Hughes 1998",
    .needs = {.order = true},
    .variants = {{"coefficient", "coefficient"}, {"torque_per_length", "torque_per_length"}},
    .starts = {{{"law", 1.0}, {"slip_angle", 0.03}}, {{"insertion", 0.0}}},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "coefficient",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 0.02,
                    .soft = {0, 0.1},
                    .hard = {0, 0.3},
                    .per_tube = true,
                    .meaning = "friction torque per jump of the bending moment of all tubes inside the contact, of a "
                               "tube in the next outer one (of the outermost: in the front plate)"},
    EffectParameter{.name = "torque_per_length",
                    .unit = "N",
                    .neutral = 0,
                    .sigma = 0.01,
                    .soft = {0, 0.05},
                    .hard = {0, 0.5},
                    .meaning = "friction torque per length between a tube and the next outer one, all along, however "
                               "hard they press"},
    EffectParameter{.name = "slip_angle",
                    .unit = "rad",
                    .neutral = 6 * 0.017453292519943295,
                    .sigma = 0.1,
                    .soft = {0.005, 0.5},
                    .hard = {0.005, 3},
                    .role = Role::shape,
                    .meaning =
                        "rotation of the tubes where they touch after which friction has turned round to 63 %; with "
                        "the second law of a contact whose moment jumps by 0.05 N m, in others in proportion"},
    EffectParameter{.name = "insertion",
                    .unit = "",
                    .neutral = 1,
                    .sigma = 0.5,
                    .soft = {0, 1.5},
                    .hard = {0, 4},
                    .role = Role::shape,
                    .meaning = "share of the sliding by insertion that turns friction away from rotation: 0 none, 1 "
                               "as much as sliding by rotation at the outer radius of the inner tube"},
    EffectParameter{.name = "law",
                    .unit = "",
                    .neutral = 0,
                    .sigma = 1,
                    .soft = {0, 1},
                    .hard = {0, 1},
                    .role = Role::choice,
                    .meaning =
                        "0: a bristle that bends ever less; 1: an elastic contact of constant stiffness that slips at "
                        "once, rotation and insertion sharing one limit"},
};
}  // namespace friction

/// Friction torque between a tube and the next outer one: C |jump| h at each contact where the bending moment of the tubes
/// inside it jumps, and torque_per_length h along their overlap, h linear from contact to contact. h in [-1, 1] follows the
/// relative rotation of the two tubes at the contact (of the outermost tube: in the guide), that is the rotation of their
/// bases plus their relative torsion, so that a tube lags its base. Torsion and friction depend on one another: see
/// friction/solve_friction.hpp.
/// Internal state: h of each of Contacts<N>, and of the outermost tube in the plate; with the second law then the fraction
/// of each limit that insertion takes.
template <int N, class P = double>
struct Friction : EffectValues<friction::parameters, N, P, 2 * (Contacts<N>::count + 1)> {
  static constexpr const EffectInfo& info = friction::info;
  static constexpr bool follows_twist = true;

  void breakpoint(Breakpoint<P, N>& s) const noexcept {
    P dx = 0.0, dy = 0.0;
    for (int j = 0; j < s.near; ++j) {
      const auto i = std::size_t(j);
      dx = dx + (s.far_moment[i][0] - s.near_moment[i][0]);
      dy = dy + (s.far_moment[i][1] - s.near_moment[i][1]);
      // Both tubes must be there; the outermost rubs on the front plate alone.
      if (j + 1 < N ? j + 1 >= s.near : s.kind != Breakpoint<P, N>::Kind::plate) continue;
      constexpr double smooth = 1e-12;  // (N m)^2: the jump of a tube that does not jump has a slope
      const P& h = this->history.state[j + 1 < N ? Contacts<N>::index(j, s.number()) : in_plate];
      const P torque = this->template get<0>(j) * h * square_root(dx * dx + dy * dy + smooth);
      s.torque[i] = s.torque[i] - torque;
      if (j + 1 < s.near) s.torque[i + 1] = s.torque[i + 1] + torque;
    }
  }

  void distributed_friction(int breakpoint, std::array<P, N>& torque) const noexcept {
    for (int j = 0; j + 1 < N; ++j) {
      const auto i = std::size_t(j);
      torque[i] = torque[i] - this->template get<1>() * this->history.state[Contacts<N>::index(j, breakpoint)];
    }
  }

  /// Exactly along each straight move.
  void update_history(const Path<N, P>& path, std::size_t row) noexcept {
    if (row == 0) return;
    const auto &from = path.q[row - 1], &to = path.q[row];
    const bool bends = value(this->template get<4>()) < 0.5;
    const auto follow = [&](int tube, std::size_t contact, const P& turn, const P& slide) {
      P &h = this->history.state[contact], &k = this->history.state[limits + contact];
      if (bends) return bend(turn, slide, h);
      const P angle = slip_angle(tube, to.jumps[contact]);
      stretch(slip_angle(tube, from.jumps[contact]) * inverse(angle), h, k);
      slip(turn, slide, angle, h, k);
    };
    follow(N - 1, in_plate, to.alpha[N - 1] - from.alpha[N - 1],
           (to.beta[N - 1] - from.beta[N - 1]) * (1 / path.radius[N - 1]));
    for (int j = 0; j + 1 < N; ++j) {
      const auto i = std::size_t(j);
      const auto against_next = [&](const std::array<P, N>& v) -> P { return v[i] - v[i + 1]; };
      const P turn = against_next(to.alpha) - against_next(from.alpha);
      const P slide = (against_next(to.beta) - against_next(from.beta)) * (1 / path.radius[i]);
      for (int breakpoint = 0; breakpoint < Contacts<N>::breakpoints; ++breakpoint) {
        const std::size_t contact = Contacts<N>::index(j, breakpoint);
        follow(j, contact, turn + (to.twist[contact] - from.twist[contact]), slide);
      }
    }
  }

private:
  static constexpr std::size_t in_plate = Contacts<N>::count;  // the state of the outermost tube
  static constexpr std::size_t limits = Contacts<N>::count + 1;
  static constexpr double rest = 1e-12;  // [rad]: no division by 0 where nothing moves

  /// h' = turn' / slip - h (|turn'| + share |slide'|) / slip.
  void bend(const P& turn, const P& slide, P& h) const noexcept {
    const P travel = magnitude(turn) + this->template get<3>() * magnitude(slide) + rest;
    const P target = turn * inverse(travel);
    h = target + (h - target) * exponential_of(-(travel * inverse(this->template get<2>())));
  }

  /// Of a contact of a tube: limit / stiffness. The stiffness is that of a contact whose moment jumps as is usual.
  [[nodiscard]] P slip_angle(int tube, double jump) const noexcept {
    constexpr double usual = MomentJumps<N>::usual, least = 0.05;  // share of it: no division by 0
    constexpr double overlap = 0.05;                               // [m] of a contact, of what is rubbed all along
    const double grown = std::max(jump / usual, least);
    const P pressed = usual * this->template get<0>(tube), along = overlap * this->template get<1>();
    if (value(along) == 0) return grown * this->template get<2>();
    return this->template get<2>() * (grown * pressed + along) * inverse(pressed + along);
  }

  /// The limit of a contact changes; its stretch does not, as far as the new limit holds it.
  static void stretch(const P& factor, P& h, P& k) noexcept {
    h = factor * h;
    k = factor * k;
    const P square = h * h + k * k;
    if (!(value(square) > 1)) return;
    const P within = inverse(square_root(square));
    h = within * h;
    k = within * k;
  }

  /// (h, k)' = (turn', share slide') / slip within the unit circle; on it the part that points out is slip. There the angle
  /// to the motion falls as tan(angle / 2)' = -tan(angle / 2) / slip.
  void slip(const P& turn, const P& slide, const P& angle, P& h, P& k) const noexcept {
    const P shared = this->template get<3>() * slide, square = turn * turn + shared * shared;
    if (!(value(square) > rest * rest)) return;
    const P travel = square_root(square), c = turn * inverse(travel), s = shared * inverse(travel);
    P far = travel * inverse(angle), along = h * c + k * s, across = k * c - h * s;
    const P room = 1.0 - across * across;  // the circle is met where along^2 is that
    const P edge = value(room) > 1e-12 ? square_root(room) : P(0.0);
    if (value(along + far) < value(edge)) {
      along = along + far;
    } else {
      // tan(angle / 2) = sin / (1 + cos), the angle that of (along, across) on the circle.
      far = far - (edge - along);
      const P half = across * inverse(1.0 + edge) * exponential_of(-far);
      const P norm = inverse(1.0 + half * half);
      along = (1.0 - half * half) * norm;
      across = 2.0 * half * norm;
    }
    h = along * c - across * s;
    k = along * s + across * c;
  }
};

}  // namespace ctcr
