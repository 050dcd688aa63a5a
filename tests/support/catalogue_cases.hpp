#pragma once
// Random robots with effects, and random recordings of them.
#include "support/catalogue.hpp"
#include "support/laws.hpp"

namespace ctcr::test {

/// The parameters of an effect in a model or system, by its place in the catalogue's list.
template <template <int, class> class E, int N>
E<N, double>& effect(Catalogue::On<N>& effects) {
  return std::get<E<N, double>>(effects.list);
}

/// Every parameter somewhere plausible: within `sigmas` of its neutral value and within its soft bounds.
template <int N>
Catalogue::On<N> random_effects(Random& random, double sigmas = 1) {
  Catalogue::On<N> effects;
  effects.for_each([&](auto& effect, int) {
    for (int k = 0; k < int(effect.parameters.size()); ++k)
      for (int i = 0; i < effect.size(k); ++i) {
        const EffectParameter& p = effect.parameters[std::size_t(k)];
        // Differences need functions that are smooth over their steps: forms stay near the usual ones.
        const double reach = (p.role == Role::amplitude ? 1 : 0.3) * sigmas * p.sigma;
        effect.values[std::size_t(effect.index(k, i))] =
            uniform(random, std::max(p.neutral - reach, p.soft.low), std::min(p.neutral + reach, p.soft.high));
      }
  });
  return effects;
}

/// Every amplitude too small to change anything, yet not neutral: all hooks are called.
template <int N>
Catalogue::On<N> hardly_any_effects() {
  Catalogue::On<N> effects;
  effects.for_each([](auto& effect, int) {
    for (std::size_t k = 0; k < effect.parameters.size(); ++k)
      if (effect.parameters[k].role == Role::amplitude)
        for (int i = 0; i < effect.size(int(k)); ++i) effect.values[std::size_t(effect.index(int(k), i))] += 1e-100;
  });
  return effects;
}

template <int N>
struct Recorded {
  System<N, Catalogue> system;
  std::vector<RecordedRow<N>> rows;
};

/// A robot in a smooth place, reached by a path along which every tube turns, slides and turns back.
/// @param tube  that carries the sensor
template <int N>
Recorded<N> random_recording(const Catalogue::On<N>& effects, int tube, Random& random) {
  for (;;) {
    const Case<N> c = smooth_case<N>(random, 0.1, 0.002, tilted_gravity);
    if (smallest_gap(c.robot, c.q) < 8e-3) continue;
    VecN<N> home;
    for (int i = 0; i < N; ++i) home[i] = uniform(random, -0.2, 0.2);
    const Transmission<N> transmission{uniform(random, 2e-4, 5e-4), -uniform(random, 0.5, 2), 0.1 * home, home};
    const PoseSensor sensor{{rotation_matrix(random_vector(random, 3)), random_vector(random, 0.3)},
                            tube,
                            {rotation_matrix(random_vector(random, 3)), random_vector(random, 0.05)}};
    Recorded<N> recorded{{transmission,
                          Model<N, Catalogue>(c.robot, effects),
                          sensor,
                          {.tolerance = 1e-12, .steps = 4, .accuracy = test::as_told}},
                         {}};
    const Vec3 centre = (sensor.T_tracker_base * Pose{Mat3::Identity(), {0, 0, 0.1}}).position;
    constexpr int last = 5;
    for (int k = 0; k <= last; ++k) {
      Joints<N> q = c.q;
      if (k < last)
        for (int i = 0; i < N; ++i) {
          q.alpha[i] += uniform(random, -1, 1);
          q.beta[i] += uniform(random, -1e-3, 1e-3);
        }
      recorded.rows.push_back({motor_angles(transmission, q), c.load, {0.2 * k, k == last ? 0.8 : 0.1 * k, 0, centre}});
    }
    return recorded;
  }
}

/// Prediction of the last row.
template <int N>
Status predict_last(const System<N, Catalogue>& system, const std::vector<RecordedRow<N>>& rows, Workspace<N>& ws,
                    RecordedPrediction<N, Catalogue>& prediction) {
  return predict(system, rows.back(), histories<N, Catalogue>(system, rows).back(), ws, prediction);
}

}  // namespace ctcr::test
