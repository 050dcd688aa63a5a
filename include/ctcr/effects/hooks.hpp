#pragma once
// Where an effect may act. Each hook is a const noexcept member of the effect; P is the scalar of its parameters, so that
// one code gives values and exact derivatives.
//
//   material(TubePlace<P>, Material<P>&)         what a tube is made of at a place
//   station(Station<P, N>&)                      torques between tubes, and kinks, where tubes end or start to curve
//   grip(torque, angle&)                         angles of the tubes at their grasped ends
//   tip_force(gravity, force&)                   a force at the robot tip, base frame
//   environment(position, force&)                the same, depending on where the tip is
//   actuate(Occasion, beta&, alpha&)            joints that the tubes really have
//   sense(Occasion, Frame<P>& reading)          what the tracker makes of the sensor's pose, tracker frame
//   remember(Path<N>, row)                       makes past.state, left by the rows before, that of this row
#include <array>
#include <span>
#include <tuple>
#include <utility>

#include "ctcr/effects/effect.hpp"
#include "ctcr/math/se3.hpp"
#include "ctcr/robot/joints.hpp"

namespace ctcr {

/// A place on a tube, which need not be deployed.
template <class P>
struct TubePlace {
  int tube;     ///< from 0, innermost first
  bool curved;  ///< in the part that the data sheet calls curved
  P along;      ///< arc length of the tube from its grasped point [m]
  P part;       ///< position within the curved or the straight part, 0 at its start, 1 at its end
};

/// What a tube is made of at a place; on entry as its data sheet says. Its bending moment, tube frame x and y, is
/// EI d / (1 + softening |d|^2), d = u - curvature, with a stiffness that may differ by direction.
template <class P>
struct Material {
  P bending_stiffness;                      ///< EI, mean of all directions [N m^2]
  std::array<P, 2> anisotropy{{0.0, 0.0}};  ///< EI_x = EI (1 + a0), EI_y = EI (1 - a0), EI_xy = EI a1
  std::array<P, 2> curvature;               ///< of the free tube about its x and y axes [1/m]
  P twist = 0.0;                            ///< of the free tube [rad/m]
  P softening = 0.0;                        ///< [m^2]
};

/// A place where a tube ends or starts to be curved, or the front plate. Vectors in the Bishop frame on its far side.
template <class P, int N>
struct Station {
  enum class Kind { tube_tip, curve_start, plate } kind;
  int tube;                 ///< whose tip or curve start; -1 at the plate
  int far, near;            ///< tubes present on the side of the robot tip, and on that of the base
  std::array<P, 2> moment;  ///< bending moment of all tubes on the far side [N m]
  std::array<std::array<P, 2>, N> far_moment, near_moment;  ///< bending moment of each tube on both sides [N m]
  std::array<P, N> torque{};  ///< out: added to the torque of each tube towards the base [N m]
  std::array<P, 2> kink{};    ///< out: turn of the far side against the near one [rad]
};

/// When a row was measured, and how.
struct Occasion {
  double time = 0;  ///< [s]; NaN: unknown
  double part = 0;  ///< of the measurements' duration, 0 to 1
  int run = 0;
  Vec3 centre = Vec3::Zero();  ///< of all measured positions, tracker frame [m]
};

/// The recorded path: joints move in a straight line from row to row.
template <int N>
struct Path {
  std::span<const Joints<N>> q;
  std::span<const double> time;  ///< [s]; empty: unknown
};

/// An effect of the tip's surroundings.
template <class Effect, class P>
concept HasEnvironment = requires(const Effect& effect, const std::array<P, 3>& position, std::array<P, 3>& force) {
  effect.environment(position, force);
};

/// Effects that act together, in their order.
template <template <int, class> class... E>
struct EffectList {
  static constexpr bool none = sizeof...(E) == 0;

  template <int N, class P = double>
  struct On {
    std::tuple<E<N, P>...> list{};

    static constexpr int count = (0 + ... + E<N, P>::count);  ///< values of all parameters

    /// What the past left behind in each effect.
    using Memory = std::tuple<typename E<N, P>::Past...>;
    void remember(const Memory& memory) noexcept {
      [&]<std::size_t... I>(std::index_sequence<I...>) {
        ((std::get<I>(list).past = std::get<I>(memory)), ...);
      }(std::index_sequence_for<E<N, P>...>{});
    }

    /// The same effects with the scalar S; value(x, place) gives a parameter's value its derivatives, and those of what
    /// the past left behind follow.
    template <class S, class Value>
    [[nodiscard]] On<N, S> seeded(const Value& value) const noexcept {
      On<N, S> r;
      int first = 0;
      [&]<std::size_t... I>(std::index_sequence<I...>) {
        (seed(std::get<I>(list), std::get<I>(r.list), std::exchange(first, first + E<N, P>::count), value), ...);
      }(std::index_sequence_for<E<N, P>...>{});
      return r;
    }

    /// Calls f(effect, place of its first value) for each.
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

    void material(const TubePlace<P>& place, Material<P>& m) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.material(place, m); }) e.material(place, m);
      });
    }
    void station(Station<P, N>& s) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.station(s); }) e.station(s);
      });
    }
    void grip(const std::array<P, N>& torque, std::array<P, N>& angle) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.grip(torque, angle); }) e.grip(torque, angle);
      });
    }
    void tip_force(const std::array<P, 3>& gravity, std::array<P, 3>& force) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.tip_force(gravity, force); }) e.tip_force(gravity, force);
      });
    }
    /// Whether the tip's surroundings act on it.
    static constexpr bool has_environment = (false || ... || HasEnvironment<E<N, P>, P>);
    void environment(const std::array<P, 3>& position, std::array<P, 3>& force) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.environment(position, force); }) e.environment(position, force);
      });
    }
    void actuate(const Occasion& at, std::array<P, N>& beta, std::array<P, N>& alpha) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.actuate(at, beta, alpha); }) e.actuate(at, beta, alpha);
      });
    }
    void sense(const Occasion& at, Frame<P>& reading) const noexcept {
      for_each([&](const auto& e, int) {
        if constexpr (requires { e.sense(at, reading); }) e.sense(at, reading);
      });
    }

  private:
    template <class From, class To, class Value>
    static void seed(const From& from, To& to, int first, const Value& value) noexcept {
      for (std::size_t k = 0; k < from.values.size(); ++k) to.values[k] = value(from.values[k], first + int(k));
      for (std::size_t i = 0; i < from.past.state.size(); ++i) {
        auto& state = to.past.state[i] = from.past.state[i];
        for (std::size_t k = 0; k < from.values.size(); ++k)
          state = state + from.past.slope[i][k] * (to.values[k] - from.values[k]);
      }
    }
  };
};

/// The standard model.
using Standard = EffectList<>;

}  // namespace ctcr
