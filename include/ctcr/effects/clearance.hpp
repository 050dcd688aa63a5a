#pragma once
// Kinks where the tubes are held loosely or softly: clearance between the tubes, clearance and compliance of the front plate.
#include "ctcr/effects/hooks.hpp"
#include "ctcr/math/functions.hpp"

namespace ctcr {
namespace detail {

/// How soon the whole tilt of a clearance is reached.
inline constexpr EffectParameter saturation_moment{.name = "moment",
                                                   .unit = "N m",
                                                   .neutral = 0.01,
                                                   .sigma = 0.005,
                                                   .soft = {0.002, 0.05},
                                                   .hard = {0.0005, 0.5},
                                                   .role = Role::shape,
                                                   .meaning = "at which 76 % of the tilt is reached"};

/// Of the surfaces that lie against one another.
inline constexpr EffectParameter contact_compliance{.name = "contact_compliance",
                                                    .unit = "rad/(N m)",
                                                    .neutral = 0,
                                                    .sigma = 0.02,
                                                    .soft = {0, 0.2},
                                                    .hard = {-1, 5},
                                                    .role = Role::detail,
                                                    .meaning = "of the contact, added to the tilt"};

/// Where the tubes turn in the front plate.
inline constexpr EffectParameter pivot_depth{.name = "pivot",
                                             .unit = "m",
                                             .neutral = 0,
                                             .sigma = 0.01,
                                             .soft = {-0.005, 0.04},
                                             .hard = {-0.1, 0.2},
                                             .role = Role::shape,
                                             .meaning = "depth behind the front of the plate about which it tilts"};

/// Tilt [rad] under a moment [N m]: `tilt` along `direction`, plus compliance times the moment.
template <class P>
[[nodiscard]] std::array<P, 2> tilt_under(const std::array<P, 2>& moment, const P& tilt,
                                          const std::array<P, 2>& direction, const P& compliance) noexcept {
  return {tilt * direction[0] + compliance * moment[0], tilt * direction[1] + compliance * moment[1]};
}

/// The moment about a pivot that lies `depth` [m] behind a breakpoint [N m].
template <class P, int N>
[[nodiscard]] std::array<P, 2> moment_about(const Breakpoint<P, N>& b, const P& depth) noexcept {
  return {b.moment[0] - depth * b.force[1], b.moment[1] + depth * b.force[0]};
}

/// Adds a kink [rad].
template <class P, int N>
void kink(Breakpoint<P, N>& b, const std::array<P, 2>& turn) noexcept {
  for (std::size_t i = 0; i < 2; ++i) b.kink[i] = b.kink[i] + turn[i];
}

/// Adds a kink [rad] about a pivot `depth` [m] behind the breakpoint.
template <class P, int N>
void kink_about(Breakpoint<P, N>& b, const std::array<P, 2>& turn, const P& depth) noexcept {
  kink(b, turn);
  b.shift[0] = b.shift[0] + depth * turn[1];
  b.shift[1] = b.shift[1] - depth * turn[0];
}

}  // namespace detail

namespace clearance {
inline constexpr EffectInfo info{
    .id = "clearance",
    .title = "Clearance between the tubes",
    .physics = "Tubes fit loosely: where an outer tube ends, the inner ones lean to one side.",
    .signature =
        "A kink whose direction follows a bending moment and whose size grows less than in proportion to it. It turns "
        "with the tubes, with a load or without.",
    .measure = "Turn one tube against the others; load with different weights: a kink stays, a compliance grows.",
    .look_alikes = "entry_clearance softening sensor_offset",
    .reference = "Ha, Fagogenis & Dupont 2019; Sensors 2023, 23, 3709; law 1: beams in a bore",
    .form_error = 0.5,
    .starts = {{{"law", 1.0}}, {{"law", 2.0}}},
};
inline constexpr std::array parameters{
    EffectParameter{
        .name = "tilt",
        .unit = "rad",
        .neutral = 0,
        .sigma = 0.0087,
        .soft = {-0.03, 0.03},
        .hard = {-0.2, 0.2},
        .per_tube = true,
        .meaning = "tilt of the inner tubes at the tip of a tube (none at the innermost); with laws 0 and 2 at most"},
    detail::saturation_moment.named("moment", "at which 76 % of the tilt is reached; with law 1 all of it"),
    detail::contact_compliance,
    choice_of_law(
        3,
        "the moment along which the tubes lean, and how far: 0 the one that the inner tubes carry out of the "
        "outer tube, up to the tilt; 1 the one that the outer tube carries just before its end and hands over "
        "there, and the tilt grows with its square root; 2 the same moment, up to the tilt"),
};
}  // namespace clearance

namespace entry_compliance {
inline constexpr EffectInfo info{
    .id = "entry_compliance",
    .title = "Compliance where the tubes leave the plate",
    .physics = "The front plate or its bushing gives way.",
    .signature = "The whole robot turns about the entry, in proportion to the moment there.",
    .measure = "Hang different weights; put a sensor near the plate.",
    .look_alikes = "entry_clearance tip_load",
    .reference = "practice",
    .needs = {.loads = true},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "compliance",
                    .unit = "rad/(N m)",
                    .neutral = 0,
                    .sigma = 0.5,
                    .soft = {0, 3},
                    .hard = {-5, 50},
                    .meaning = "of the entry against bending"},
    detail::pivot_depth,
};
}  // namespace entry_compliance

