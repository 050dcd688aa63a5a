#pragma once
// The hooks by which an effect acts. Each is a const noexcept member of the effect, but for update_history(). P is the
// scalar of its parameters: double, or a dual number, so that one code gives values and exact derivatives. Vectors are in
// the Bishop frame unless said otherwise. Real time: yes, all hooks: noexcept, no allocation, bounded.
//
//   actuate(Occasion, beta&, alpha&)            joints that the tubes really have [m], [rad]
//   material(TubePoint<P>, Material<P>&)         free shape and constitutive law of a tube at a point along it
//   breakpoint(Breakpoint<P, N>&)                torques between tubes, and kinks of the robot, where a tube ends or starts
//                                                to curve and at the front plate
//   distributed_friction(breakpoint, torque&)    torque per length on each tube from the next outer one, at a breakpoint [N]
//   base_compliance(torque, angle&)              angles of the tubes at their grasped ends, under the torque there
//   tip_force(gravity, force&)                   a constant force at the robot tip, base frame [N]
//   environment(position, force&)                a force at the robot tip that depends on where the tip is, base frame [N]
//   sense(Occasion, Frame<P>& reading)           the reading of the tracker, on entry the pose of the sensor, tracker frame
//   update_history(Path<N, P>, row)              takes history.state from the row before to this one
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <tuple>
#include <type_traits>
#include <utility>

#include "ctcr/effects/effect.hpp"
#include "ctcr/math/se3.hpp"
#include "ctcr/robot/contacts.hpp"
#include "ctcr/robot/joints.hpp"

namespace ctcr {

/// A point along a tube, deployed or not.
template <class P>
struct TubePoint {
  int tube;     ///< from 0, innermost first
  bool curved;  ///< in the part that the data sheet calls curved
  P along;      ///< arc length of the tube from its grasped point [m]
  P within;     ///< arc length from the start of the curved or the straight part [m]
  P part;       ///< the same as a fraction of that part, 0 at its start, 1 at its end
};

/// Free shape and constitutive law of a tube at one point, on entry those of its data sheet. The bending moment in the tube
/// frame (x, y) is f EI A d, d = u - curvature, A = 1 + [a0 a1; a1 -a0]. Softening reduces the stiffness by the factor
/// f = r + (1 - r) (1 + q^(p/2))^(-1/p), q = 2 c z / (1 - r), z = d A d: from 1 for small d to r for large d. The elastic
/// energy is convex, so every moment belongs to one curvature.
template <class P>
struct Material {
  P bending_stiffness;                      ///< EI, mean of all directions [N m^2]
  std::array<P, 2> anisotropy{{0.0, 0.0}};  ///< a0, a1
  std::array<P, 2> curvature;               ///< of the free tube about its x and y axes [1/m]
  P softening = 0.0;                        ///< c [m^2]
  P plateau = 0.25;                         ///< r
  P sharpness = 2.0;                        ///< p: how sharp the transition is
};

/// An arc length at which a tube ends or starts to be curved, or the front plate. Vectors in the Bishop frame on its far
/// side, towards the robot tip.
template <class P, int N>
struct Breakpoint {
  enum class Kind { tube_tip, curve_start, plate } kind;
  int tube;                      ///< whose tip or curve start; -1 at the plate
  std::array<P, 2> moment;       ///< bending moment of all tubes on the far side [N m]
  std::array<P, 2> force;        ///< shear force there, Bishop frame [N]
  std::array<P, N> stiffness{};  ///< bending stiffness of each tube [N m^2]
  /// The tubes on one side.
  struct Side {
    int present;                             ///< tubes 1..present
    std::array<P, 2> curvature{};            ///< of the centreline [1/m]
    std::array<std::array<P, 2>, N> moment;  ///< bending moment of each tube [N m]
  };
  Side far, near;             ///< towards the robot tip and towards the base
  Side beyond{};              ///< at the tip of a tube the near side of the next breakpoint towards the base, if that
                              ///< were here; else as `near`
  P reach;                    ///< distance to that one [m]
  std::array<P, N> torque{};  ///< out: added to the torque of each tube towards the base [N m]
  std::array<P, 2> kink{};    ///< out: rotation of the far side against the near one, along `moment` [rad]
  std::array<P, 2> shift{};   ///< out: displacement of the far side against the near one [m]; at the plate alone

