#pragma once
// One integration of the rod from its tip to the front plate.
//
// Shooting starts at the tip because every guess is then an exact equilibrium: of the same robot with other base angles
// and a turned load. Newton's method walks through equilibria only, and derivatives by base angles cost nothing.
#include "ctcr/mechanics/events.hpp"
#include "ctcr/mechanics/steppers.hpp"
#include "ctcr/mechanics/steps.hpp"
#include "ctcr/mechanics/tangent_pass.hpp"

namespace ctcr {

/// Everything carried along the rod: given at the tip, found at the front plate. Body vectors in the Bishop frame,
/// which at the tip is tube 1's material frame.
template <class S, int N>
struct RobotState {
  std::array<S, N> psi, w;  ///< angle [rad] and twist rate [rad/m] of each tube; beyond its tip: their values there
  std::array<S, 2> m;       ///< bending moment, x and y [N m]
  std::array<S, 3> n;       ///< force [N]
  std::array<S, 3> g;       ///< gravity [m/s^2]
};

/// The tips of tubes 2..N in the frame of the robot tip: a Bishop frame and the angle of the tube in it.
template <int N>
struct TubeTips {
  std::array<Frame<double>, N - 1> frame;
  std::array<double, N - 1> psi;

  template <class S>
  CTCR_INLINE void keep(int tube, const Frame<S>& at, const S& angle) noexcept {
    frame[std::size_t(tube - 1)] = at;
    psi[std::size_t(tube - 1)] = value(angle);
  }
};

/// Observer that records nothing.
struct NoRecord {
  template <class... A>
  void operator()(const A&...) const noexcept {}
};

/// Tubes of the current segment.
template <int N>
struct SegmentTubes {
  int present = 0;  ///< tubes 1..present
  int near = 0;     ///< tubes present or beginning at the far end of the segment; with the Jacobian the plate is one
  int curved_count = 0, straight_count = 0;
  std::array<int, N> curved{}, straight{};

  CTCR_INLINE void add(int tube, bool is_curved) noexcept {
    present = tube + 1;
    if (is_curved)
      curved[std::size_t(curved_count++)] = tube;
    else
      straight[std::size_t(straight_count++)] = tube;
  }
  CTCR_INLINE void straighten(int tube) noexcept {
    int kept = 0;
    for (int i = 0; i < curved_count; ++i) {
      curved[std::size_t(kept)] = curved[std::size_t(i)];
      kept += curved[std::size_t(i)] != tube;
    }
    curved_count = kept;
    straight[std::size_t(straight_count++)] = tube;
  }
};

/// Integrates the rod for scalars S (state), P (robot parameters) and H (segment lengths).
/// @tparam Col  the columns that S differentiates along (columns.hpp)
template <int N, class S, class P, class H, bool Loaded, bool Gravity, class Stepper, class Col>
class Shooting {
public:
  using State = RobotState<S, N>;
  using Length = H;

  /// Integrates from the tip to s = 0.
  /// @param arc_length  H arc_length(event, s): arc length of an event with its derivatives [m]
  /// @param plate   0 with its derivatives [m]
  /// @param y       in: state at the tip; out: at the front plate
  /// @param frame   out: Bishop frame at the front plate as seen from the tip frame
  /// @param tips    tips.keep(tube, frame, angle) at the tip of each tube but the first
  /// @param record  record(s, tubes, state, frame) at both ends of every step
  /// Real time: yes (2N segments).
  template <class ArcLength, class Tips, class Record = NoRecord>
  static CTCR_INLINE void run(const Coefficients<N, P>& c, const Events<N>& events, const ArcLength& arc_length,
                        const H& plate, const Steps<N>& steps, State& y, Frame<S>& frame, Tips& tips,
                        const Record& record = {}) noexcept {
    SegmentTubes<N> tubes;
    set_identity(frame);
    H here = arc_length(events.id[0], events.s[0]);
    for (std::size_t e = 0; e < 2 * N && (events.s[e] > 0 || tubes.present < N); ++e) {
      const int id = events.id[e];
      if (id < N) {
        tubes.add(id, c.curved[std::size_t(id)]);
        if (id > 0) tips.keep(id, frame, y.psi[std::size_t(id)]);
      } else {
        tubes.straighten(id - N);
      }
      // Tips at the plate leave segments of no length: the plate moves in the last of them, which has all tubes.
      const bool at_plate = e + 1 == 2 * N || !(events.s[e + 1] > 0);
      const H next = !at_plate ? arc_length(events.id[e + 1], events.s[e + 1]) : tubes.present == N ? plate : H{};
      tubes.near = tubes.present + (at_plate ? Col::jacobian : events.id[e + 1] < N);
      advance(c, tubes, next - here, events.s[e], steps.after(id), y, frame, record);
      here = next;
    }
  }

