#pragma once
// Friction along a path, from sample to sample.
#include <optional>

#include "ctcr/friction/torsion_solver.hpp"
#include "ctcr/recording/predict.hpp"
#include "ctcr/recording/variables.hpp"

namespace ctcr::detail {

/// Derivatives of the torsion in the equilibrium of a row that was predicted. The force of the surroundings and the history
/// of the other effects are held.
/// @param variables  in lanes from first_variable<N> on   Real time: yes without variables, else it allocates.
template <int N, class Fx>
TorsionDerivatives<N> torsion_derivatives(const System<N, Fx>& system, const RecordedRow<N>& here,
                                          const RecordedPrediction<N, Fx>& prediction, const Workspace<N>& ws,
                                          const Variables<N, Fx>& variables) noexcept {
  const auto& effects = prediction.model.effects();
  return ctcr::torsion_derivatives<SystemParameters<N, Fx>::count>(
      prediction.model, ws, variables.size(), [&](const auto& window) {
        using S = typename std::remove_cvref_t<decltype(window)>::S;
        auto in = rod_inputs<S>(system, here, prediction.load, variables.seeding(window), [&](auto& beta, auto& alpha) {
          variables.template effects<typename Fx::OnJoints>(effects, window).actuate(here.at, beta, alpha);
        });
        in.effects = variables.template effects<typename Fx::OnRod>(effects, window);
        return in;
      });
}

/// Solves friction and equilibrium at samples of a path, one after the other; between them the joints move straight on. A copy
/// goes on from the same sample.
template <int N, class Fx>
class PathSolver {
  using Effects = typename Fx::template On<N>;
  using Sample = typename Path<N, double>::Row;
  using Vec = VecN<Contacts<N>::count>;

public:
  /// The state on which the next samples depend.
  struct State {
    decltype(TorsionEffect<Fx, N>::History::state) friction;
    RelativeTorsion<N> torsion;
  };

  /// Before the first sample.
  explicit PathSolver(const Effects& effects) noexcept : effects_(effects) {}

  [[nodiscard]] State state() const noexcept { return {of_torsion(effects_).history.state, here_.torsion}; }

  /// The equilibrium of the sample that was solved last, if it has one.
  [[nodiscard]] std::optional<WarmStart<N>> equilibrium() const noexcept {
    return ws_.warm ? std::optional<WarmStart<N>>(ws_) : std::nullopt;
  }

  /// Goes on to sample k with the torsion of the path, and forgets the equilibria before it.
  void pass(const Path<N, double>& path, std::size_t k) noexcept {
    begin(path, k);
    here_.torsion = path.q[k].torsion;
    effects_ = effects_at(here_.torsion);
    difference_.setZero();
    torsion_solver_ = {};
    ws_.reset();
  }

  /// Goes on to sample k and solves it. A sample without an equilibrium keeps the torsion `given`, plus the difference that
  /// the solution of the sample before makes.
  /// @param sample  as RecordedPath::sample() gives it
  /// @param given   torsion of a robot without effects there, or that of other values
  /// @param path    the torsion of its samples is not read: other threads may be solving them
  /// @param start   where to look for the equilibrium; nothing: near that of the sample before
  void solve(const System<N, Fx>& system, const RecordedRow<N>& sample, const RelativeTorsion<N>& given,
             const Path<N, double>& path, std::size_t k, const std::optional<WarmStart<N>>& start) noexcept {
    constexpr int most = 40;  // equilibria of a sample
    if (start) ws_.begin_at(*start);
    begin(path, k);
    RelativeTorsion<N> torsion = given;
    Vec::Map(torsion.data()) += difference_;
    effects_ =
        torsion_solver_.solve([&](const Effects& with) { return predicted(system, sample, with); },
                              [&](const RelativeTorsion<N>& with) { return effects_at(with); }, ws_, torsion, most);
    difference_ = Vec::Map(torsion.data()) - Vec::Map(given.data());
    here_.torsion = torsion;
  }

