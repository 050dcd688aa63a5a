#pragma once
// Recorded rows through the whole system with its effects:
//
//   motor angles --transmission--> joints --past, drives--> joints that the tubes have --model--> tip --T_ref,
//   sensor--> reading
#include <span>
#include <vector>

#include "ctcr/math/frame_algebra.hpp"
#include "ctcr/pipeline/parameters.hpp"
#include "ctcr/pipeline/predict.hpp"
#include "ctcr/pipeline/recorded_row.hpp"
#include "ctcr/pipeline/winding.hpp"

namespace ctcr {

namespace detail {

template <int N, class S>
void joints_of(const Transmission<N>& t, const MotorAngles<N>& theta, const auto& seed, std::array<S, N>& beta,
               std::array<S, N>& alpha) noexcept {
  using P = ParameterVector<N>;
  const S translation = seed(t.translation_ratio, P::index(Parameter::translation_ratio));
  const S rotation = seed(t.rotation_ratio, P::index(Parameter::rotation_ratio));
  for (int i = 0; i < N; ++i) {
    beta[std::size_t(i)] =
        translation * theta.translation[i] + seed(t.home_translation[i], P::index(Parameter::home_translation, i));
    alpha[std::size_t(i)] =
        rotation * theta.rotation[i] + seed(t.home_rotation[i], P::index(Parameter::home_rotation, i));
  }
}

/// The path that the joints went, place after place on the way to each row.
/// @param seed  gives values of the transmission derivatives, by their place in ParameterVector<N>
template <int N, class P>
struct RecordedPath {
  std::vector<typename Path<N, P>::Row> q;
  std::vector<double> time;        ///< [s]; empty where it is not known of each row
  std::vector<std::size_t> end;    ///< place of each row
  std::vector<std::size_t> first;  ///< as in Path; with the clock a run begins anew
  ContactRadii<N> radius;

  RecordedPath(const Transmission<N>& transmission, std::span<const RecordedRow<N>> rows, const auto& seed) {
    for (std::size_t row = 0; row < rows.size(); ++row) {
      const std::size_t last = q.size() + rows[row].places() - 1;
      const bool begins =
          row == 0 || rows[row].at.run != rows[row - 1].at.run || !(rows[row].at.time > rows[row - 1].at.time);
      first.resize(last + 1, begins ? last : first.back());
      for (std::size_t place = 0; place < rows[row].places(); ++place) {
        const RecordedRow<N> here = on_the_way<N>(rows, row, place);
        auto& now = q.emplace_back();
        joints_of<N, P>(transmission, here.theta, seed, now.beta, now.alpha);
        if (!rows[row].twist.empty()) std::ranges::copy(rows[row].twist[place], now.twist.begin());
        if (!rows[row].jumps.empty()) now.jumps = rows[row].jumps[place];
        if (std::isfinite(here.at.time)) time.push_back(here.at.time);
      }
      end.push_back(q.size() - 1);
    }
    if (time.size() < q.size()) time.clear();
    if (!rows.empty()) radius = rows.front().radius;
  }

  /// Moves the twist to what it is with other values of the effect that follows it.
  void unwind(const Winding<N>& winding, const auto& values) noexcept {
    for (std::size_t place = 0; place < q.size(); ++place) winding.extrapolate(values, place, q[place].twist);
  }

