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
        "Friction resists the rotation and insertion of a tube in the next outer one: at contacts, where the tubes "
        "press "
        "on each other (their ends, the starts of their curves and the front plate), or all along their overlap. The "
        "tip "
        "of the inner tube lags behind its base.",
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
                    .meaning =
                        "friction torque of a tube against the next outer one (of the outermost tube: against the "
                        "front plate) at a contact, divided by the jump of the bending moment there"},
    EffectParameter{.name = "torque_per_length",
                    .unit = "N",
                    .neutral = 0,
                    .sigma = 0.01,
                    .soft = {0, 0.05},
                    .hard = {0, 0.5},
                    .meaning = "friction torque per length between a tube and the next outer one, all along their "
                               "overlap, independent of the contact force"},
    EffectParameter{.name = "slip_angle",
                    .unit = "rad",
                    .neutral = 6 * 0.017453292519943295,
                    .sigma = 0.1,
                    .soft = {0.005, 0.5},
                    .hard = {0.005, 3},
                    .role = Role::shape,
                    .meaning =
                        "relative rotation at a contact after which friction has reversed to 63 %; with law 1 at a "
                        "contact whose moment jumps by 0.05 N m, at others in proportion to their jump"},
    EffectParameter{.name = "insertion",
                    .unit = "",
                    .neutral = 1,
                    .sigma = 0.5,
                    .soft = {0, 1.5},
                    .hard = {0, 4},
                    .role = Role::shape,
                    .meaning =
                        "weight of sliding by insertion against sliding by rotation: 0 insertion does not matter, "
                        "1 it counts as much as rotation at the outer radius of the inner tube"},
    choice_of_law(2,
                  "constitutive law: 0 a bristle, stiffness decreasing towards the limit (Dahl); 1 elastic with "
                  "constant stiffness up to the limit, which rotation and insertion share"),
};
}  // namespace friction

/// Friction torque between a tube and the next outer one (the outermost tube: the front plate). At a contact it is
/// coefficient x |jump of the bending moment of all tubes inside the contact| x h, along the overlap torque_per_length x h,
/// with h linear between contacts. The internal state h in [-1, 1] of each contact follows the relative rotation there: that
/// of the bases plus the relative torsion, which depends on friction in turn (friction/solve_friction.hpp).
/// State: h of each of Contacts<N>, then that of the outermost tube in the plate; then, in the same order and with law 1
/// alone, the part k of each limit that insertion takes.
template <int N, class P = double>
struct Friction : EffectValues<friction::parameters, N, P, 2 * (Contacts<N>::count + 1)> {
  static constexpr const EffectInfo& info = friction::info;
  static constexpr bool depends_on_torsion = true;

  void breakpoint(Breakpoint<P, N>& s) const noexcept {
    P dx = 0.0, dy = 0.0;
    for (int j = 0; j < s.near.present; ++j) {
      const auto i = std::size_t(j);
      dx = dx + (s.far.moment[i][0] - s.near.moment[i][0]);
      dy = dy + (s.far.moment[i][1] - s.near.moment[i][1]);
      // Both tubes must be there; the outermost touches the front plate alone.
      if (j + 1 < N ? j + 1 >= s.near.present : s.kind != Breakpoint<P, N>::Kind::plate) continue;
      constexpr double smooth = 1e-12;  // (N m)^2: the jump of a tube that does not jump has a slope
      const P& h = this->history.state[j + 1 < N ? Contacts<N>::index(j, s.number()) : in_plate];
      const P torque = this->template get<0>(j) * h * square_root(dx * dx + dy * dy + smooth);
      s.torque[i] = s.torque[i] - torque;
      if (j + 1 < s.near.present) s.torque[i + 1] = s.torque[i + 1] + torque;
    }
  }

  void distributed_friction(int breakpoint, std::array<P, N>& torque) const noexcept {
    for (int j = 0; j + 1 < N; ++j) {
      const auto i = std::size_t(j);
      torque[i] = torque[i] - this->template get<1>() * this->history.state[Contacts<N>::index(j, breakpoint)];
    }
  }

  /// Integrates the constitutive law exactly along a straight motion.
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
        follow(j, contact, turn + (to.torsion[contact] - from.torsion[contact]), slide);
      }
    }
  }

private:
  static constexpr std::size_t in_plate = Contacts<N>::count;  // the state of the outermost tube
  static constexpr std::size_t limits = Contacts<N>::count + 1;
  static constexpr double rest = 1e-12;  // [rad]: no division by 0 where nothing moves

  /// Law 0: h' = turn' / slip_angle - h (|turn'| + insertion |slide'|) / slip_angle.
  void bend(const P& turn, const P& slide, P& h) const noexcept {
    const P travel = magnitude(turn) + this->template get<3>() * magnitude(slide) + rest;
    const P target = turn * inverse(travel);
    h = target + (h - target) * exponential_of(-(travel * inverse(this->template get<2>())));
  }

  /// Law 1: limit / stiffness of a contact. The stiffness is the same at all contacts: that of the usual moment jump.
  [[nodiscard]] P slip_angle(int tube, double jump) const noexcept {
    constexpr double usual = MomentJumps<N>::usual, least = 0.05;  // fraction of it: no division by 0
    constexpr double overlap = 0.05;  // [m] of distributed friction that counts with a contact
    const double grown = std::max(jump / usual, least);
    const P pressed = usual * this->template get<0>(tube), along = overlap * this->template get<1>();
    if (value(along) == 0) return grown * this->template get<2>();
    return this->template get<2>() * (grown * pressed + along) * inverse(pressed + along);
  }

  /// Law 1: the limit of a contact changes by 1 / factor; its elastic deformation does not, within the new limit.
  static void stretch(const P& factor, P& h, P& k) noexcept {
    h = factor * h;
    k = factor * k;
    const P square = h * h + k * k;
    if (!(value(square) > 1)) return;
    const P within = inverse(square_root(square));
    h = within * h;
    k = within * k;
  }

  /// Law 1: (h, k)' = (turn', insertion slide') / angle within the unit circle, the yield surface; on it the outward part is
  /// slip. There the angle a of (h, k) to the motion falls as tan(a / 2)' = -tan(a / 2) / angle.
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