  /// Integrates over `h` from `s`, inside the segment of `tubes`, in `steps` steps. Real time: yes.
  template <class Record, int NC = 0>
  static CTCR_INLINE void advance(const Coefficients<N, P>& c, const SegmentTubes<N>& tubes, const H& h, double s, int steps,
                            State& y, Frame<S>& frame, const Record& record) noexcept {
    if constexpr (NC < N) {
      if (tubes.curved_count != NC) return advance<Record, NC + 1>(c, tubes, h, s, steps, y, frame, record);
    }
    advance_curved<NC>(c, tubes, h, s, steps, y, frame, record);
  }

  /// Curvature of the centreline [1/m] at the state `y` in the segment of `tubes`, without derivatives. Real time: yes.
  template <int NC = 0>
  static CTCR_INLINE std::array<double, 2> centreline_curvature(const Coefficients<N, P>& c, const SegmentTubes<N>& tubes,
                                                          const State& y) noexcept {
    if constexpr (NC < N) {
      if (tubes.curved_count != NC) return centreline_curvature<NC + 1>(c, tubes, y);
    }
    if constexpr (NC > 0 || Loaded) {
      RodSection<double, double, NC> r;
      RodRates<double, NC> k;
      std::array<double, NC> psi;
      std::array<double, 2> m{};
      r.compliance = value(c.compliance[std::size_t(tubes.present - 1)]);
      for (std::size_t i = 0; i < NC; ++i) {
        const auto t = std::size_t(tubes.curved[i]);
        r.a[i] = value(c.a[t]), r.rho[i] = value(c.rho[t]), psi[i] = value(y.psi[t]);
      }
      if constexpr (Loaded) m = {value(y.m[0]), value(y.m[1])};
      curvature<Loaded>(r, psi, m, k);
      return k.u;
    } else {
      return {};
    }
  }

private:
  using Values = std::conditional_t<is_dual<S>, Frame<double>, Frame<S>>;
  static constexpr bool has_tangent_pass = is_dual<S> && !is_dual<P> && Stepper::has_tangent_pass;
  static constexpr TangentOf of =
      Col::jacobian ? TangentOf::frame : (Loaded ? TangentOf::rotation : TangentOf::nothing);

  static CTCR_INLINE void set_identity(Frame<S>& frame) noexcept {
    static_cast<Values&>(frame) = Values{};
    if constexpr (is_dual<S>)
      for (int i = 0; i < 3; ++i)
        for (std::size_t g = 0; g < std::size_t(groups_of<S>); ++g) {
          if constexpr (of != TangentOf::nothing) frame.rotation_twist[i][g] = Lanes{};
          if constexpr (of == TangentOf::frame) frame.translation_twist[i][g] = Lanes{};
        }
  }

  // A step moves the rod between two layouts, by the functions gather, scatter and section. They copy one part of each
  // number: all of it, its value, or its tangents along one group of four columns.
  //
  //                     gather, section                                   scatter
  //   RobotState<S, N>  --- all --------> RodState<S, NC>       step      --------> RobotState<S, N>   direct_step
  //   by tube, 1..N     --- value ------> RodState<double, NC>  step      --------> by tube, 1..N      tangent_step
  //                     --- tangents g -> GroupState<NC>        tangents  -------->                    tangent_group
  //
  // Angles and twist rates of the curved tubes are packed in the order of SegmentTubes::curved; straight tubes keep their
  // twist rate, and their angle follows from it.
  struct All {
    CTCR_INLINE const S& operator()(const S& x) const noexcept { return x; }
    CTCR_INLINE S& operator()(S& x) const noexcept { return x; }
  };
  struct Value {
    CTCR_INLINE const double& operator()(const S& x) const noexcept { return x.v; }
    CTCR_INLINE double& operator()(S& x) const noexcept { return x.v; }
  };
  template <int g>
  struct Tangents {
    CTCR_INLINE Lanes operator()(const S& x) const noexcept { return x.d[g]; }
    CTCR_INLINE Lanes& operator()(S& x) const noexcept { return x.d[g]; }
  };