  /// Derivatives of the torsion at the sample just solved, by the friction that the history up to there leaves, and by
  /// variables; nothing without an equilibrium.
  /// @param variables  as torsion_derivatives() takes them
  std::optional<TorsionDerivatives<N>> linearise(const System<N, Fx>& system, const RecordedRow<N>& sample,
                                                 const Variables<N, Fx>& variables) noexcept {
    if (!torsion_solver_.equilibrium_is_current() && !predicted(system, sample, effects_)) return {};
    TorsionDerivatives<N> d = torsion_derivatives(system, sample, prediction_, ws_, variables);
    torsion_solver_.set_derivative(d.by_friction);
    // Friction responds to the torsion it causes.
    using ByFriction = typename TorsionDerivatives<N>::ByFriction;
    const ByFriction response = ByFriction::Identity() - d.by_friction * friction_by_torsion().asDiagonal();
    (void)solve_in_place(response, d.by_friction);
    (void)solve_in_place(response, d.by_variables);
    return d;
  }

private:
  [[nodiscard]] bool is_at_first() const noexcept { return next_ <= 1; }
  static auto& of_torsion(auto& effects) noexcept { return std::get<TorsionEffect<Fx, N>>(effects.list); }

  /// Moves to sample k, its torsion still that of the path, and updates the history of all effects but that of torsion.
  void begin(const Path<N, double>& path, std::size_t k) noexcept {
    from_ = here_;
    here_ = path.q[k];
    radius_ = path.radius;
    before_ = effects_;
    before_.for_each([&](auto& effect, int) {
      if constexpr (!DependsOnTorsion<std::remove_cvref_t<decltype(effect)>> &&
                    requires { effect.update_history(path, k); })
        for (std::size_t passed = next_; passed <= k; ++passed) effect.update_history(path, passed);
    });
    next_ = k + 1;
  }

  /// The effects after the motion to the current sample, if this is the torsion there.
  Effects effects_at(const RelativeTorsion<N>& torsion) const noexcept {
    Effects now = before_;
    if (is_at_first()) return now;
    std::array way{from_, here_};
    way[1].torsion = torsion;
    of_torsion(now).update_history({way, {}, {}, radius_}, 1);
    return now;
  }

  /// Derivative of the friction at each contact by the torsion of that contact.
  Vec friction_by_torsion() const noexcept {
    using S = Dual<1>;
    Vec derivative = Vec::Zero();
    if (is_at_first()) return derivative;
    const auto dual = [](const Sample& plain) {
      typename Path<N, S>::Row row;
      std::ranges::copy(plain.beta, row.beta.begin());
      std::ranges::copy(plain.alpha, row.alpha.begin());
      std::ranges::copy(plain.torsion, row.torsion.begin());
      row.jumps = plain.jumps;
      return row;
    };
    std::array way{dual(from_), dual(here_)};
    for (S& torsion : way[1].torsion) torsion.d[0] = unit_lane(0);
    auto effect = std::get<0>(before_.template seeded<S, typename Fx::OnTorsion>(Constant<S>{}).list);
    effect.update_history({way, {}, {}, radius_}, 1);
    for (int c = 0; c < Contacts<N>::count; ++c) derivative[c] = effect.history.state[std::size_t(c)].d[0][0];
    return derivative;
  }

  /// The model with these effects, its equilibrium left in ws_, or null.
  const Model<N, Fx>* predicted(const System<N, Fx>& system, const RecordedRow<N>& sample,
                                const Effects& with) noexcept {
    return has_equilibrium(predict(system, sample, with.history(), ws_, prediction_)) ? &prediction_.model : nullptr;
  }

  Effects effects_, before_{};  ///< after the motion to the current sample; those of torsion before it
  Sample from_{}, here_{};      ///< the sample before, the current one
  ContactRadii<N> radius_;
  std::size_t next_ = 0;          ///< the sample after the current one; 0: before the first
  Vec difference_ = Vec::Zero();  ///< of the solved torsion from the given one
  TorsionSolver<N, Fx> torsion_solver_;
  Workspace<N> ws_;
  RecordedPrediction<N, Fx> prediction_;
};

}  // namespace ctcr::detail