  operator Path<N, P>() const noexcept { return {q, time, first, radius}; }
};

/// What an effect remembers of each row, by the motion before it, without slopes.
template <int N, class Effect>
void remember_values(Effect effect, const Transmission<N>& transmission, std::span<const RecordedRow<N>> rows,
                     const Winding<N>& winding, const auto& keep) {
  RecordedPath<N, double> path(transmission, rows, [](double x, int) { return x; });
  if constexpr (FollowsTwist<Effect>) path.unwind(winding, effect.values);
  effect.past = {};
  for (std::size_t row = 0, place = 0; row < rows.size(); ++row) {
    for (; place <= path.end[row]; ++place) effect.remember(path, place);
    keep(row).state = effect.past.state;
  }
}

/// The same with its slopes.
template <int N, template <int, class> class E>
void remember(const E<N, double>& effect, const Transmission<N>& transmission, std::span<const RecordedRow<N>> rows,
              const Winding<N>& winding, const auto& keep) {
  using V = ParameterVector<N>;
  constexpr int count = E<N, double>::count, slopes = count + E<N, double>::transmission_count;
  using P = Dual<lane_groups(slopes)>;
  const auto seeded = [](double x, int lane) {
    P p = x;
    p.d[lane / lane_count] = unit_lane(lane % lane_count);
    return p;
  };
  RecordedPath<N, P> path(transmission, rows, [&](double x, int index) {
    return seeded(x, count + index - V::index(Parameter::translation_ratio));
  });
  E<N, P> dual;
  for (int k = 0; k < count; ++k) dual.values[std::size_t(k)] = seeded(effect.values[std::size_t(k)], k);
  if constexpr (FollowsTwist<E<N, P>>) path.unwind(winding, dual.values);
  for (std::size_t row = 0, place = 0; row < rows.size(); ++row) {
    for (; place <= path.end[row]; ++place) dual.remember(path, place);
    auto& past = keep(row);
    for (std::size_t i = 0; i < past.state.size(); ++i) {
      past.state[i] = dual.past.state[i].v;
      for (int k = 0; k < slopes; ++k)
        past.slope[i][std::size_t(k)] = dual.past.state[i].d[k / lane_count][k % lane_count];
    }
  }
}

}  // namespace detail

/// What the motion before each row left behind in the effects. Rows in the order of recording; between them joints move
/// in a straight line.
/// @param slopes   whether derivatives are wanted, too
/// @param winding  how the rows' twist changes with the effect that follows it; as it stands, if that is not known
/// Real time: no (allocates).
template <int N, class Fx>
std::vector<typename Fx::template On<N>::Memory> memories(const System<N, Fx>& system,
                                                          std::span<const RecordedRow<N>> rows, bool slopes = true,
                                                          const Winding<N>& winding = {}) {
  std::vector<typename Fx::template On<N>::Memory> memory(rows.size());
  const auto& list = system.model.effects().list;
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    [[maybe_unused]] const auto fill = [&]<std::size_t J>(std::integral_constant<std::size_t, J>) {
      if constexpr (!std::get<J>(typename Fx::template On<N>::Memory{}).state.empty()) {
        const auto keep = [&](std::size_t row) -> auto& { return std::get<J>(memory[row]); };
        slopes ? detail::remember<N>(std::get<J>(list), system.transmission, rows, winding, keep)
               : detail::remember_values<N>(std::get<J>(list), system.transmission, rows, winding, keep);
      }
    };
    (fill(std::integral_constant<std::size_t, I>{}), ...);
  }(std::make_index_sequence<std::tuple_size_v<std::remove_cvref_t<decltype(list)>>>{});
  return memory;
}

/// Every station of a row's way; q are the joints that the tubes have.
template <int N, class Fx>
struct RecordedPrediction : Prediction<N> {
  TipLoad load;                    ///< with what the surroundings add
  Model<N, Fx> model{Robot<N>{}};  ///< with the past of this row; without effects a row has none, and this is not set
};

