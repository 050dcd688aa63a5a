#pragma once
// Walks through joints, for tests of effects that remember.
#include <gtest/gtest.h>

#include "support/catalogue_cases.hpp"

namespace ctcr::test {

/// A path through joints [rad], [m], at times [s]; motors are joints.
template <int N>
struct Walk {
  System<N, Catalogue> system;
  std::vector<RecordedRow<N>> rows;

  explicit Walk(const Robot<N>& robot, const Catalogue::On<N>& effects = {})
    : system{{1, 1, VecN<N>::Zero(), VecN<N>::Zero()}, Model<N, Catalogue>(robot, effects), {}, {.tolerance = 1e-12}} {}

  Walk& to(const Joints<N>& q, double time = 0) {
    rows.push_back({{q.beta, q.alpha}, {}, {.time = time}});
    return *this;
  }
  /// What E remembers of the last row.
  template <template <int, class> class E>
  [[nodiscard]] auto remembered() const {
    auto effects = system.model.effects();
    effects.set_history(histories<N, Catalogue>(system, rows).back());
    return effect<E, N>(effects).history.state;
  }
  [[nodiscard]] Solution<N> solution() const {
    Workspace<N> ws;
    RecordedPrediction<N, Catalogue> p;
    EXPECT_EQ(predict_last(system, rows, ws, p), Status::ok);
    return p.solution;
  }
};

inline const Robot<2>& two_tubes() {
  static const Robot<2> robot{{paper_robot().tubes[0], paper_robot().tubes[1]}, Vec3::Zero()};
  return robot;
}
inline Joints<2> at(double alpha_1, double alpha_2, double beta_1 = -0.35, double beta_2 = -0.25) {
  Joints<2> q;
  q.alpha << alpha_1, alpha_2;
  q.beta << beta_1, beta_2;
  return q;
}

inline Catalogue::On<2> with_friction(double coefficient, double insertion = 0, double law = 0) {
  Catalogue::On<2> effects;
  effect<Friction, 2>(effects).values = {coefficient, coefficient, 0, 0.3, insertion, law};
  return effects;
}

}  // namespace ctcr::test
