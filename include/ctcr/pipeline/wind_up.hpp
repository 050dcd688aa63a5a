#pragma once
// Tubes that rub wind each other up: what they rub depends on how they turn at their tips, and that on what they rub.
#include "ctcr/pipeline/recorded.hpp"

namespace ctcr {

namespace detail {

/// The twist of one row with what is rubbed there, by Newton's method. The law of rubbing may be stiff: its slope is taken
/// where it is. What the equilibrium makes of the rubbing is smooth: its slope is learnt, from row to row (Broyden).
template <int N, class Fx>
class TwistOfRow {
  using Effects = typename Fx::template On<N>;
  using Vec = VecN<N>;

public:
  explicit TwistOfRow(const System<N, Fx>& system) : system_(system) {}

  /// @param remembered  remembered(twist): the effects after the motion to this row, if the twist there is that
  /// @param twist       in: a guess; out: the solution [rad], unchanged without an equilibrium
  /// @return the effects at the solution
  Effects solve(const RecordedRow<N>& row, const auto& remembered, Vec& twist) {
    constexpr int most = 40;
    constexpr double tolerance = 1e-4;  // [rad]
    const Vec guess = twist;
    Point best;
    Vec step = Vec::Zero();
    double part = 1;  // of the step
    bool measured = false;
    for (int k = 0; k < most; ++k) {
      Point here{twist, remembered(twist)};
      if (!find_equilibrium(row, here)) {
        twist = guess;
        return remembered(guess);
      }
      if (k > 0) learn(best, here);
      const bool worse = k > 0 && here.left.norm() > best.left.norm();
      if (!worse) best = here;
      if (best.left.norm() < tolerance) break;
      if (worse && measured) {
        part *= 0.5;
      } else {
        if (worse) measure(row, best);
        measured = measured || worse;
        step = newton_step(best, remembered);
        part = 1;
      }
      twist = best.twist + part * step;
    }
    twist = best.twist;
    return best.effects;
  }

private:
  struct Point {
    Vec twist;        ///< with which rubbing is reckoned
    Effects effects;  ///< so
    Vec left{};       ///< what the equilibrium's twist differs from it
  };

  /// What is rubbed.
  static Eigen::VectorXd rubbing(const Effects& effects) {
    Eigen::VectorXd states(0);
    effects.for_each([&](const auto& e, int) {
      if constexpr (requires { e.follows_twist; }) {
        const auto n = Eigen::Index(e.past.state.size());
        states.conservativeResize(states.size() + n);
        states.tail(n) = Eigen::Map<const Eigen::VectorXd>(e.past.state.data(), n);
      }
    });
    return states;
  }

  bool find_equilibrium(const RecordedRow<N>& row, Point& at) {
    const auto memory =
        std::apply([](const auto&... e) { return typename Effects::Memory{e.past...}; }, at.effects.list);
    const Status status = predict(system_, row, memory, ws_, prediction_);
    if (!(status == Status::ok || status == Status::singular)) return false;
    std::array<double, N> twist;
    Vec::Map(twist.data()) = at.twist;
    twist = twist_between(ws_, twist);
    at.left = Vec::Map(twist.data()) - at.twist;
    return true;
  }

  /// What a change of the rubbing did to the equilibrium's twist.
  void learn(const Point& from, const Point& to) {
    const Eigen::VectorXd change = rubbing(to.effects) - rubbing(from.effects);
    if (by_rubbing_.cols() == 0) by_rubbing_.setZero(N, change.size());
    if (!(change.squaredNorm() > 1e-16)) return;
    const Vec turned = to.twist + to.left - from.twist - from.left;
    by_rubbing_ += (turned - by_rubbing_ * change) * change.transpose() / change.squaredNorm();
  }

  /// The same for each state on its own.
  void measure(const RecordedRow<N>& row, const Point& at) {
    constexpr double change = 0.02;
    Eigen::Index column = 0;
    Point moved = at;
    moved.effects.for_each([&](auto& e, int) {
      if constexpr (requires { e.follows_twist; })
        for (double& state : e.past.state) {
          const double kept = std::exchange(state, state + (state > 0 ? -change : change));
          if (find_equilibrium(row, moved)) by_rubbing_.col(column) = (moved.left - at.left) / (state - kept);
          state = kept;
          ++column;
        }
    });
  }

  Vec newton_step(const Point& at, const auto& remembered) const {
    constexpr double small = 1e-6;  // [rad]
    if (by_rubbing_.cols() == 0) return at.left;
    Eigen::MatrixXd law(by_rubbing_.cols(), N);
    for (int i = 0; i < N; ++i)
      law.col(i) = (rubbing(remembered(at.twist + small * Vec::Unit(i))) - rubbing(at.effects)) / small;
    const Eigen::Matrix<double, N, N> slope = Eigen::Matrix<double, N, N>::Identity() - by_rubbing_ * law;
    return slope.partialPivLu().solve(at.left);
  }

  const System<N, Fx>& system_;
  Workspace<N> ws_;
  RecordedPrediction<N, Fx> prediction_;
  Eigen::Matrix<double, N, Eigen::Dynamic> by_rubbing_;
};

}  // namespace detail

/// Gives each row the twist_between() of the system with its effects in equilibrium on the way there: place after place,
/// since what tubes rub depends on how they came there. Rows bring the twist of a robot without effects, by add_twist(), or
/// that of other values; a place without an equilibrium keeps it, with what the place before was wound up.
/// @return the largest change of a twist [rad]   Real time: no.
template <int N, class Fx>
  requires(Fx::template On<N>::follows_twist)
double wind_up(const System<N, Fx>& system, std::span<RecordedRow<N>> rows) {
  using Effects = typename Fx::template On<N>;
  detail::RecordedPath<N, double> path(system.transmission, rows, [](double x, int) { return x; });
  detail::TwistOfRow<N, Fx> equilibrium(system);
  Effects effects = system.model.effects();
  VecN<N> wound = VecN<N>::Zero();
  double largest = 0;
  for (std::size_t row = 0, k = 0; row < rows.size(); ++row) {
    rows[row].twist.resize(rows[row].places());
    for (std::size_t place = 0; place < rows[row].places(); ++place, ++k) {
      auto& twist = path.q[k].twist;
      const VecN<N> given = VecN<N>::Map(twist.data());
      VecN<N> found = given + wound;
      effects = equilibrium.solve(
          on_the_way<N>(rows, row, place),
          [&](const VecN<N>& t) {
            Effects now = effects;
            VecN<N>::Map(twist.data()) = t;
            now.remember(path, k);
            return now;
          },
          found);
      VecN<N>::Map(twist.data()) = found;
      wound = found - given;
      largest = std::max(largest, wound.cwiseAbs().maxCoeff());
      rows[row].twist[place] = twist;
    }
  }
  return largest;
}

}  // namespace ctcr