  /// Its number among those of Contacts<N>.
  [[nodiscard]] int number() const noexcept {
    return kind == Kind::plate ? Contacts<N>::plate : kind == Kind::tube_tip ? tube : N + tube;
  }
};

/// When a row was measured, in which run and session.
struct Occasion {
  double time = 0;             ///< [s]; NaN: unknown
  double part = 0;             ///< fraction of the session that has passed, 0 to 1
  int run = 0;                 ///< number of its run
  Vec3 centre = Vec3::Zero();  ///< of all measured positions, tracker frame [m]
};

/// The path of the joints through a recording: a straight line from row to row. Joints carry derivatives by the
/// transmission.
template <int N, class P>
struct Path {
  struct Row {
    std::array<P, N> beta, alpha;     ///< [m], [rad]
    RelativeTorsion<N, P> torsion{};  ///< as in RecordedRow
    MomentJumps<N> jumps;             ///< the same
  };
  std::span<const Row> q;
  std::span<const double> time;        ///< [s]; empty: unknown
  std::span<const std::size_t> first;  ///< index of the row at which the run of each row begins; empty: unknown
  ContactRadii<N> radius{};
};

/// A force that depends on where the tip is.
template <class Effect, class P>
concept HasEnvironment = requires(const Effect& effect, const std::array<P, 3>& position, std::array<P, 3>& force) {
  effect.environment(position, force);
};

/// Torques or kinks at breakpoints.
template <class Effect, class P, int N>
concept HasBreakpoint = requires(const Effect& effect, Breakpoint<P, N>& breakpoint) { effect.breakpoint(breakpoint); };

/// Friction between tubes along their overlap.
template <class Effect, class P, int N>
concept HasDistributedFriction =
    requires(const Effect& effect, std::array<P, N>& torque) { effect.distributed_friction(0, torque); };

/// An effect on the free shape or the constitutive law of the tubes.
template <class Effect, class P>
concept HasMaterial =
    requires(const Effect& effect, const TubePoint<P>& at, Material<P>& m) { effect.material(at, m); };

/// An effect whose history depends on the relative rotation of the tubes at their contacts.
template <class Effect>
concept DependsOnTorsion = requires { Effect::depends_on_torsion; };

/// An effect that acts at the tip of a tube by what is behind the next breakpoint.
template <class Effect>
concept LooksBeyond = requires { Effect::looks_beyond; };

/// An effect on the angles at the grasped ends.
template <class Effect, class P, int N>
concept HasBaseCompliance = requires(const Effect& effect, const std::array<P, N>& torque, std::array<P, N>& angle) {
  effect.base_compliance(torque, angle);
};

/// A force at the robot tip that does not depend on where the tip is.
template <class Effect, class P>
concept HasTipForce =
    requires(const Effect& effect, const std::array<P, 3>& g, std::array<P, 3>& force) { effect.tip_force(g, force); };

/// An effect that changes the equilibrium of the rod.
template <class Effect, class P, int N>
concept ActsOnRod = HasBreakpoint<Effect, P, N> || HasDistributedFriction<Effect, P, N> || HasMaterial<Effect, P> ||
                    HasBaseCompliance<Effect, P, N> || HasTipForce<Effect, P>;

/// An effect on the joints.
template <class Effect, class P, int N>
concept ActsOnJoints =
    requires(const Effect& effect, const Occasion& at, std::array<P, N>& q) { effect.actuate(at, q, q); };

/// An effect on the reading of the tracker.
template <class Effect, class P>
concept HasSense = requires(const Effect& effect, const Occasion& at, Frame<P>& reading) { effect.sense(at, reading); };

/// Where an effect acts between motors and reading, as its hooks say.
struct ActsOn {
  bool joints = false, rod = false, tip = false, reading = false;
};
template <class Effect, class P, int N>
inline constexpr ActsOn acts_on{.joints = ActsOnJoints<Effect, P, N>,
                                .rod = HasBreakpoint<Effect, P, N> || HasDistributedFriction<Effect, P, N> ||
                                       HasMaterial<Effect, P> || HasBaseCompliance<Effect, P, N>,
                                .tip = HasTipForce<Effect, P> || HasEnvironment<Effect, P>,
                                .reading = HasSense<Effect, P>};

/// Numbers without derivatives.
template <class S>
struct Constant {
  S operator()(double x, int) const noexcept { return x; }
};

template <template <int, class> class... E>
struct EffectList;

namespace detail {
/// Whether no type stands among them twice.
template <class... T>
inline constexpr bool all_differ = true;
template <class First, class... Rest>
inline constexpr bool all_differ<First, Rest...> = (true && ... && !std::is_same_v<First, Rest>) && all_differ<Rest...>;

/// Kept, followed by those of E for which `picked` holds.
template <auto picked, class Kept, template <int, class> class... E>
struct Picked {
  using List = Kept;
};
template <auto picked, template <int, class> class... Kept, template <int, class> class E,
          template <int, class> class... Rest>
struct Picked<picked, EffectList<Kept...>, E, Rest...>
  : Picked<picked,
           std::conditional_t<picked.template operator()<E<2, double>>(), EffectList<Kept..., E>, EffectList<Kept...>>,
           Rest...> {};

/// Whether `wanted` holds for the id of an effect.
template <auto wanted>
struct HasId {
  template <class Effect>
  constexpr bool operator()() const noexcept {
    return wanted(Effect::info.id);
  }
};
/// One copy for all effects, which would fill tens of kilobytes if each unrolled its own.
template <class From, class To, class Seed>
CTCR_NOINLINE inline void seed_all(std::span<const From> from, std::span<To> to, int first, const Seed& seed) noexcept {
  for (std::size_t k = 0; k < from.size(); ++k) to[k] = seed(from[k], first + int(k));
}
}  // namespace detail

/// Effects that act together, in their order.
template <template <int, class> class... E>
struct EffectList {
  static_assert(detail::all_differ<E<2, double>...>, "an effect stands in the list twice");
  static_assert((true && ... && requires { typename E<2, double>::History; }),
                "an effect derives from EffectValues<parameters, N, P> (effect.hpp)");

