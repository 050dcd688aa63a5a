#pragma once
// Recorded rows of tubes that wind each other up, since they rub.
#include <optional>

#include "ctcr/pipeline/recorded.hpp"
#include "ctcr/pipeline/twist_balance.hpp"

namespace ctcr {

/// Gives each row the twist_of() the system with its effects in equilibrium on the way there: place after place,
/// since what tubes rub depends on how they came there. Rows bring the twist of a robot without effects, by add_twist(), or
/// that of other values; a place without an equilibrium keeps it, with what the place before was wound up.
/// @param winding  out: how the twist changes with the parameters of the effect that follows it; or null
/// @return the largest change of a twist [rad]   Real time: no.
template <int N, class Fx>
  requires(Fx::template On<N>::follows_twist && N > 1)
double wind_up(const System<N, Fx>& system, std::span<RecordedRow<N>> rows, Winding<N>* winding = nullptr) {
  using Effects = typename Fx::template On<N>;
  detail::RecordedPath<N, double> path(system.transmission, rows, [](double x, int) { return x; });
  constexpr int most = 40;  // equilibria of a place
  TwistBalance<N, Fx> balance;
  Workspace<N> ws;
  RecordedPrediction<N, Fx> prediction;
  Effects effects = system.model.effects();
  using Vec = VecN<Contacts<N>::count>;
  Vec wound = Vec::Zero();
  double largest = 0;
  const auto& follower = std::get<Effects::follower>(system.model.effects().list);
  detail::WindingSlopes<std::remove_cvref_t<decltype(follower)>> slopes(follower, path.radius);
  if (winding) {
    winding->values = Eigen::VectorXd::Map(follower.values.data(), follower.count);
    winding->slopes = Eigen::MatrixXd::Zero(Eigen::Index(wound.size() * path.q.size()), follower.count);
  }
  for (std::size_t row = 0, k = 0; row < rows.size(); ++row) {
    rows[row].twist.resize(rows[row].places());
    for (std::size_t place = 0; place < rows[row].places(); ++place, ++k) {
      Twist<N>& twist = path.q[k].twist;
      const Vec given = Vec::Map(twist.data());
      Twist<N> found = twist;
      Vec::Map(found.data()) += wound;
      const RecordedRow<N> here = on_the_way<N>(rows, row, place);
      const auto equilibrium = [&](const Effects& with) {
        const bool has = has_equilibrium(predict(system, here, with.memory(), ws, prediction));
        return has ? &prediction.model : nullptr;
      };
      const auto remembered = [&](const Twist<N>& t) {
        Effects now = effects;
        twist = t;
        now.remember(path, k);
        return now;
      };
      effects = balance.solve(equilibrium, remembered, ws, system.settings.steps, found, most);
      twist = found;
      wound = Vec::Map(found.data()) - given;
      largest = std::max(largest, wound.cwiseAbs().maxCoeff());
      rows[row].twist[place] = twist;
      if (winding && k > 0) {
        const Model<N, Fx>* model = balance.left_there() ? &prediction.model : equilibrium(effects);
        const auto there = model ? std::optional(twist_slopes(*model, ws, system.settings.steps)) : std::nullopt;
        if (there) balance.take(there->by_rubbing);
        winding->slopes.middleRows(wound.size() * Eigen::Index(k), wound.size()) =
            slopes.advance(path.q[k - 1], path.q[k], there ? &*there : nullptr);
      }
    }
  }
  return largest;
}

}  // namespace ctcr
