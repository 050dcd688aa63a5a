#pragma once
// Who walks along a recording and winds up tubes that rub, place after place.
#include <optional>

#include "ctcr/friction/torsion_solver.hpp"
#include "ctcr/recording/predict.hpp"
#include "ctcr/recording/variables.hpp"

namespace ctcr::detail {

/// Slopes of the twist in the equilibrium of a row that was predicted; what the surroundings push, and what other effects
/// remember, is held.
/// @param variables  in lanes from first_variable<N> on   Real time: yes without variables, else it allocates.
template <int N, class Fx>
TwistSlopes<N> twist_slopes(const System<N, Fx>& system, const RecordedRow<N>& here,
                            const RecordedPrediction<N, Fx>& prediction, const Workspace<N>& ws,
                            const Variables<N, Fx>& variables) noexcept {
  const auto& effects = prediction.model.effects();
  return ctcr::twist_slopes<SystemParameters<N, Fx>::count>(
      prediction.model, ws, system.settings.steps, variables.size(), [&](const auto& window) {
        using S = typename std::remove_cvref_t<decltype(window)>::S;
        auto in = rod_inputs<S>(system, here, prediction.load, variables.seeding(window), [&](auto& beta, auto& alpha) {
          variables.template effects<typename Fx::OnJoints>(effects, window).actuate(here.at, beta, alpha);
        });
        in.effects = variables.template effects<typename Fx::OnRod>(effects, window);
        return in;
      });
}

/// Stands at a place of a recording, and knows what the effects remember there. A copy goes on from where this one stands.
template <int N, class Fx>
class Winder {
  using On = typename Fx::template On<N>;
  using Row = typename Path<N, double>::Row;
  using Vec = VecN<Contacts<N>::count>;
  using Follower = std::tuple_element_t<On::follower, decltype(On::list)>;

public:
  using Slopes = TwistSlopes<N>;
  struct Stand {
    decltype(Follower::History::state) rubbed;  ///< on the way to here
    Twist<N> twist;
  };

  /// Stands before the first place.
  explicit Winder(const On& effects) noexcept : effects_(effects) {}

  [[nodiscard]] Stand stand() const noexcept { return {follower(effects_).history.state, from_.twist}; }

  /// Goes on to place k with the twist that the path says. Of the equilibria before it then knows nothing.
  void pass(const Path<N, double>& path, std::size_t k) noexcept {
    effects_ = remembered(effects_at(path, k), path, k, path.q[k].twist);
    from_ = path.q[k];
    wound_.setZero();
    balance_ = {};
    ws_.reset();
  }

  /// Goes on to place k, and finds the twist there. A place without an equilibrium keeps the one that is given, with
  /// what the place before was wound up.
  /// @param here    what stands at the place, by on_the_way()
  /// @param given   the twist of a robot without effects there, or that of other values
  /// @param path    of other places its joints alone are looked at: others may be winding them up
  /// @param equilibrium  in: where to look for that of this place, or nothing: near the place before; out: where it is
  /// @param variables  as twist_slopes() takes them; or null, and so is
  /// @param slopes     out: those of the twist there by what is rubbed on the way to here, and by these variables; nothing
  ///                   without an equilibrium
  void wind(const System<N, Fx>& system, const RecordedRow<N>& here, const Twist<N>& given, const Path<N, double>& path,
            std::size_t k, std::optional<TipGuess<N>>& equilibrium, const Variables<N, Fx>* variables,
            std::optional<Slopes>* slopes) noexcept {
    constexpr int most = 40;  // equilibria of a place
    if (equilibrium) ws_.begin_at(*equilibrium);
    const On others = effects_at(path, k);
    Twist<N> found = given;
    Vec::Map(found.data()) += wound_;
    const auto in_equilibrium = [&](const On& with) {
      return has_equilibrium(predict(system, here, with.history(), ws_, prediction_)) ? &prediction_.model : nullptr;
    };
    const int steps = system.settings.steps;
    effects_ = balance_.solve(
        in_equilibrium, [&](const Twist<N>& twist) { return remembered(others, path, k, twist); }, ws_, steps, found,
        most);
    wound_ = Vec::Map(found.data()) - Vec::Map(given.data());
    Row to = path.q[k];
    to.twist = found;
    if (slopes) {
      slopes->reset();
      if (balance_.left_there() || in_equilibrium(effects_)) {
        *slopes = twist_slopes(system, here, prediction_, ws_, *variables);
        balance_.take((*slopes)->by_rubbing);
        close((*slopes).value(), law(others, to, path.radius, k));
      }
    }
    equilibrium = ws_.warm ? std::optional(ws_.guess) : std::nullopt;
    from_ = to;
  }

private:
  /// Slope of what is rubbed at each contact on the way to here by the twist of that contact.
  Vec law(const On& before, const Row& to, const ContactRadii<N>& radius, std::size_t k) const noexcept {
    using S = Dual<1>;
    Vec slopes = Vec::Zero();
    if (k == 0) return slopes;
    const auto dual = [](const Row& plain) {
      typename Path<N, S>::Row row;
      std::ranges::copy(plain.beta, row.beta.begin());
      std::ranges::copy(plain.alpha, row.alpha.begin());
      std::ranges::copy(plain.twist, row.twist.begin());
      row.jumps = plain.jumps;
      return row;
    };
    std::array way{dual(from_), dual(to)};
    for (S& twist : way[1].twist) twist.d[0] = unit_lane(0);
    auto effects = before.template seeded<S>(Constant<S>{});
    follower(effects).update_history({way, {}, {}, radius}, 1);
    for (int c = 0; c < Contacts<N>::count; ++c) slopes[c] = follower(effects).history.state[std::size_t(c)].d[0][0];
    return slopes;
  }

  /// Makes slopes of the equilibrium's twist those of the twist that this rubbing leaves.
  static void close(Slopes& slopes, const Vec& law) noexcept {
    using ByContact = typename Slopes::ByContact;
    const auto lu = (ByContact::Identity() - slopes.by_rubbing * law.asDiagonal()).eval().partialPivLu();
    slopes.by_rubbing = lu.solve(slopes.by_rubbing).eval();
    slopes.by_variables = lu.solve(slopes.by_variables).eval();
  }

  static auto& follower(auto& effects) noexcept { return std::get<On::follower>(effects.list); }

  /// The effects at place k, but for what follows the twist, which remembers what it did.
  On effects_at(const Path<N, double>& path, std::size_t k) const noexcept {
    On now = effects_;
    now.for_each([&](auto& effect, int) {
      if constexpr (!FollowsTwist<std::remove_cvref_t<decltype(effect)>> &&
                    requires { effect.update_history(path, k); })
        effect.update_history(path, k);
    });
    return now;
  }

  /// The effects with all that they remember of the motion to place k, if the twist there is this.
  On remembered(On now, const Path<N, double>& path, std::size_t k, const Twist<N>& twist) const noexcept {
    if (k == 0) return now;
    std::array<Row, 2> way{from_, path.q[k]};
    way[1].twist = twist;
    follower(now).update_history({way, {}, {}, path.radius}, 1);
    return now;
  }

  On effects_;
  Row from_{};
  Vec wound_ = Vec::Zero();  ///< by how much more than was given the tubes are wound up
  TwistBalance<N, Fx> balance_;
  Workspace<N> ws_;
  RecordedPrediction<N, Fx> prediction_;
};

}  // namespace ctcr::detail