namespace detail {

/// Solves with what the tip's surroundings add to the load: Newton's method on that push, whose slope by the tip's
/// position is known, and so is the tip's compliance.
template <int N, class Fx>
Status solve_in_surroundings(Workspace<N>& ws, RecordedPrediction<N, Fx>& out, const Settings& settings) noexcept {
  using S = Dual<1>;
  constexpr int iterations = 30;
  constexpr double tolerance = 1e-10;  // [N]
  Status status = solve(out.model, out.q, out.load, ws, out.solution, settings);
  const Vec3 known = out.load.force;
  const auto effects = out.model.effects().template seeded<S, typename Fx::OnTip>([](double x, int) { return S(x); });
  Vec3 push, added = Vec3::Zero(), change = Vec3::Zero();
  Mat3 slope;
  const auto look = [&] {
    std::array<S, 3> at, f{0.0, 0.0, 0.0};
    for (int i = 0; i < 3; ++i) {
      at[std::size_t(i)] = out.solution.position[i];
      at[std::size_t(i)].d[0] = unit_lane(i);
    }
    effects.environment(at, f);
    for (int i = 0; i < 3; ++i) {
      push[i] = f[std::size_t(i)].v;
      for (int j = 0; j < 3; ++j) slope(i, j) = f[std::size_t(i)].d[0][std::size_t(j)];
    }
  };
  look();
  if (push.isZero(0.0)) return status;
  for (int k = 0; k < iterations && has_equilibrium(status); ++k) {
    status = solve<Derivatives::compliance>(out.model, out.q, out.load, ws, out.solution, settings);
    look();
    if (push.isZero(0.0)) {  // pushed out: the solution lies between
      change *= 0.5;
      added -= change;
    } else {
      const Mat3 C = out.solution.compliance.template topLeftCorner<3, 3>();
      change = (Mat3::Identity() - slope * C).partialPivLu().solve(push - added);
      if (change.norm() < tolerance) return status;
      added += change;
    }
    out.load.force = known + added;
  }
  if (has_equilibrium(status)) status = Status::not_converged;
  return out.solution.status = status;
}

}  // namespace detail

/// What the tracker will read in a row.
/// @param memory  of this row, as memories() gives it
/// @return as solve(), not_finite where a parameter of an effect is not a number, not_converged where the tip and its
///         surroundings find no balance. Real time: yes.
template <int N, class Fx>
  requires(!Fx::none)
CTCR_NOINLINE Status predict(const System<N, Fx>& system, const RecordedRow<N>& row,
                             const typename Fx::template On<N>::Memory& memory, Workspace<N>& ws,
                             RecordedPrediction<N, Fx>& out) noexcept {
  auto effects = system.model.effects();
  effects.remember(memory);
  std::array<double, N> beta, alpha;
  detail::joints_of<N, double>(system.transmission, row.theta, [](double x, int) { return x; }, beta, alpha);
  effects.actuate(row.at, beta, alpha);
  for (int i = 0; i < N; ++i) out.q.beta[i] = beta[std::size_t(i)], out.q.alpha[i] = alpha[std::size_t(i)];
  out.load = row.load;
  out.model = Model<N, Fx>(system.model.robot(), effects);
  if constexpr (Fx::template On<N>::has_environment)
    (void)detail::solve_in_surroundings(ws, out, system.settings);
  else
    (void)solve(out.model, out.q, out.load, ws, out.solution, system.settings);
  Frame<double> reading =
      frame_of<double>(system.sensor.T_tracker_base * out.solution.tube_tips[std::size_t(system.sensor.tube)]);
  effects.sense(row.at, reading);
  out.reading = mounted(system.sensor, pose_of(reading));
  if (!(effects.finite() && out.reading.position.allFinite() && out.reading.rotation.allFinite())) {
    out.solution = Solution<N>{};
    out.solution.status = Status::not_finite;
    out.reading = Pose{};
    ws.reset();
  }
  return out.solution.status;
}

/// As above without effects, by the faster way of predict.hpp.
template <int N, class Fx>
  requires(Fx::none)
Status predict(const System<N, Fx>& system, const RecordedRow<N>& row, const typename Fx::template On<N>::Memory&,
               Workspace<N>& ws, RecordedPrediction<N, Fx>& out) noexcept {
  out.load = row.load;
  return predict(system, row.theta, row.load, ws, out);
}

}  // namespace ctcr