namespace entry_clearance {
inline constexpr EffectInfo info{
    .id = "entry_clearance",
    .title = "Clearance in the front plate",
    .physics = "The bore is wider than the outer tube, which leans to one side.",
    .signature = "The whole robot tilts about the entry by a constant angle whose direction follows the moment there.",
    .measure = "Hang different weights: a tilt stays, a compliance grows.",
    .look_alikes = "entry_compliance clearance",
    .reference = "practice",
    .needs = {.loads = true},
};
inline constexpr std::array parameters{
    EffectParameter{.name = "tilt",
                    .unit = "rad",
                    .neutral = 0,
                    .sigma = 0.0087,
                    .soft = {0, 0.03},
                    .hard = {-0.1, 0.2},
                    .meaning = "largest tilt"},
    detail::saturation_moment,
    detail::contact_compliance,
    detail::pivot_depth,
};
}  // namespace entry_clearance

/// Where a tube ends, the tubes inside it tilt within its clearance: along the moment that they carry on (law 0), or along
/// the one that the ending tube hands over to them (laws 1 and 2). Without a load and beyond all curved parts the first one
/// is zero; the second one is how hard the tubes bend each other.
///
/// With laws 0 and 2 they tilt as stiff tubes do in a short bore: up to an angle that the gap allows. Law 1 is that of
/// beams in a bore. An outer tube (EI = K) that carries the moment M up to its end leaves the inner ones (EI = k together)
/// there with the force F, and holds them l behind it, across the gap, with F l = |M|. Between, their curvatures part by
/// c F (distance from there), c = 1/k + 1/K, which makes the centre lines part by c F l^3/6 = 2 gap: the inner ones turn
/// by sqrt(3 gap M / c) / k against tubes that fit, within l = sqrt(12 gap / (c M)).
///
/// The lean lowers the elastic energy, by E(M) with dE/dM = -(angle by which the inner tubes turn against the outer one).
/// So a torque of -dE/d(angle of the tube) acts on each tube and turns it to where the tubes bend each other harder. Where
/// a tube starts to curve or ends within l, moments and curvatures are means of those on its two sides, the side towards
/// the base with the weight exp(-4 distance / l). `tools/oracle/bore.py` confirms the law without these assumptions.
template <int N, class P = double>
struct Clearance : EffectValues<clearance::parameters, N, P> {
  static constexpr const EffectInfo& info = clearance::info;
  static constexpr bool looks_beyond = true;

