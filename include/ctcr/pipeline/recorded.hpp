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

namespace ctcr {

/// One row of a recording.
template <int N>
struct RecordedRow {
  MotorAngles<N> theta;
  TipLoad load;
  Occasion at;
};

/// What the motion before each row left behind in the effects. Rows in the order of recording; between them joints move
/// in a straight line. Real time: no (allocates).
template <int N, class Fx>
std::vector<typename Fx::template On<N>::Memory> memories(const System<N, Fx>& system,
                                                          std::span<const RecordedRow<N>> rows) {
  using Memory = typename Fx::template On<N>::Memory;
  std::vector<Memory> memory(rows.size());
  std::vector<Joints<N>> q;
  std::vector<double> time;
  for (const RecordedRow<N>& row : rows) {
    q.push_back(joints(system.transmission, row.theta));
    if (std::isfinite(row.at.time)) time.push_back(row.at.time);
  }
  if (time.size() < rows.size()) time.clear();
  const Path<N> path{q, time};
  const auto& list = system.model.effects().list;
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    const auto fill = [&]<std::size_t J>(std::integral_constant<std::size_t, J>) {
      using Effect = std::tuple_element_t<J, std::remove_cvref_t<decltype(list)>>;
      constexpr int states = int(Effect{}.past.state.size());
      if constexpr (states > 0) {
        constexpr int groups = lane_groups(Effect::count);
        const auto effect = [&]<template <int, class> class E>(const E<N, double>& plain) {
          E<N, Dual<groups>> dual;
          for (int k = 0; k < Effect::count; ++k) {
            dual.values[std::size_t(k)] = plain.values[std::size_t(k)];
            dual.values[std::size_t(k)].d[k / lane_count] = unit_lane(k % lane_count);
          }
          for (std::size_t row = 0; row < rows.size(); ++row) {
            dual.remember(path, row);
            auto& past = std::get<J>(memory[row]);
            for (std::size_t i = 0; i < std::size_t(states); ++i) {
              past.state[i] = dual.past.state[i].v;
              for (int k = 0; k < Effect::count; ++k)
                past.slope[i][std::size_t(k)] = dual.past.state[i].d[k / lane_count][k % lane_count];
            }
          }
        };
        effect(std::get<J>(list));
      }
    };
    (fill(std::integral_constant<std::size_t, I>{}), ...);
  }(std::make_index_sequence<std::tuple_size_v<std::remove_cvref_t<decltype(list)>>>{});
  return memory;
}

/// Every station of a row's way.
template <int N, class Fx>
struct RecordedPrediction {
  Joints<N> q;   ///< that the tubes have
  TipLoad load;  ///< with what the surroundings add
  Model<N, Fx> model;
  Solution<N> solution;
  Pose reading;  ///< T_tracker_sensor
};

namespace detail {

template <int N, class S>
void joints_of(const Transmission<N>& t, const MotorAngles<N>& theta, const auto& seed, std::array<S, N>& beta,
               std::array<S, N>& alpha) noexcept {
  using P = ParameterVector<N>;
  const S translation = seed(t.translation_ratio, P::index(Parameter::translation_ratio));
  const S rotation = seed(t.rotation_ratio, P::index(Parameter::rotation_ratio));
  for (int i = 0; i < N; ++i) {
    beta[std::size_t(i)] = translation * theta.translation[i] +
                           seed(t.home_translation[i], P::index(Parameter::home_translation, i));
    alpha[std::size_t(i)] = rotation * theta.rotation[i] + seed(t.home_rotation[i], P::index(Parameter::home_rotation, i));
  }
}

template <int N, class S>
TubeParameters<S> tube_of(const Tube& t, int i, const auto& seed) noexcept {
  using P = ParameterVector<N>;
  const auto field = [&](Parameter kind) { return S(seed(t.*P::info(kind).field, P::index(kind, i))); };
  constexpr double pi = std::numbers::pi;
  const S inner = field(Parameter::inner_diameter), outer = field(Parameter::outer_diameter);
  const S inner2 = inner * inner, outer2 = outer * outer;
  const S k = t.bending_stiffness > 0 ? field(Parameter::bending_stiffness)
                                      : field(Parameter::youngs_modulus) * ((pi / 64) * (outer2 * outer2 - inner2 * inner2));
  return {k,
          k * inverse(1.0 + field(Parameter::poisson_ratio)),
          field(Parameter::curvature),
          field(Parameter::length),
          field(Parameter::curved_length),
          field(Parameter::density) * ((pi / 4) * (outer2 - inner2))};
}

}  // namespace detail

