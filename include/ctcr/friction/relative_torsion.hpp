#pragma once
// How tubes are turned against one another in equilibrium where they touch, and what friction there does to that.
#include <Eigen/LU>

#include "ctcr/math/functions.hpp"
#include "ctcr/mechanics/effect_evaluation.hpp"
#include "ctcr/mechanics/rod_in_equilibrium.hpp"
#include "ctcr/mechanics/solution.hpp"

namespace ctcr {

namespace detail {

/// Gathers psi_i - psi_i+1 at the contacts, from the robot tip to the plate.
template <int N, class S>
struct ContactAngles {
  std::array<S, std::size_t(Contacts<N>::count)> angle{};

  void operator()(int breakpoint, const auto& state) noexcept {
    if (breakpoint < N) present = breakpoint + 1;
    passed[std::size_t(breakpoint)] = true;
    for (int i = 0; i + 1 < N && i + 1 < present; ++i) {
      const S here = state.psi(i) - state.psi(i + 1);
      const auto fill = [&](const auto& which) {
        for (int k = 0; k < Contacts<N>::breakpoints; ++k)
          if (which(k)) angle[Contacts<N>::index(i, k)] = here;
      };
      if (breakpoint == i + 1)
        fill([](int) { return true; });
      else if (breakpoint == Contacts<N>::plate)
        fill([&](int k) { return k == breakpoint || (k >= N && !passed[std::size_t(k)]); });
      else
        fill([&](int k) { return k == breakpoint; });
    }
  }

private:
  int present = 0;
  std::array<bool, std::size_t(Contacts<N>::breakpoints)> passed{};
};

}  // namespace detail

/// The twist in equilibrium.
/// @param ws     the model's equilibrium, as solve() left it, else `last` is returned
/// @param steps  per segment, with which it was solved
/// @param last   of the configuration before; this one differs from it by less than half a turn
/// Real time: yes; one integration.
template <int N, class Fx>
[[nodiscard]] Twist<N> twist_of(const Model<N, Fx>& model, const Workspace<N>& ws, int steps, Twist<N> last) noexcept {
  if (!ws.warm) return last;
  const detail::RodInEquilibrium<N, Fx> rod(model, ws.q, ws.load);
  auto y = rod.at_tip(ws.guess);
  Frame<double> frame;
  detail::ContactAngles<N, double> angles;
  rod.rod.run(
      rod.events, steps, y, frame,
      [&](int breakpoint, const auto&, const auto& state, const auto&) { angles(breakpoint, state); },
      typename decltype(rod)::NoNode{});
  for (int i = 0; i + 1 < N; ++i) {
    const double at_base = ws.q.alpha[i] - ws.q.alpha[i + 1];
    for (int breakpoint = 0; breakpoint < Contacts<N>::breakpoints; ++breakpoint) {
      const std::size_t k = Contacts<N>::index(i, breakpoint);
      last[k] += wrapped(angles.angle[k] - at_base - last[k]);
    }
  }
  return last;
}

/// The jumps of the moments in equilibrium; arguments as above, but `last` is what is returned without one.
/// Real time: yes; one integration.
template <int N, class Fx>
[[nodiscard]] MomentJumps<N> moment_jumps(const Model<N, Fx>& model, const Workspace<N>& ws, int steps,
                                          const MomentJumps<N>& last) noexcept {
  if (!ws.warm) return last;
  const detail::RodInEquilibrium<N, Fx> rod(model, ws.q, ws.load);
  auto y = rod.at_tip(ws.guess);
  Frame<double> frame;
  MomentJumps<N> jumps;
  jumps.fill(0);
  const auto gather = [&](int breakpoint, const auto&, const auto&, const auto& moments) {
    const auto [far, near] = moments();
    double dx = 0, dy = 0;
    for (std::size_t i = 0; i < N; ++i) {
      dx += far[i][0] - near[i][0];
      dy += far[i][1] - near[i][1];
      const bool is_outermost = i + 1 == N;
      if (is_outermost && breakpoint != Contacts<N>::plate) continue;
      jumps[is_outermost ? Contacts<N>::count : Contacts<N>::index(int(i), breakpoint)] = std::hypot(dx, dy);
    }
  };
  rod.rod.run(rod.events, steps, y, frame, gather, typename decltype(rod)::NoNode{});
  return jumps;
}

/// Slopes of the twist. Rows are contacts whose twist changes.
template <int N>
struct TwistSlopes {
  using ByContact = Eigen::Matrix<double, Contacts<N>::count, Contacts<N>::count>;
  ByContact by_rubbing;  ///< by what is rubbed at each contact: the first states of what follows it
  Eigen::Matrix<double, Contacts<N>::count, Eigen::Dynamic> by_variables;  ///< those states held
};

template <int N>
inline constexpr int first_variable = N + 2 + Contacts<N>::count;

/// Arguments as twist_of().
/// @tparam Most      variables at most
/// @param variables  how many there are besides what is rubbed
/// @param inputs     inputs(window): RodInputs of the equilibrium, with derivatives by them, in lanes from
///                   first_variable<N> on
/// Real time: yes without variables, else it allocates; an integration for each 16 of unknowns, contacts and variables.
template <int Most, int N, class Fx>
[[nodiscard]] TwistSlopes<N> twist_slopes(const Model<N, Fx>& model, const Workspace<N>& ws, int steps, int variables,
                                          const auto& inputs) noexcept {
  using Window = detail::Window<4>;
  using Pass = detail::EffectPass<N, Fx, Window::groups>;
  using S = typename Window::S;
  constexpr int unknowns = Pass::unknowns, contacts = Contacts<N>::count;
  static_assert(first_variable<N> == unknowns + contacts);
  const int known = contacts + variables;
  Eigen::Matrix<double, unknowns, unknowns> by_unknown;
  Eigen::Matrix<double, contacts, unknowns> turned_by_unknown;
  Eigen::Matrix<double, unknowns, Eigen::Dynamic, 0, unknowns, contacts + Most> by_known(unknowns, known);
  Eigen::Matrix<double, contacts, Eigen::Dynamic, 0, contacts, contacts + Most> turned(contacts, known);
  const auto put = [&](int lane, auto& unknown_part, auto& known_part, int row, double x) {
    if (lane < unknowns)
      unknown_part(row, lane) = x;
    else if (lane < unknowns + known)
      known_part(row, lane - unknowns) = x;
  };
  for (Window window; window.first < unknowns + known; window.first += window.size) {
    RodInputs<N, S, Fx> in = inputs(window);
    in.effects.for_each([&](auto& effect, int) {
      if constexpr (FollowsTwist<std::remove_cvref_t<decltype(effect)>>)
        for (int k = 0; k < contacts; ++k) window.add(effect.history.state[std::size_t(k)], unknowns + k, 1);
    });
    detail::ContactAngles<N, S> angles;
    const Pass pass(in, sort_events(model.coefficients().plain, ws.q.beta), ws.guess, 0, steps, window,
                    [&](int breakpoint, const auto& state) { angles(breakpoint, state); });
    LaneRow<Window::groups> row[Pass::rows];
    pass.write(row, 0);
    for (int i = 0; i + 1 < N; ++i)
      for (int breakpoint = 0; breakpoint < Contacts<N>::breakpoints; ++breakpoint) {
        const std::size_t k = Contacts<N>::index(i, breakpoint);
        const S twist = angles.angle[k] - (in.alpha[std::size_t(i)] - in.alpha[std::size_t(i) + 1]);
        for (int lane = 0; lane < window.size; ++lane)
          put(window.first + lane, turned_by_unknown, turned, int(k), twist.d[lane / lane_count][lane % lane_count]);
      }
    for (int i = 0; i < unknowns; ++i)
      for (int lane = 0; lane < window.size; ++lane) put(window.first + lane, by_unknown, by_known, i, row[i][lane]);
  }
  turned.noalias() -= turned_by_unknown * by_unknown.partialPivLu().solve(by_known).eval();
  return {turned.template leftCols<contacts>(), turned.rightCols(variables)};
}

/// By what is rubbed alone. Real time: yes.
template <int N, class Fx>
[[nodiscard]] TwistSlopes<N> twist_slopes(const Model<N, Fx>& model, const Workspace<N>& ws, int steps) noexcept {
  using S = typename detail::Window<4>::S;
  const auto& c = model.coefficients();
  RodInputs<N, S, Fx> in;
  for (std::size_t i = 0; i < N; ++i) {
    const TubeParameters<double>& t = c.tubes[i];
    in.tubes[i] = {t.k, t.kz, t.kappa, t.length, t.curved_length, t.mass};
    in.beta[i] = ws.q.beta[Eigen::Index(i)];
    in.alpha[i] = ws.q.alpha[Eigen::Index(i)];
  }
  for (int i = 0; i < 3; ++i) {
    const auto k = std::size_t(i);
    in.force[k] = ws.load.force[i];
    in.moment[k] = ws.load.moment[i];
    in.gravity[k] = c.gravity[i];
  }
  in.effects = c.effects.template seeded<S>(Constant<S>{});
  return twist_slopes<0>(model, ws, steps, 0, [&](const auto&) { return in; });
}

}  // namespace ctcr
