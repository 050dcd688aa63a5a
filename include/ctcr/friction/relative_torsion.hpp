#pragma once
// Relative torsion of the tubes at their contacts in equilibrium, the moment jumps there, and the derivatives of the torsion
// by the friction at the contacts.
#include "ctcr/math/functions.hpp"
#include "ctcr/math/small_solve.hpp"
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

/// Integrates the rod in the equilibrium of ws once more. @param met  as EffectRod::run() takes it
template <int N, class Fx>
void visit_breakpoints(const Model<N, Fx>& model, const Workspace<N>& ws, const auto& met) noexcept {
  using Rod = RodInEquilibrium<N, Fx>;
  const Rod rod(model, ws.q, ws.load);
  auto y = rod.at_tip(ws.guess);
  Frame<double> frame;
  rod.rod.run(rod.events, ws.steps, y, frame, met, typename Rod::NoNode{});
}

}  // namespace detail

/// Relative torsion in equilibrium.
/// @param ws    the model's equilibrium, as solve() left it; else `last` is returned
/// @param last  of the configuration before; this one differs from it by less than half a turn
/// Real time: yes; one integration.
template <int N, class Fx>
[[nodiscard]] RelativeTorsion<N> relative_torsion(const Model<N, Fx>& model, const Workspace<N>& ws,
                                                  RelativeTorsion<N> last) noexcept {
  if (!ws.warm) return last;
  detail::ContactAngles<N, double> angles;
  detail::visit_breakpoints(
      model, ws, [&](int breakpoint, const auto&, const auto& state, const auto&) { angles(breakpoint, state); });
  for (int i = 0; i + 1 < N; ++i) {
    const double at_base = ws.q.alpha[i] - ws.q.alpha[i + 1];
    for (int breakpoint = 0; breakpoint < Contacts<N>::breakpoints; ++breakpoint) {
      const std::size_t k = Contacts<N>::index(i, breakpoint);
      last[k] += wrapped(angles.angle[k] - at_base - last[k]);
    }
  }
  return last;
}

/// Jumps of the bending moments in equilibrium; arguments as above, but without an equilibrium `last` is returned.
/// Real time: yes; one integration.
template <int N, class Fx>
[[nodiscard]] MomentJumps<N> moment_jumps(const Model<N, Fx>& model, const Workspace<N>& ws,
                                          const MomentJumps<N>& last) noexcept {
  if (!ws.warm) return last;
  MomentJumps<N> jumps;
  jumps.fill(0);
  detail::visit_breakpoints(model, ws, [&](int breakpoint, const auto&, const auto&, const auto& moments) {
    const auto [far, near] = moments();
    double dx = 0, dy = 0;
    for (std::size_t i = 0; i < N; ++i) {
      dx += far[i][0] - near[i][0];
      dy += far[i][1] - near[i][1];
      const bool is_outermost = i + 1 == N;
      if (is_outermost && breakpoint != Contacts<N>::plate) continue;
      jumps[is_outermost ? Contacts<N>::count : Contacts<N>::index(int(i), breakpoint)] = std::hypot(dx, dy);
    }
  });
  return jumps;
}

/// Derivatives of the relative torsion. Rows are the contacts at which it is.
template <int N>
struct TorsionDerivatives {
  using ByFriction = Eigen::Matrix<double, Contacts<N>::count, Contacts<N>::count>;
  ByFriction by_friction;  ///< by the friction at each contact: the first states of the effect that depends on torsion
  Eigen::Matrix<double, Contacts<N>::count, Eigen::Dynamic> by_variables;  ///< friction held
};

/// Lane of the first variable by which the torsion is differentiated: the unknowns and the contacts stand before it.
template <int N>
inline constexpr int first_variable = N + 2 + Contacts<N>::count;

/// Arguments as relative_torsion().
/// @tparam Most      variables at most
/// @param variables  how many there are besides the friction at the contacts
/// @param inputs     inputs(window): RodInputs of the equilibrium, with derivatives by them, in lanes from
///                   first_variable<N> on
/// Real time: yes without variables, else it allocates; an integration for each 16 of unknowns, contacts and variables.
template <int Most, int N, class Fx>
[[nodiscard]] TorsionDerivatives<N> torsion_derivatives(const Model<N, Fx>& model, const Workspace<N>& ws,
                                                        int variables, const auto& inputs) noexcept {
  using Window = detail::Window<4>;
  using Pass = detail::EffectPass<N, Fx, Window::groups>;
  using S = typename Window::S;
  constexpr int unknowns = Pass::unknowns, contacts = Contacts<N>::count;
  static_assert(first_variable<N> == unknowns + contacts);
  const int known = contacts + variables;
  Eigen::Matrix<double, unknowns, unknowns> by_unknown;
  Eigen::Matrix<double, contacts, unknowns> torsion_by_unknown;
  Eigen::Matrix<double, unknowns, Eigen::Dynamic, 0, unknowns, contacts + Most> by_known(unknowns, known);
  Eigen::Matrix<double, contacts, Eigen::Dynamic, 0, contacts, contacts + Most> torsion_by_known(contacts, known);
  const auto put = [&](int lane, auto& unknown_part, auto& known_part, int row, double x) {
    if (lane < unknowns)
      unknown_part(row, lane) = x;
    else if (lane < unknowns + known)
      known_part(row, lane - unknowns) = x;
  };
  for (Window window; window.first < unknowns + known; window.first += window.size) {
    RodInputs<N, S, Fx> in = inputs(window);
    in.effects.for_each([&](auto& effect, int) {
      if constexpr (DependsOnTorsion<std::remove_cvref_t<decltype(effect)>>)
        for (int k = 0; k < contacts; ++k) window.add(effect.history.state[std::size_t(k)], unknowns + k, 1);
    });
    detail::ContactAngles<N, S> angles;
    const Pass pass(in, sort_events(model.coefficients().plain, ws.q.beta), ws.guess, 0, ws.steps, window,
                    [&](int breakpoint, const auto& state) { angles(breakpoint, state); });
    LaneRow<Window::groups> row[Pass::rows];
    pass.write(row, 0);
    for (int i = 0; i + 1 < N; ++i)
      for (int breakpoint = 0; breakpoint < Contacts<N>::breakpoints; ++breakpoint) {
        const std::size_t k = Contacts<N>::index(i, breakpoint);
        const S torsion = angles.angle[k] - (in.alpha[std::size_t(i)] - in.alpha[std::size_t(i) + 1]);
        for (int lane = 0; lane < window.size; ++lane)
          put(window.first + lane, torsion_by_unknown, torsion_by_known, int(k),
              torsion.d[lane / lane_count][lane % lane_count]);
      }
    for (int i = 0; i < unknowns; ++i)
      for (int lane = 0; lane < window.size; ++lane) put(window.first + lane, by_unknown, by_known, i, row[i][lane]);
  }
  torsion_by_known.noalias() -= torsion_by_unknown * solved(by_unknown, by_known);
  return {torsion_by_known.template leftCols<contacts>(), torsion_by_known.rightCols(variables)};
}

/// By friction alone. Real time: yes.
template <int N, class Fx>
[[nodiscard]] TorsionDerivatives<N> torsion_derivatives(const Model<N, Fx>& model, const Workspace<N>& ws) noexcept {
  using S = typename detail::Window<4>::S;
  const RodInputs<N, S, Fx> in = detail::constant_inputs<S>(model.coefficients(), ws.q, ws.load);
  return torsion_derivatives<0>(model, ws, 0, [&](const auto&) { return in; });
}

}  // namespace ctcr