  void breakpoint(Breakpoint<P, N>& b) const noexcept {
    if (b.kind != Breakpoint<P, N>::Kind::tube_tip) return;
    const P &tilt = this->template get<0>(b.tube), &size = this->template get<1>(),
            &compliance = this->template get<2>();
    const double law = value(this->template get<3>());
    const auto outer = std::size_t(b.tube);
    if (law < 0.5 || law > 1.5) {
      const std::array<P, 2>& moment = law < 0.5 ? b.moment : b.near.moment[outer];
      detail::kink(b, detail::tilt_under(moment, tilt, saturated(moment, size), compliance));
      return;
    }
    P inner_stiffness = 0.0;
    for (std::size_t i = 0; i < outer; ++i) inner_stiffness = inner_stiffness + b.stiffness[i];
    const P farther = weight_beyond(b, inner_stiffness * tilt, size);
    const auto mean = [&](const std::array<P, 2>& near, const std::array<P, 2>& beyond) -> std::array<P, 2> {
      return {near[0] + farther * (beyond[0] - near[0]), near[1] + farther * (beyond[1] - near[1])};
    };
    const std::array<P, 2> moment = mean(b.near.moment[outer], b.beyond.moment[outer]),
                           turn = detail::tilt_under(moment, tilt, rooted(moment, size), compliance),
                           u = mean(b.near.curvature, b.beyond.curvature);
    detail::kink(b, turn);
    for (std::size_t i = 0; i <= outer; ++i) {
      const std::array<P, 2> m = mean(b.near.moment[i], b.beyond.moment[i]);
      const P &k = b.stiffness[i], torque = turn[1] * (k * u[0] - m[0]) - turn[0] * (k * u[1] - m[1]);
      b.torque[i] = b.torque[i] + (i < outer ? torque : -(inner_stiffness * inverse(k) * torque));
    }
  }

private:
  /// exp(-4 distance / l) of the next breakpoint towards the base; l = 2 k tilt / sqrt(M size), with the root of the sum
  /// of squares of the outer tube's moments on its two sides for M.
  /// @param bending  k tilt [N m^2 rad]
  static P weight_beyond(const Breakpoint<P, N>& b, const P& bending, const P& size) noexcept {
    constexpr double tiny = 1e-20;  // (N m)^2: the root has a slope at 0
    constexpr double most = 50;     // beyond that nothing is left
    P square = tiny;
    for (const auto* side : {&b.near, &b.beyond})
      for (const P& m : side->moment[std::size_t(b.tube)]) square = square + m * m;
    const P over = 2.0 * b.reach * square_root(square_root(square) * size), under = magnitude(bending);
    return value(over) < most * value(under) ? exponential_of(P(-(over * inverse(under)))) : P(0.0);
  }
};

/// The tubes leave the front plate turned in proportion to the moment that they carry there.
template <int N, class P = double>
struct EntryCompliance : EffectValues<entry_compliance::parameters, N, P> {
  static constexpr const EffectInfo& info = entry_compliance::info;

  void breakpoint(Breakpoint<P, N>& b) const noexcept {
    if (b.kind != Breakpoint<P, N>::Kind::plate) return;
    const P &compliance = this->template get<0>(), &depth = this->template get<1>();
    const auto moment = detail::moment_about(b, depth);
    detail::kink_about(b, {compliance * moment[0], compliance * moment[1]}, depth);
  }
};

/// The tubes tilt within the bore of the front plate, along the moment that they carry there.
template <int N, class P = double>
struct EntryClearance : EffectValues<entry_clearance::parameters, N, P> {
  static constexpr const EffectInfo& info = entry_clearance::info;

  void breakpoint(Breakpoint<P, N>& b) const noexcept {
    if (b.kind != Breakpoint<P, N>::Kind::plate) return;
    const P& depth = this->template get<3>();
    const auto moment = detail::moment_about(b, depth);
    detail::kink_about(b,
                       detail::tilt_under(moment, this->template get<0>(), saturated(moment, this->template get<1>()),
                                          this->template get<2>()),
                       depth);
  }
};

}  // namespace ctcr
