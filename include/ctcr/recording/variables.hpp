#pragma once
// Parameters of a system by which something is differentiated: their lanes, and the inputs of the rod with derivatives.
#include <numbers>
#include <span>

#include "ctcr/recording/path.hpp"
#include "ctcr/system/parameters.hpp"

namespace ctcr::detail {

/// How far a parameter of a system reaches: it changes the reading of a given tip, the tip by the equations of the standard
/// model, or these equations themselves.
enum class Reach { reading, tip, equations };

/// Of each parameter of SystemParameters<N, Fx>.
template <int N, class Fx>
inline constexpr auto reaches = [] {
  using V = ParameterVector<N>;
  std::array<Reach, std::size_t(SystemParameters<N, Fx>::count)> reach{};
  for (int k = 0; k < V::index(Parameter::tracker_position); ++k) reach[std::size_t(k)] = Reach::tip;
  typename Fx::template On<N>{}.for_each([&](const auto& effect, int first) {
    using E = std::remove_cvref_t<decltype(effect)>;
    for (int k = 0; k < E::count; ++k)
      reach[std::size_t(V::count + first + k)] = ActsOnRod<E, double, N> || HasEnvironment<E, double> ? Reach::equations
                                                 : ActsOnJoints<E, double, N>                         ? Reach::tip
                                                                                                      : Reach::reading;
  });
  return reach;
}();

/// Lanes of some parameters.
template <int N, class Fx>
class Variables {
  static constexpr int count = SystemParameters<N, Fx>::count;

public:
  Variables() noexcept { lane_.fill(-1), variable_.fill(-1); }

  /// @param variable  its index among the variables   @param parameter  its index in SystemParameters<N, Fx>
  void put(int lane, int variable, int parameter) noexcept {
    lane_[std::size_t(parameter)] = lane;
    variable_[std::size_t(lane)] = variable;
    ++size_;
  }
  [[nodiscard]] int size() const noexcept { return size_; }
  /// Of a parameter; -1 if it has none.
  [[nodiscard]] int lane(int parameter) const noexcept { return lane_[std::size_t(parameter)]; }

  /// seed(x, parameter): x with its derivatives in a window.
  template <class Window>
  [[nodiscard]] auto seeding(const Window& window) const noexcept {
    return [this, window](double x, int parameter) noexcept {
      const int at = lane(parameter);
      return at < 0 ? typename Window::S(x) : window(x, at);
    };
  }

  /// Effects with their derivatives in a window; arguments as EffectList::On::seeded().
  template <class Some = Fx, class Window, class OfHistory = Constant<typename Window::S>>
  [[nodiscard]] auto effects(const typename Fx::template On<N>& plain, const Window& window,
                             const OfHistory& history = {}) const noexcept {
    const auto seed = seeding(window);
    return plain.template seeded<typename Window::S, Some>(
        [&](double x, int k) { return seed(x, ParameterVector<N>::count + k); }, history);
  }

  /// Calls f(lane, variable) for those of a window.
  void for_each_in(const auto& window, const auto& f) const noexcept {
    for (int i = window.first; i < std::min(window.first + window.size, int(lanes)); ++i)
      if (variable_[std::size_t(i)] >= 0) f(i, variable_[std::size_t(i)]);
  }

private:
  static constexpr int lanes = count + N + 8 + Contacts<N>::count;  // unknowns, a load and contacts may have some, too
  std::array<int, std::size_t(count)> lane_;
  std::array<int, std::size_t(lanes)> variable_;
  int size_ = 0;
};

template <int N, class S>
TubeParameters<S> tube_of(const Tube& t, int i, const auto& seed) noexcept {
  using P = ParameterVector<N>;
  const auto field = [&](Parameter kind) { return S(seed(t.*P::info(kind).field, P::index(kind, i))); };
  constexpr double pi = std::numbers::pi;
  const S inner = field(Parameter::inner_diameter), outer = field(Parameter::outer_diameter);
  const S inner2 = inner * inner, outer2 = outer * outer;
  const S k = t.bending_stiffness > 0
                  ? field(Parameter::bending_stiffness)
                  : field(Parameter::youngs_modulus) * ((pi / 64) * (outer2 * outer2 - inner2 * inner2));
  return {k,
          k * inverse(1.0 + field(Parameter::poisson_ratio)),
          field(Parameter::curvature),
          field(Parameter::length),
          field(Parameter::curved_length),
          field(Parameter::density) * ((pi / 4) * (outer2 - inner2))};
}

/// All that the rod depends on in a row that was predicted, but for its effects.
/// @param actuate  actuate(beta, alpha): what effects make of the joints
template <class S, int N, class Fx>
RodInputs<N, S, Fx> rod_inputs(const System<N, Fx>& system, const RecordedRow<N>& row, const TipLoad& load,
                               const auto& seed, const auto& actuate) noexcept {
  const Robot<N>& robot = system.model.robot();
  RodInputs<N, S, Fx> in;
  joints_of<N, S>(system.transmission, row.theta, seed, in.beta, in.alpha);
  actuate(in.beta, in.alpha);
  for (int i = 0; i < N; ++i) in.tubes[std::size_t(i)] = tube_of<N, S>(robot.tubes[std::size_t(i)], i, seed);
  for (int i = 0; i < 3; ++i) {
    const auto k = std::size_t(i);
    in.gravity[k] = seed(robot.gravity[i], ParameterVector<N>::index(Parameter::gravity, i));
    in.moment[k] = load.moment[i];
    in.force[k] = load.force[i];
  }
  return in;
}

}  // namespace ctcr::detail