  template <int NC, class Part, class Rod>
  static CTCR_INLINE void gather(const SegmentTubes<N>& tubes, const State& y, Rod& z, const Part& part) noexcept {
    for (std::size_t i = 0; i < NC; ++i) {
      const auto t = std::size_t(tubes.curved[i]);
      z.psi[i] = part(y.psi[t]);
      z.w[i] = part(y.w[t]);
    }
    if constexpr (Loaded)
      for (std::size_t i = 0; i < 3; ++i) {
        if (i < 2) z.m[i] = part(y.m[i]);
        z.n[i] = part(y.n[i]);
        if constexpr (Gravity) z.g[i] = part(y.g[i]);
      }
  }

  template <int NC, class Part, class Rod>
  static CTCR_INLINE void scatter(const SegmentTubes<N>& tubes, const Rod& z, State& y, const Part& part) noexcept {
    for (std::size_t i = 0; i < NC; ++i) {
      const auto t = std::size_t(tubes.curved[i]);
      part(y.psi[t]) = z.psi[i];
      part(y.w[t]) = z.w[i];
    }
    if constexpr (Loaded)
      for (std::size_t i = 0; i < 3; ++i) {
        if (i < 2) part(y.m[i]) = z.m[i];
        part(y.n[i]) = z.n[i];
        if constexpr (Gravity) part(y.g[i]) = z.g[i];
      }
  }

  template <int NC, class T, class Part>
  static CTCR_INLINE RodSection<T, P, NC> section(const Coefficients<N, P>& c, const SegmentTubes<N>& tubes, const State& y,
                                            const Part& part) noexcept {
    RodSection<T, P, NC> r;
    const auto last = std::size_t(tubes.present - 1);
    r.compliance = c.compliance[last];
    if constexpr (Gravity) r.weight = c.weight[last];
    for (std::size_t i = 0; i < NC; ++i) {
      const auto t = std::size_t(tubes.curved[i]);
      r.a[i] = c.a[t];
      r.rho[i] = c.rho[t];
      r.kz[i] = c.kz[t];
    }
    if constexpr (Loaded) {
      r.straight_mz = 0.0;
      for (int i = 0; i < tubes.straight_count; ++i) {
        const auto t = std::size_t(tubes.straight[std::size_t(i)]);
        r.straight_mz = r.straight_mz + c.kz[t] * part(y.w[t]);
      }
    }
    return r;
  }

  template <int NC, class Record>
  static void advance_curved(const Coefficients<N, P>& c, const SegmentTubes<N>& tubes, const H& h, double s, int steps,
                             State& y, Frame<S>& frame, const Record& record) noexcept {
    const H k = steps == 1 ? h : (1.0 / steps) * h;
    for (int i = 1;; ++i) {
      record(s, tubes, y, frame);
      if constexpr (has_tangent_pass && (Loaded || NC > 0))
        tangent_step<NC>(c, tubes, k, y, frame);
      else
        direct_step<NC>(c, tubes, k, y, frame);
      s += value(k);
      if (i >= steps) break;
    }
    record(s, tubes, y, frame);
  }

  /// A step of values and tangents together.
  template <int NC>
  static CTCR_INLINE void direct_step(const Coefficients<N, P>& c, const SegmentTubes<N>& tubes, const H& k, State& y,
                                Frame<S>& frame) noexcept {
    RodState<S, NC> z;
    gather<NC>(tubes, y, z, All{});
    if constexpr (Loaded)
      Stepper::template loaded<Gravity>(section<NC, S>(c, tubes, y, All{}), z, frame, k);
    else if constexpr (NC > 0)
      Stepper::unloaded(section<NC, S>(c, tubes, y, All{}), z, frame, k);
    else
      move_straight(frame, k);
    for (int j = 0; j < tubes.straight_count; ++j) {
      const auto t = std::size_t(tubes.straight[std::size_t(j)]);
      y.psi[t] = y.psi[t] + k * y.w[t];
    }
    scatter<NC>(tubes, z, y, All{});
  }