  static constexpr bool none = sizeof...(E) == 0;
  /// The effects that change the equilibrium of the rod, in the same order.
  using OnRod =
      typename detail::Picked<[]<class Effect> { return ActsOnRod<Effect, double, 2>; }, EffectList<>, E...>::List;
  /// The effects with a force that depends on the position of the tip.
  using OnTip =
      typename detail::Picked<[]<class Effect> { return HasEnvironment<Effect, double>; }, EffectList<>, E...>::List;
  /// The effects on joints.
  using OnJoints =
      typename detail::Picked<[]<class Effect> { return ActsOnJoints<Effect, double, 2>; }, EffectList<>, E...>::List;
  /// The one whose history depends on the relative torsion of the tubes, or none.
  using OnTorsion =
      typename detail::Picked<[]<class Effect> { return DependsOnTorsion<Effect>; }, EffectList<>, E...>::List;
  /// The effects on the reading of the tracker.
  using OnReading =
      typename detail::Picked<[]<class Effect> { return HasSense<Effect, double>; }, EffectList<>, E...>::List;
  /// The effects with some ids, in the same order.
  /// @tparam wanted  wanted(id), id a std::string_view: whether an effect is among them
  template <auto wanted>
  using Those = typename detail::Picked<detail::HasId<wanted>{}, EffectList<>, E...>::List;

  template <int N, class P = double>
  struct On {
    [[no_unique_address]] std::tuple<E<N, P>...> list{};

