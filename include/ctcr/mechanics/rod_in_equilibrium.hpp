#pragma once
// The rod of a model whose equilibrium is known, ready to be integrated once more along its length.
// Real time: yes.
#include "ctcr/mechanics/effect_rod.hpp"
#include "ctcr/mechanics/model.hpp"
#include "ctcr/mechanics/solution.hpp"

namespace ctcr::detail {

template <int N, class Fx>
struct RodInEquilibrium {
  using Rod = EffectRod<N, double, Fx>;
  using State = typename Rod::State;
  using NoNode = typename Rod::NoNode;

  RodInputs<N, double, Fx> in;
  Events<N> events;
  Rod rod{in};

  RodInEquilibrium(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load) noexcept
    : in{.tubes = tube_parameters(model.robot()),
         .beta = {},
         .alpha = {},
         .force = as_array(load.force),
         .moment = as_array(load.moment),
         .gravity = as_array(model.robot().gravity),
         .effects = model.effects().on_rod()},
      events(sort_events(with_all_curves(model.robot()), q.beta)) {
    VecN<N>::Map(in.beta.data()) = q.beta;
    VecN<N>::Map(in.alpha.data()) = q.alpha;
    in.effects.tip_force(in.gravity, in.force);
  }
  RodInEquilibrium(const RodInEquilibrium&) = delete;  // the rod refers to its inputs
  RodInEquilibrium& operator=(const RodInEquilibrium&) = delete;

  /// State at the robot tip, from which to integrate.
  [[nodiscard]] State at_tip(const TipGuess<N>& guess) const noexcept {
    State tip;
    const Mat3 R_tip_base = guess.rotation.transpose();
    const Vec3 n = R_tip_base * Vec3::Map(in.force.data()), l = R_tip_base * Vec3::Map(in.moment.data()),
               g = R_tip_base * Vec3::Map(in.gravity.data());
    for (int i = 0; i < N; ++i) tip.psi(i) = guess.psi[i], tip.torque(i) = i == 0 ? l[2] : 0;
    for (int i = 0; i < 2; ++i) tip.m(i) = l[i];
    for (int i = 0; i < 3; ++i) tip.n(i) = n[i], tip.g(i) = g[i];
    return tip;
  }

private:
  static std::array<double, 3> as_array(const Vec3& v) noexcept { return {v[0], v[1], v[2]}; }
};

}  // namespace ctcr::detail