  /// The same with the tangents in a pass of their own: values first, then four columns at a time.
  template <int NC>
  static CTCR_INLINE void tangent_step(const Coefficients<N, P>& c, const SegmentTubes<N>& tubes, const H& h, State& y,
                                 Frame<S>& frame) noexcept {
    RodState<double, NC> z;
    gather<NC>(tubes, y, z, Value{});
    const RodSection<double, double, NC> r = section<NC, double>(c, tubes, y, Value{});
    const double k = value(h);
    Stage<Loaded, Gravity, NC> stages[Loaded ? 4 : 3];
    Exponential step;
    RecordedFrame<of> recorded{frame, step};
    const auto record = [&](int i, const RodState<double, NC>& state, const RodRates<double, NC>& rates) {
      stages[i].keep(state, rates);
    };
    std::array<double, 2> u_mid, u_end;
    if constexpr (Loaded) {
      Stepper::template loaded<Gravity>(r, z, recorded, k, record);
      for (std::size_t i = 0; i < 2; ++i) u_mid[i] = 0.5 * (stages[1].u[i] + stages[2].u[i]);
      u_end = stages[3].u;
    } else {
      Stepper::unloaded(r, z, recorded, k, record);
      u_mid = stages[1].u;
      u_end = stages[2].u;
    }
    tangent_groups<0>(c, r, tubes, stages, step, u_mid, u_end, h, y, frame);
    for (int i = 0; i < tubes.straight_count; ++i) {
      const auto t = std::size_t(tubes.straight[std::size_t(i)]);
      y.psi[t].v += k * y.w[t].v;
    }
    scatter<NC>(tubes, z, y, Value{});
  }

  /// Groups g and later, those that have started.
  template <int g, class... A>
  static CTCR_INLINE void tangent_groups(const Coefficients<N, P>& c, const auto& r, const SegmentTubes<N>& tubes,
                                   A&... rest) noexcept {
    if constexpr (g < groups_of<S>) {
      constexpr int first = Col::starts_with(g);
      if constexpr (first <= N + 1)
        if (first == 1 || tubes.near >= first) tangent_group<g>(c, r, tubes, rest...);
      tangent_groups<g + 1>(c, r, tubes, rest...);
    }
  }

  template <int g, int NC>
  static CTCR_INLINE void tangent_group(const Coefficients<N, P>& c, const RodSection<double, double, NC>& r,
                                  const SegmentTubes<N>& tubes,
                                  const Stage<Loaded, Gravity, NC> (&stages)[Loaded ? 4 : 3], const Exponential& step,
                                  const std::array<double, 2>& u_mid, const std::array<double, 2>& u_end, const H& h,
                                  State& y, Frame<S>& frame) noexcept {
    constexpr int G = groups_of<S>;
    constexpr bool Dk = has_length_tangent<H, g>;
    using R = TangentPass<Loaded, Gravity, Dk, NC>;
    const double k = value(h);
    const Lanes dk = length_tangent<G>(h, g);
    GroupState<NC> z;
    Lanes mz{};
    for (int i = 0; i < tubes.straight_count; ++i) {
      const auto t = std::size_t(tubes.straight[std::size_t(i)]);
      const Lanes w = y.w[t].d[g];
      if constexpr (Loaded) mz += c.kz[t] * w;
      y.psi[t].d[g] += k * w;
      if constexpr (Dk) y.psi[t].d[g] += y.w[t].v * dk;
    }
    gather<NC>(tubes, y, z, Tangents<g>{});
    typename R::Curvature u[3];
    if constexpr (Loaded)
      R::loaded(r, stages, k, dk, mz, z, u);
    else
      R::unloaded(r, stages, k, dk, z, u);
    scatter<NC>(tubes, z, y, Tangents<g>{});
    if constexpr (of != TangentOf::nothing)
      R::template frame<of>(step, stages[0].u, u_mid, u_end, k, dk, u, &frame.rotation_twist[0][g],
                            &frame.translation_twist[0][g], std::size_t(G));
  }

  static CTCR_INLINE void move_straight(Frame<S>& g, const H& k) noexcept {
    move_along(g, k);
    if constexpr (is_dual<S>) {
      constexpr int G = int(sizeof(g.rotation_twist[0]) / sizeof(Lanes));
      for (int i = 0; i < G; ++i) {
        if constexpr (!Col::jacobian) break;
        g.translation_twist[0][i] += g.rotation_twist[1][i] * value(k);
        g.translation_twist[1][i] = g.translation_twist[1][i] - g.rotation_twist[0][i] * value(k);
        if constexpr (!std::is_same_v<H, double>) {
          constexpr int first = G - int(sizeof(k.d) / sizeof(Lanes));
          if (i >= first) g.translation_twist[2][i] += k.d[i - first];
        }
      }
    }
  }
};

}  // namespace ctcr