    static constexpr int count = (0 + ... + E<N, P>::count);    ///< values of all parameters
    static constexpr int states = (0 + ... + E<N, P>::states);  ///< length of the internal state of all effects
    /// Whether One is among them.
    template <class One>
    static constexpr bool contains = (false || ... || std::is_same_v<One, E<N, P>>);
    /// Whether any of them acts at breakpoints.
    static constexpr bool has_breakpoint = (false || ... || HasBreakpoint<E<N, P>, P, N>);
    /// Whether friction acts along the tubes.
    static constexpr bool has_distributed_friction = (false || ... || HasDistributedFriction<E<N, P>, P, N>);
    /// Whether the history of one depends on the relative torsion of the tubes.
    static constexpr bool depends_on_torsion = (false || ... || DependsOnTorsion<E<N, P>>);
    /// Whether any force depends on where the tip is.
    static constexpr bool has_environment = (false || ... || HasEnvironment<E<N, P>, P>);

    /// Internal state of each effect, as the motion so far left it.
    using History = std::tuple<typename E<N, P>::History...>;
    [[nodiscard]] History history() const noexcept {
      return std::apply([](const auto&... effect) { return History{effect.history...}; }, list);
    }
    void set_history(const History& history) noexcept {
      [&]<std::size_t... I>(std::index_sequence<I...>) {
        ((std::get<I>(list).history = std::get<I>(history)), ...);
      }(std::index_sequence_for<E<N, P>...>{});
    }

    /// Updates the internal state by the motion to a row of the path, after that to the row before.
    void update_history(const Path<N, P>& path, std::size_t row) noexcept {
      for_each([&](auto& effect, int) {
        if constexpr (requires { effect.update_history(path, row); }) effect.update_history(path, row);
      });
    }

    /// The same effects with the scalar S.
    /// @tparam Some  EffectList of those that are wanted
    /// @param value    value(x, index) gives a parameter's value its derivatives
    /// @param history  history(x, index) gives them to an entry of the internal state; indices are those in this list
    template <class S, class Some = EffectList, class Value, class OfHistory = Constant<S>>
    [[nodiscard]] auto seeded(const Value& value, const OfHistory& history = {}) const noexcept {
      using Chosen = typename Some::template On<N, S>;
      Chosen r;
      int first = 0, first_state = 0;
      [[maybe_unused]] const auto seed_if_wanted = [&]<class To>(const auto& from, std::type_identity<To>) {
        if constexpr (Chosen::template contains<To>) {
          To& to = std::get<To>(r.list);
          detail::seed_all<P, S>(from.values, to.values, first, value);
          if constexpr (requires { to.profiles = from.profiles; }) to.profiles = from.profiles;
          to.active = acts(to);
          if (to.active) detail::seed_all<P, S>(from.history.state, to.history.state, first_state, history);
        }
        first += from.count;
        first_state += from.states;
      };
      (seed_if_wanted(std::get<E<N, P>>(list), std::type_identity<E<N, S>>{}), ...);
      return r;
    }

    /// The effects that change the equilibrium of the rod.
    [[nodiscard]] typename OnRod::template On<N, P> on_rod() const noexcept {
      typename OnRod::template On<N, P> r;
      std::apply([&](auto&... effect) { ((effect = std::get<std::remove_cvref_t<decltype(effect)>>(list)), ...); },
                 r.list);
      return r;
    }

    /// Whether every parameter has a value.
    [[nodiscard]] bool finite() const noexcept {
      bool all = true;
      for_each([&](const auto& e, int) {
        for (const P& x : e.values) all = all && std::isfinite(value(x));
      });
      return all;
    }

    /// Whether any effect changes the equilibrium of the rod; the others act on joints, load and readings.
    [[nodiscard]] bool act_on_rod() const noexcept {
      return any([](const auto& e) { return ActsOnRod<std::remove_cvref_t<decltype(e)>, P, N> && acts(e); });
    }
    /// Whether an active effect acts at breakpoints.
    [[nodiscard]] bool acts_at_breakpoints() const noexcept {
      return any([](const auto& e) { return HasBreakpoint<std::remove_cvref_t<decltype(e)>, P, N> && e.active; });
    }
    /// Whether an active effect needs Breakpoint::beyond.
    [[nodiscard]] bool look_beyond() const noexcept {
      return any([](const auto& e) { return LooksBeyond<std::remove_cvref_t<decltype(e)>> && e.active; });
    }
    /// Whether an active effect lets friction act along the tubes.
    [[nodiscard]] bool acts_by_distributed_friction() const noexcept {
      return any(
          [](const auto& e) { return HasDistributedFriction<std::remove_cvref_t<decltype(e)>, P, N> && e.active; });
    }
    /// Whether an active effect changes the free shape or the constitutive law of a tube.
    [[nodiscard]] bool acts_on_material() const noexcept {
      return any([](const auto& e) { return HasMaterial<std::remove_cvref_t<decltype(e)>, P> && e.active; });
    }

