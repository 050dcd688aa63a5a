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

  void operator()(int station, const auto& state) noexcept {
    if (station < N) present = station + 1;
    passed[std::size_t(station)] = true;
    for (int i = 0; i + 1 < N && i + 1 < present; ++i) {
      const S here = state.psi(i) - state.psi(i + 1);
      const auto fill = [&](const auto& which) {
        for (int k = 0; k < Contacts<N>::stations; ++k)
          if (which(k)) angle[Contacts<N>::place(i, k)] = here;
      };
      if (station == i + 1)
        fill([](int) { return true; });
      else if (station == Contacts<N>::plate)
        fill([&](int k) { return k == station || (k >= N && !passed[std::size_t(k)]); });
      else
        fill([&](int k) { return k == station; });
    }
  }

private:
  int present = 0;
  std::array<bool, std::size_t(Contacts<N>::stations)> passed{};
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
      [&](int station, const auto&, const auto& state, const auto&) { angles(station, state); },
      typename decltype(rod)::NoNode{});
  for (int i = 0; i + 1 < N; ++i) {
    const double at_base = ws.q.alpha[i] - ws.q.alpha[i + 1];
    for (int station = 0; station < Contacts<N>::stations; ++station) {
      const std::size_t k = Contacts<N>::place(i, station);
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
  const auto gather = [&](int station, const auto&, const auto&, const auto& moments) {
    const auto [far, near] = moments();
    double dx = 0, dy = 0;
    for (std::size_t i = 0; i < N; ++i) {
      dx += far[i][0] - near[i][0];
      dy += far[i][1] - near[i][1];
      const bool is_outermost = i + 1 == N;
      if (is_outermost && station != Contacts<N>::plate) continue;
      jumps[is_outermost ? Contacts<N>::count : Contacts<N>::place(int(i), station)] = std::hypot(dx, dy);
    }
  };
  rod.rod.run(rod.events, steps, y, frame, gather, typename decltype(rod)::NoNode{});
  return jumps;
}

/// Slopes of the twist. Rows are contacts whose twist changes.
template <int N, int count>
struct TwistSlopes {
  using ByContact = Eigen::Matrix<double, Contacts<N>::count, Contacts<N>::count>;
  ByContact by_rubbing = ByContact::Zero();  ///< by what is rubbed at each contact: the first states of what follows it
  Eigen::Matrix<double, Contacts<N>::count, count> by_values;  ///< by the parameters of that effect, states held
};

/// Arguments as above. Real time: yes; an integration for each 16 of the contacts, unknowns and parameters.
template <int N, class Fx>
[[nodiscard]] auto twist_slopes(const Model<N, Fx>& model, const Workspace<N>& ws, int steps) noexcept {
  using On = typename Fx::template On<N>;
  constexpr int count = std::tuple_element_t<On::follower, decltype(On::list)>::count;
  using Window = detail::Window<4>;
  using Pass = detail::EffectPass<N, Fx, Window::groups>;
  using S = typename Window::S;
  constexpr int unknowns = Pass::unknowns, contacts = Contacts<N>::count, known = contacts + count;
  constexpr int variables = unknowns + known;
  constexpr int groups = Window::groups_for(variables);
  const auto& c = model.coefficients();
  LaneRow<groups> row[Pass::rows];
  Eigen::Matrix<double, contacts, groups * lane_count> turned;
  for (Window window; window.first < variables; window.first += window.size) {
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
    in.effects = c.effects.template seeded<S>([](double value, int) { return S(value); });
    in.effects.for_each([&](auto& effect, int) {
      if constexpr (FollowsTwist<std::remove_cvref_t<decltype(effect)>>) {
        for (int k = 0; k < contacts; ++k) window.add(effect.past.state[std::size_t(k)], unknowns + k, 1);
        for (int k = 0; k < count; ++k) window.add(effect.values[std::size_t(k)], unknowns + contacts + k, 1);
      }
    });
    detail::ContactAngles<N, S> angles;
    const Pass pass(in, sort_events(c.plain, ws.q.beta), ws.guess, 0, steps, window,
                    [&](int station, const auto& state) { angles(station, state); });
    pass.write(row, window.first / lane_count);
    for (int k = 0; k < contacts; ++k)
      for (int lane = 0; lane < window.size; ++lane)
        turned(k, window.first + lane) = angles.angle[std::size_t(k)].d[lane / lane_count][lane % lane_count];
  }
  Eigen::Matrix<double, unknowns, unknowns> by_unknown;
  Eigen::Matrix<double, unknowns, known> by_known;
  for (int i = 0; i < unknowns; ++i) {
    for (int j = 0; j < unknowns; ++j) by_unknown(i, j) = row[i][j];
    for (int j = 0; j < known; ++j) by_known(i, j) = row[i][unknowns + j];
  }
  const Eigen::Matrix<double, contacts, known> slopes =
      turned.template middleCols<known>(unknowns) -
      turned.template leftCols<unknowns>() * by_unknown.partialPivLu().solve(by_known).eval();
  return TwistSlopes<N, count>{slopes.template leftCols<contacts>(), slopes.template rightCols<count>()};
}

}  // namespace ctcr