/// What the tracker will read in a row.
/// @param memory  of this row, as memories() gives it
/// @return as solve(). Real time: yes.
template <int N, class Fx>
Status predict(const System<N, Fx>& system, const RecordedRow<N>& row, const typename Fx::template On<N>::Memory& memory,
               Workspace<N>& ws, RecordedPrediction<N, Fx>& out) noexcept {
  auto effects = system.model.effects();
  effects.remember(memory);
  std::array<double, N> beta, alpha;
  detail::joints_of<N, double>(system.transmission, row.theta, [](double x, int) { return x; }, beta, alpha);
  effects.actuate(row.at, beta, alpha);
  for (int i = 0; i < N; ++i) out.q.beta[i] = beta[std::size_t(i)], out.q.alpha[i] = alpha[std::size_t(i)];
  out.load = row.load;
  out.model = Model<N, Fx>(system.model.robot(), effects);
  Status status = solve(out.model, out.q, out.load, ws, out.solution, system.settings);
  if constexpr (Fx::template On<N>::has_environment) {
    const auto pushed = [&](const Vec3& p, Vec3& force, Mat3* slope) {
      using S = Dual<1>;
      std::array<S, 3> position{p[0], p[1], p[2]}, f{0.0, 0.0, 0.0};
      for (int i = 0; i < 3; ++i) position[std::size_t(i)].d[0] = unit_lane(i);
      effects.template seeded<S>([](double x, int) { return S(x); }).environment(position, f);
      for (int i = 0; i < 3; ++i) {
        force[i] = f[std::size_t(i)].v;
        if (slope != nullptr)
          for (int j = 0; j < 3; ++j) (*slope)(i, j) = f[std::size_t(i)].d[0][std::size_t(j)];
      }
    };
    Vec3 force, added = Vec3::Zero();
    Mat3 slope;
    constexpr int iterations = 8;
    pushed(out.solution.position, force, nullptr);
    if (!force.isZero(0.0))
      for (int k = 0; k < iterations && (status == Status::ok || status == Status::singular); ++k) {
        status = solve<Derivatives::compliance>(out.model, out.q, out.load, ws, out.solution, system.settings);
        pushed(out.solution.position, force, &slope);
        const Vec3 rest = force - added;
        if (rest.norm() < 1e-9) break;
        added += (Mat3::Identity() - slope * out.solution.compliance.template topLeftCorner<3, 3>()).partialPivLu().solve(rest);
        out.load.force = row.load.force + added;
      }
  }
  Frame<double> reading =
      frame_of<double>(system.sensor.T_tracker_base * out.solution.tube_tips[std::size_t(system.sensor.tube)]);
  effects.sense(row.at, reading);
  out.reading = pose_of(reading);
  return status;
}