    /// Whether an effect acts whose history depends on the relative torsion of the tubes.
    [[nodiscard]] bool act_by_torsion() const noexcept {
      return any([](const auto& e) {
        if constexpr (DependsOnTorsion<std::remove_cvref_t<decltype(e)>>) return acts(e);
        return false;
      });
    }

    /// Calls f(effect, index of its first value) for each.
    template <class F>
    constexpr void for_each(const F& f) noexcept {
      int first = 0;
      std::apply([&](auto&... effect) { (f(effect, std::exchange(first, first + effect.count)), ...); }, list);
    }
    template <class F>
    constexpr void for_each(const F& f) const noexcept {
      int first = 0;
      std::apply([&](const auto&... effect) { (f(effect, std::exchange(first, first + effect.count)), ...); }, list);
    }

    void material(const TubePoint<P>& at, Material<P>& m) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (HasMaterial<std::remove_cvref_t<decltype(e)>, P>)
          if (e.active) e.material(at, m);
      });
    }
    void breakpoint(Breakpoint<P, N>& s) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.breakpoint(s); })
          if (e.active) e.breakpoint(s);
      });
    }
    void distributed_friction(int breakpoint, std::array<P, N>& torque) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (HasDistributedFriction<std::remove_cvref_t<decltype(e)>, P, N>)
          if (e.active) e.distributed_friction(breakpoint, torque);
      });
    }
    void base_compliance(const std::array<P, N>& torque, std::array<P, N>& angle) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.base_compliance(torque, angle); })
          if (e.active) e.base_compliance(torque, angle);
      });
    }
    void tip_force(const std::array<P, 3>& gravity, std::array<P, 3>& force) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.tip_force(gravity, force); })
          if (e.active) e.tip_force(gravity, force);
      });
    }
    void environment(const std::array<P, 3>& position, std::array<P, 3>& force) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.environment(position, force); })
          if (e.active) e.environment(position, force);
      });
    }
    void actuate(const Occasion& at, std::array<P, N>& beta, std::array<P, N>& alpha) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.actuate(at, beta, alpha); })
          if (e.active) e.actuate(at, beta, alpha);
      });
    }
    void sense(const Occasion& at, Frame<P>& reading) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.sense(at, reading); })
          if (e.active) e.sense(at, reading);
      });
    }

  private:
    [[nodiscard]] bool any(const auto& holds) const noexcept {
      return std::apply([&](const auto&... effect) { return (false || ... || holds(effect)); }, list);
    }

    /// Whether an amplitude or a detail differs from its neutral value or has derivatives.
    template <class Effect>
    static bool acts(const Effect& effect) noexcept {
      if constexpr (requires { effect.profiles; }) return effect.profiles != nullptr && !effect.profiles->empty();
      auto next = effect.values.begin();
      for (int k = 0; k < int(effect.parameters.size()); ++k) {
        const EffectParameter& parameter = effect.parameters[std::size_t(k)];
        const bool counts = parameter.role == Role::amplitude || parameter.role == Role::detail;
        for (int i = 0; i < effect.size(k); ++i, ++next) {
          if (counts && !vanishes(*next - parameter.neutral)) return true;
        }
      }
      return false;
    }
  };
};

/// The effect of a list whose history depends on the relative torsion of the tubes.
template <class Fx, int N, class P = double>
using TorsionEffect = std::tuple_element_t<0, decltype(Fx::OnTorsion::template On<N, P>::list)>;

/// The standard model.
using Standard = EffectList<>;

}  // namespace ctcr
