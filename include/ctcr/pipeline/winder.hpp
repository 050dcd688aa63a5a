#pragma once
// Who walks along a recording and winds up tubes that rub, place after place.
#include <optional>

#include "ctcr/pipeline/recorded.hpp"
#include "ctcr/pipeline/twist_balance.hpp"

namespace ctcr::detail {

/// Stands at a place of a recording, and knows what the effects remember there. A copy goes on from where this one stands.
template <int N, class Fx>
class Winder {
  using On = typename Fx::template On<N>;
  using Row = typename Path<N, double>::Row;
  using Vec = VecN<Contacts<N>::count>;
  using Follower = std::tuple_element_t<On::follower, decltype(On::list)>;

public:
  using Slopes = TwistSlopes<N, Follower::count>;
  struct Stand {
    decltype(Follower::Past::state) rubbed;  ///< on the way to here
    Twist<N> twist;
  };

  /// Stands before the first place.
  explicit Winder(const On& effects) noexcept : effects_(effects) {}

  [[nodiscard]] Stand stand() const noexcept { return {follower(effects_).past.state, from_.twist}; }

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
  /// @param slopes  out: those of the twist there, nothing without an equilibrium; or null
  void wind(const System<N, Fx>& system, const RecordedRow<N>& here, const Twist<N>& given, const Path<N, double>& path,
            std::size_t k, std::optional<Slopes>* slopes) noexcept {
    constexpr int most = 40;  // equilibria of a place
    const On others = effects_at(path, k);
    Twist<N> found = given;
    Vec::Map(found.data()) += wound_;
    const auto equilibrium = [&](const On& with) {
      return has_equilibrium(predict(system, here, with.memory(), ws_, prediction_)) ? &prediction_.model : nullptr;
    };
    const int steps = system.settings.steps;
    effects_ = balance_.solve(
        equilibrium, [&](const Twist<N>& twist) { return remembered(others, path, k, twist); }, ws_, steps, found,
        most);
    from_ = path.q[k];
    from_.twist = found;
    wound_ = Vec::Map(found.data()) - Vec::Map(given.data());
    if (!slopes) return;
    const Model<N, Fx>* model = balance_.left_there() ? &prediction_.model : equilibrium(effects_);
    *slopes = model ? std::optional(twist_slopes(*model, ws_, steps)) : std::nullopt;
    if (*slopes) balance_.take((*slopes)->by_rubbing);
  }

private:
  static auto& follower(auto& effects) noexcept { return std::get<On::follower>(effects.list); }

  /// The effects at place k, but for what follows the twist, which remembers what it did.
  On effects_at(const Path<N, double>& path, std::size_t k) const noexcept {
    On now = effects_;
    now.for_each([&](auto& effect, int) {
      if constexpr (!FollowsTwist<std::remove_cvref_t<decltype(effect)>> && requires { effect.remember(path, k); })
        effect.remember(path, k);
    });
    return now;
  }

  /// The effects with all that they remember of the motion to place k, if the twist there is this.
  On remembered(On now, const Path<N, double>& path, std::size_t k, const Twist<N>& twist) const noexcept {
    if (k == 0) return now;
    std::array<Row, 2> way{from_, path.q[k]};
    way[1].twist = twist;
    follower(now).remember({way, {}, {}, path.radius}, 1);
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
