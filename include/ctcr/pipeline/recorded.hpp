#pragma once
// Recorded rows through the whole system with its effects, and the derivatives of what the tracker reads along the way:
//
//   motor angles --transmission--> joints --past, drives--> joints that the tubes have --model--> tip --T_ref,
//   sensor--> reading
#include <numbers>
#include <span>
#include <vector>

#include "ctcr/math/frame_algebra.hpp"
#include "ctcr/pipeline/parameters.hpp"
#include "ctcr/pipeline/predict.hpp"
#include "ctcr/pipeline/recorded_row.hpp"

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

/// What one effect remembers of each row, by the motion before it.
template <int N, template <int, class> class E>
void remember(const E<N, double>& effect, const Transmission<N>& transmission, std::span<const RecordedRow<N>> rows,
              std::span<const double> time, const auto& keep) {
  using V = ParameterVector<N>;
  constexpr int count = E<N, double>::count, slopes = count + E<N, double>::transmission_count;
  using P = Dual<lane_groups(slopes)>;
  const auto seeded = [](double x, int lane) {
    P p = x;
    p.d[lane / lane_count] = unit_lane(lane % lane_count);
    return p;
  };
  std::vector<typename Path<N, P>::Row> q(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    q[i].twist = rows[i].twist;
    joints_of<N, P>(
        transmission, rows[i].theta,
        [&](double x, int index) { return seeded(x, count + index - V::index(Parameter::translation_ratio)); },
        q[i].beta, q[i].alpha);
  }
  E<N, P> dual;
  for (int k = 0; k < count; ++k) dual.values[std::size_t(k)] = seeded(effect.values[std::size_t(k)], k);
  for (std::size_t row = 0; row < rows.size(); ++row) {
    dual.remember(Path<N, P>{q, time}, row);
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
/// in a straight line. Real time: no (allocates).
template <int N, class Fx>
std::vector<typename Fx::template On<N>::Memory> memories(const System<N, Fx>& system,
                                                          std::span<const RecordedRow<N>> rows) {
  std::vector<typename Fx::template On<N>::Memory> memory(rows.size());
  std::vector<double> time;
  for (const RecordedRow<N>& row : rows)
    if (std::isfinite(row.at.time)) time.push_back(row.at.time);
  if (time.size() < rows.size()) time.clear();
  const auto& list = system.model.effects().list;
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    [[maybe_unused]] const auto fill = [&]<std::size_t J>(std::integral_constant<std::size_t, J>) {
      if constexpr (!std::get<J>(typename Fx::template On<N>::Memory{}).state.empty())
        detail::remember<N>(std::get<J>(list), system.transmission, rows, time,
                            [&](std::size_t row) -> auto& { return std::get<J>(memory[row]); });
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

template <int N, class S>
TubeParameters<S> tube_of(const Tube& t, int i, const auto& seed) noexcept {
  using P = ParameterVector<N>;
  const auto field = [&](Parameter kind) { return S(seed(t.*P::info(kind).field, P::index(kind, i))); };
  constexpr double pi = std::numbers::pi;
  const S inner = field(Parameter::inner_diameter), outer = field(Parameter::outer_diameter);
  const S inner2 = inner * inner, outer2 = outer * outer;
  const S k = t.bending_stiffness > 0
                  ? field(Parameter::bending_stiffness)
                  : field(Parameter::youngs_modulus) * ((pi / 64) * (outer2 * outer2 - inner2 * inner2));
  return {k,
          k * inverse(1.0 + field(Parameter::poisson_ratio)),
          field(Parameter::curvature),
          field(Parameter::length),
          field(Parameter::curved_length),
          field(Parameter::density) * ((pi / 4) * (outer2 - inner2))};
}

}  // namespace detail

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
  const auto effects = out.model.effects().template seeded<S>([](double x, int) { return S(x); });
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
  for (int k = 0; k < iterations && (status == Status::ok || status == Status::singular); ++k) {
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
  if (status == Status::ok || status == Status::singular) status = Status::not_converged;
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

/// Exact derivatives, of the discretised model, of the reading that predict() just left in `ws` and `prediction`, by
/// some of the system's parameters. Rows: position [m], rotation [rad], tracker axes.
/// @param variables  places in SystemParameters<N, Fx>, each once
/// @param out        6 x variables.size()
/// @return as predict(); where that failed `out` is zero. Real time: yes, one integration for sixteen variables.
template <int N, class Fx>
  requires(!Fx::none)
CTCR_NOINLINE Status differentiate(const System<N, Fx>& system, const RecordedRow<N>& row, const Workspace<N>& ws,
                                   const RecordedPrediction<N, Fx>& prediction, std::span<const int> variables,
                                   Eigen::Ref<Eigen::Matrix<double, 6, Eigen::Dynamic>> out) noexcept {
  using P = SystemParameters<N, Fx>;
  using V = ParameterVector<N>;
  using Window = detail::Window<4>;
  using Pass = detail::EffectPass<N, Fx, Window::groups>;
  using S = Window::S;
  using On = typename Fx::template On<N>;
  constexpr int groups = Window::groups_for(Pass::unknowns + P::count + 3);

  out.setZero();
  const Status status = prediction.solution.status;
  if (!(status == Status::ok || status == Status::singular)) return status;
  const Model<N, Fx>& model = prediction.model;
  const On& effects = model.effects();

  std::array<int, P::count> slot;
  slot.fill(-1);
  const int asked = int(variables.size());
  for (int j = 0; j < asked; ++j) slot[std::size_t(variables[std::size_t(j)])] = Pass::unknowns + j;
  const int force = Pass::unknowns + asked;

  const auto seeding = [&](const Window& window) {
    return [&slot, window](double x, int index) noexcept {
      const int lane = slot[std::size_t(index)];
      return lane < 0 ? S(x) : window(x, lane);
    };
  };
  const auto seeded_effects = [&](const auto& seed) {
    return effects.template seeded<S>([&](double x, int k) { return seed(x, V::count + k); },
                                      [&](int k) { return seed(0, V::index(Parameter::translation_ratio) + k); });
  };

  // What the surroundings add, and its slopes by the variables: it may be nothing and yet have some.
  bool pushed = false;
  std::array<std::array<S, 3>, groups / Window::groups> push;
  if constexpr (On::has_environment) {
    const Vec3& p = prediction.solution.position;
    for (Window window; window.first < force; window.first += window.size) {
      auto& f = push[std::size_t(window.first / window.size)] = {0.0, 0.0, 0.0};
      seeded_effects(seeding(window)).environment({p[0], p[1], p[2]}, f);
      for (const S& x : f) {
        pushed = pushed || x.v != 0;
        for (int l = 0; l < window.size; ++l) pushed = pushed || x.d[l / lane_count][l % lane_count] != 0;
      }
    }
  }
  const int count = force + (pushed ? 3 : 0);

  LaneRow<groups> rows[Pass::rows + (On::has_environment ? 3 : 0)];
  for (auto& r : rows)
    for (auto& x : r.x) x = Lanes{};
  const Events<N> events = sort_events(with_all_curves(model.robot()), prediction.q.beta);
  TipGuess<N> guess = ws.guess;
  for (Window window; window.first < count; window.first += window.size) {
    const auto seed = seeding(window);
    RodInputs<N, S, Fx> in;
    in.effects = seeded_effects(seed);
    detail::joints_of<N, S>(system.transmission, row.theta, seed, in.beta, in.alpha);
    in.effects.actuate(row.at, in.beta, in.alpha);
    for (int i = 0; i < N; ++i)
      in.tubes[std::size_t(i)] = detail::tube_of<N, S>(model.robot().tubes[std::size_t(i)], i, seed);
    for (int i = 0; i < 3; ++i) {
      const auto k = std::size_t(i);
      in.gravity[k] = seed(model.robot().gravity[i], V::index(Parameter::gravity, i));
      in.moment[k] = prediction.load.moment[i];
      in.force[k] = pushed ? window(prediction.load.force[i], force + i) : S(prediction.load.force[i]);
    }
    Pass(in, events, guess, system.sensor.tube, system.settings.steps, window).write(rows, window.first / lane_count);
  }
  constexpr auto lane = [](int j) constexpr { return j; };
  (void)eliminate<Pass::unknowns>(rows, lane);

  if constexpr (On::has_environment) {
    if (pushed) {
      // df = push dv + slope dp and dp = A dv + C df, p the robot tip.
      using Slope = Dual<1>;
      const Vec3& p = prediction.solution.position;
      std::array<Slope, 3> at{p[0], p[1], p[2]}, f{0.0, 0.0, 0.0};
      for (int i = 0; i < 3; ++i) at[std::size_t(i)].d[0] = unit_lane(i);
      effects.template seeded<Slope>([](double x, int) { return Slope(x); }).environment(at, f);
      Mat3 slope, C;
      Eigen::Matrix<double, 6, 3> by_force;
      for (int j = 0; j < 3; ++j) {
        for (int i = 0; i < 6; ++i) by_force(i, j) = rows[Pass::unknowns + i][force + j];
        for (int i = 0; i < 3; ++i) C(i, j) = rows[Pass::rows + i][force + j];
        for (int i = 0; i < 3; ++i) slope(i, j) = f[std::size_t(i)].d[0][std::size_t(j)];
      }
      const Eigen::PartialPivLU<Mat3> lu(Mat3::Identity() - slope * C);
      for (int j = Pass::unknowns; j < force; ++j) {
        Vec3 A, direct;
        for (int i = 0; i < 3; ++i) {
          A[i] = rows[Pass::rows + i][j];
          const int l = j % Window::size;
          direct[i] = push[std::size_t(j / Window::size)][std::size_t(i)].d[l / lane_count][l % lane_count];
        }
        const Vec6 change = by_force * lu.solve(direct + slope * A);
        for (int i = 0; i < 6; ++i) rows[Pass::unknowns + i].add(j, change[i]);
      }
    }
  }

  using detail::operator*;
  const Pose& T_base_tip = prediction.solution.tube_tips[std::size_t(system.sensor.tube)];
  const Mat3 R_tip_base = T_base_tip.rotation.transpose(),
             R_base_tracker = system.sensor.T_tracker_base.rotation.transpose();
  for (Window window; window.first < force; window.first += window.size) {
    const auto seed = seeding(window);
    Frame<S> tip = frame_of<S>(T_base_tip), T_ref = frame_of<S>(system.sensor.T_tracker_base);
    for (int g = 0; g < Window::groups; ++g) {
      const int at = window.first / lane_count + g;
      const auto& r = rows;
      constexpr int u = Pass::unknowns;
      const detail::Lanes3 v = R_tip_base * detail::Lanes3{r[u].x[at], r[u + 1].x[at], r[u + 2].x[at]};
      const detail::Lanes3 w = R_tip_base * detail::Lanes3{r[u + 3].x[at], r[u + 4].x[at], r[u + 5].x[at]};
      detail::Lanes3 shift{}, turn{};
      for (int i = 0; i < 3; ++i) {
        shift[std::size_t(i)] = seed(0, V::index(Parameter::tracker_position, i)).d[g];
        turn[std::size_t(i)] = seed(0, V::index(Parameter::tracker_rotation, i)).d[g];
      }
      shift = R_base_tracker * shift;
      turn = R_base_tracker * turn;
      for (std::size_t i = 0; i < 3; ++i) {
        tip.translation_twist[i][g] = v[i];
        tip.rotation_twist[i][g] = w[i];
        T_ref.translation_twist[i][g] = shift[i];
        T_ref.rotation_twist[i][g] = turn[i];
      }
    }
    Frame<S> reading = composed(T_ref, tip);
    seeded_effects(seed).sense(row.at, reading);
    for (int g = 0; g < Window::groups; ++g)
      reading.rotation_twist[2][g] += seed(0, V::index(Parameter::sensor_roll)).d[g];
    const Mat3 R = reading.rotation();
    for (int l = 0; l < window.size; ++l) {
      const int j = window.first + l - Pass::unknowns;
      if (j < 0 || j >= asked) continue;
      const int g = l / lane_count, i = l % lane_count;
      Vec3 v, w;
      for (int k = 0; k < 3; ++k) v[k] = reading.translation_twist[k][g][i], w[k] = reading.rotation_twist[k][g][i];
      out.template block<3, 1>(0, j) = R * v;
      out.template block<3, 1>(3, j) = R * w;
    }
  }
  if (out.allFinite()) return status;
  out.setZero();
  return Status::not_finite;
}

/// As above without effects, by the faster way of predict.hpp.
template <int N, class Fx>
  requires(Fx::none)
Status predict(const System<N, Fx>& system, const RecordedRow<N>& row, const typename Fx::template On<N>::Memory&,
               Workspace<N>& ws, RecordedPrediction<N, Fx>& out) noexcept {
  out.load = row.load;
  return predict(system, row.theta, row.load, ws, out);
}
template <int N, class Fx>
  requires(Fx::none)
Status differentiate(const System<N, Fx>& system, const RecordedRow<N>& row, const Workspace<N>& ws,
                     const RecordedPrediction<N, Fx>& prediction, std::span<const int> variables,
                     Eigen::Ref<Eigen::Matrix<double, 6, Eigen::Dynamic>> out) noexcept {
  PredictionDerivatives<N> all;
  const Status status = differentiate(system, row.theta, ws, prediction, all);
  for (std::size_t j = 0; j < variables.size(); ++j) out.col(Eigen::Index(j)) = all.by_parameters.col(variables[j]);
  return status;
}

}  // namespace ctcr