/// Exact derivatives, of the discretised model, of the reading that predict() just left in `ws` and `prediction`, by
/// some of the system's parameters. Rows: position [m], rotation [rad], tracker axes.
/// @param variables  places in SystemParameters<N, Fx>
/// @param out        6 x variables.size()
/// @return as predict(); where that failed `out` is zero. Real time: yes, one integration for eight variables.
template <int N, class Fx>
Status differentiate(const System<N, Fx>& system, const RecordedRow<N>& row, const Workspace<N>& ws,
                     const RecordedPrediction<N, Fx>& prediction, std::span<const int> variables,
                     Eigen::Ref<Eigen::Matrix<double, 6, Eigen::Dynamic>> out) noexcept {
  using P = SystemParameters<N, Fx>;
  using V = ParameterVector<N>;
  using Pass = detail::EffectPass<N, Fx>;
  using S = detail::Window::S;
  using On = typename Fx::template On<N>;
  constexpr int max_lanes = Pass::unknowns + P::count + 3 + detail::Window::size;
  constexpr int groups = lane_groups(max_lanes) + lane_groups(max_lanes) % detail::Window::groups;

  out.setZero();
  const Status status = prediction.solution.status;
  if (!(status == Status::ok || status == Status::singular)) return status;
  const Model<N, Fx>& model = prediction.model;
  const On& effects = model.effects();

  std::array<int, P::count> slot;
  slot.fill(-1);
  const int asked = int(variables.size());
  for (int j = 0; j < asked; ++j) slot[std::size_t(variables[std::size_t(j)])] = Pass::unknowns + j;
  const bool pushed = On::has_environment && prediction.load.force != row.load.force;
  const int force = Pass::unknowns + asked, count = force + (pushed ? 3 : 0);

  const auto seeding = [&](const detail::Window& window) {
    return [&slot, window](double x, int index) noexcept {
      const int lane = slot[std::size_t(index)];
      return lane < 0 ? S(x) : window(x, lane);
    };
  };
  const auto seeded_effects = [&](const auto& seed) {
    return effects.template seeded<S>([&](double x, int k) { return seed(x, V::count + k); });
  };

  LaneRow<groups> rows[Pass::rows];
  for (auto& r : rows)
    for (auto& x : r.x) x = Lanes{};
  const Events<N> events = sort_events(make_coefficients(model.robot()), prediction.q.beta);
  TipGuess<N> guess = ws.guess;
  std::array<std::array<S, 3>, (max_lanes + 7) / 8> push;  // slopes of the surroundings' force by the variables
  for (detail::Window window; window.first < count; window.first += window.size) {
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
    if (pushed) {
      const Vec3& p = prediction.solution.position;
      auto& f = push[std::size_t(window.first / window.size)] = {0.0, 0.0, 0.0};
      in.effects.environment({p[0], p[1], p[2]}, f);
    }
    Pass(in, events, guess, system.sensor.tube, system.settings.steps, window).write(rows, window.first / lane_count);
  }
  constexpr auto lane = [](int j) constexpr { return j; };
  (void)eliminate<Pass::unknowns>(rows, lane);

  if (pushed) {
    // df = push dv + slope dp and dp = A dv + C df, for tube 1's tip.
    using Slope = Dual<1>;
    const Vec3& p = prediction.solution.position;
    std::array<Slope, 3> at{p[0], p[1], p[2]}, f{0.0, 0.0, 0.0};
    for (int i = 0; i < 3; ++i) at[std::size_t(i)].d[0] = unit_lane(i);
    effects.template seeded<Slope>([](double x, int) { return Slope(x); }).environment(at, f);
    Mat3 slope, C;
    Eigen::Matrix<double, 6, 3> by_force;
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 3; ++j) by_force(i, j) = rows[Pass::unknowns + i][force + j];
    C = by_force.template topRows<3>();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) slope(i, j) = f[std::size_t(i)].d[0][std::size_t(j)];
    const Eigen::PartialPivLU<Mat3> lu(Mat3::Identity() - slope * C);
    for (int j = Pass::unknowns; j < force; ++j) {
      Vec3 A, direct;
      for (int i = 0; i < 3; ++i) {
        A[i] = rows[Pass::unknowns + i][j];
        const int l = j % detail::Window::size;
        direct[i] = push[std::size_t(j / detail::Window::size)][std::size_t(i)].d[l / lane_count][l % lane_count];
      }
      const Vec6 change = by_force * lu.solve(direct + slope * A);
      for (int i = 0; i < 6; ++i) rows[Pass::unknowns + i].add(j, change[i]);
    }
  }

  using detail::operator*;
  const Pose& T_base_tip = prediction.solution.tube_tips[std::size_t(system.sensor.tube)];
  const Mat3 R_tip_base = T_base_tip.rotation.transpose(), R_base_tracker = system.sensor.T_tracker_base.rotation.transpose();
  for (detail::Window window; window.first < force; window.first += window.size) {
    const auto seed = seeding(window);
    Frame<S> tip = frame_of<S>(T_base_tip), T_ref = frame_of<S>(system.sensor.T_tracker_base);
    for (int g = 0; g < detail::Window::groups; ++g) {
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

}  // namespace ctcr
