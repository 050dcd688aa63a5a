#include "ctcr/recording/derivatives.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "support/catalogue_cases.hpp"
#include "support/no_alloc.hpp"

namespace recorded_derivatives_test {

using namespace ctcr;

using Columns = Eigen::Matrix<double, 6, Eigen::Dynamic>;

template <int N>
using P = SystemParameters<N, Catalogue>;

template <int N>
std::vector<int> all_parameters() {
  std::vector<int> all(P<N>::count);
  std::iota(all.begin(), all.end(), 0);
  return all;
}

/// How a parameter is varied: its usual changes, a step for differences, and where it may not be negative.
struct Variation {
  double size, h;
  bool forward = false;
};

template <int N>
Variation variation(const System<N, Catalogue>& system, int parameter) {
  Variation v{};
  if (parameter < ParameterVector<N>::count) {
    const ParameterKind& kind = ParameterVector<N>::info(ParameterVector<N>::entry(parameter).kind);
    if (kind.name.ends_with("diameter")) return {1e-3, 3e-7};
    if (kind.unit == "m/rad") return {1e-3, 1e-8};
    if (kind.unit == "m") return {0.1, 1e-5};
    const double middle = kind.low > 0 ? std::sqrt(kind.low * kind.high) : 1.0;
    return {middle, 1e-3 * middle};
  }
  system.model.effects().for_each([&](const auto& effect, int first) {
    for (int k = 0; k < int(effect.parameters.size()); ++k)
      for (int i = 0; i < effect.size(k); ++i)
        if (ParameterVector<N>::count + first + effect.index(k, i) == parameter) {
          const EffectParameter& p = effect.parameters[std::size_t(k)];
          const bool at_edge = effect.values[std::size_t(effect.index(k, i))] <= p.hard.low + 4e-3 * p.sigma;
          const bool plane = effect.info.id == "contact", shape = p.role == Role::shape;
          double h = shape && p.unit == "m" ? 1e-8 : 2e-3 * p.sigma;
          if (plane) h = shape ? 2e-5 : at_edge ? 3e-3 : 0.1;  // the tip must stay in touch
          v = {plane ? 1.0 : p.sigma, h, at_edge};
        }
  });
  return v;
}

/// Slope at 0 of what f(x) adds to f(0), of fourth order.
template <class F>
Vec6 slope(const F& f, const Variation& v) {
  const double h = v.h;
  if (v.forward) return (48 * f(h) - 36 * f(2 * h) + 16 * f(3 * h) - 3 * f(4 * h)) / (12 * h);
  return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
}

/// A plane that the tip has entered.
template <int N>
void touch(test::Recorded<N>& recorded, double depth, double stiffness, double rounding) {
  Workspace<N> ws;
  RecordedPrediction<N, Catalogue> free;
  auto effects = recorded.system.model.effects();
  auto& contact = test::effect<Contact, N>(effects).values;
  contact[0] = 0;
  System<N, Catalogue> system = recorded.system;
  system.model = Model<N, Catalogue>(recorded.system.model.robot(), effects);
  ASSERT_EQ(test::predict_last(system, recorded.rows, ws, free), Status::ok);
  const Vec3 n = (Vec3(1, 0.5, 0.3) + free.solution.rotation.col(0)).normalized();
  contact = {stiffness, n.dot(free.solution.position) - depth, std::atan2(n.y(), n.x()), std::asin(n.z()), rounding};
  recorded.system.model = Model<N, Catalogue>(recorded.system.model.robot(), effects);
}

template <int N>
auto sensitivities(const System<N, Catalogue>& system, const std::vector<RecordedRow<N>>& rows,
                   const std::vector<int>& parameters) {
  const RecordedPath<N> path = recorded_path<N, Catalogue>(system, rows);
  const LinearisedTorsion<N> torsion;
  HistorySensitivities<N, Catalogue> all(system, rows, path, torsion, parameters, std::vector<bool>(rows.size(), true));
  for (int window = 0; window < all.windows(); ++window) all.fill(window);
  return all;
}

/// Derivatives of the last row, with those of its history.
template <int N>
Status derivatives_of_last(const System<N, Catalogue>& system, const std::vector<RecordedRow<N>>& rows,
                           const Workspace<N>& ws, const RecordedPrediction<N, Catalogue>& prediction,
                           const std::vector<int>& parameters, Columns& out) {
  const auto history = sensitivities(system, rows, parameters);
  return differentiate<N, Catalogue>(system, rows.back(), ws, prediction, parameters, out, history.at(rows.size() - 1));
}

template <int N>
void expect_derivatives(const test::Recorded<N>& recorded, const std::string& what) {
  const auto& [system, rows] = recorded;
  Workspace<N> ws;
  RecordedPrediction<N, Catalogue> prediction;
  ASSERT_EQ(test::predict_last(system, rows, ws, prediction), Status::ok) << what;
  Columns exact(6, P<N>::count);
  ASSERT_EQ(derivatives_of_last(system, rows, ws, prediction, all_parameters<N>(), exact), Status::ok);
  const Eigen::VectorXd x = P<N>::values(system);
  for (int parameter = 0; parameter < P<N>::count; ++parameter) {
    if (ParameterVector<N>::index(Parameter::bending_stiffness) <= parameter &&
        parameter < ParameterVector<N>::index(Parameter::gravity))
      continue;  // not given
    const Variation v = variation(system, parameter);
    const auto change = [&](double by) {
      Eigen::VectorXd moved = x;
      moved[parameter] += by;
      Workspace<N> from = ws;
      RecordedPrediction<N, Catalogue> other;
      EXPECT_EQ(test::predict_last(P<N>::with_values(system, moved), rows, from, other), Status::ok);
      return test::difference(prediction.reading, other.reading);
    };
    Vec6 expected = slope(change, v);
    const auto agrees = [&] {
      return (exact.col(parameter) - expected).norm() <= 2e-5 * (expected.norm() + 1e-2 / v.size);
    };
    // Near an instability a reading changes so fast that the usual step is too long.
    if (!agrees()) expected = slope(change, {v.size, v.h / 16, v.forward});
    EXPECT_TRUE(agrees()) << P<N>::name(parameter) << ", " << what << "\nexact      "
                          << exact.col(parameter).transpose() << "\ndifference " << expected.transpose();
  }
}

template <int N>
void expect_derivatives(int cases) {
  test::Random random(std::uint64_t(40 + N));
  for (int n = 0; n < cases; ++n) {
    const std::string what = std::to_string(N) + " tubes, case " + std::to_string(n);
    auto neutral = test::random_recording<N>({}, n % N, random);
    touch(neutral, 2e-3, 0.0, 0.0);  // a plane that gives way altogether, yet might not
    expect_derivatives(neutral, what + ", neutral");
    auto recorded = test::random_recording<N>(test::random_effects<N>(random), n % N, random);
    n % 2 == 0 ? touch(recorded, 2e-3, 3.0, 0.0) : touch(recorded, 2e-3, 1000.0, 4e-3);
    expect_derivatives(recorded, what);
  }
}

/// Against differences, by every parameter, with history, loads and contact; the sensor on each tube in turn.
TEST(RecordedDerivatives, Differences) {
  expect_derivatives<1>(test::cases(2));
  expect_derivatives<2>(test::cases(2));
  expect_derivatives<3>(test::cases(3));
}

/// A few columns are those of all.
TEST(RecordedDerivatives, Subsets) {
  test::Random random(3);
  auto recorded = test::random_recording<3>(test::random_effects<3>(random), 1, random);
  touch(recorded, 1e-3, 30, 0.0);
  const auto& [system, rows] = recorded;
  Workspace<3> ws;
  RecordedPrediction<3, Catalogue> prediction;
  ASSERT_EQ(test::predict_last(system, rows, ws, prediction), Status::ok);
  Columns all(6, P<3>::count);
  (void)derivatives_of_last(system, rows, ws, prediction, all_parameters<3>(), all);
  for (const std::vector<int>& few : {std::vector<int>{}, {P<3>::count - 1}, {80, 3, 41}}) {
    Columns some(6, Eigen::Index(few.size()));
    ASSERT_EQ(derivatives_of_last(system, rows, ws, prediction, few, some), Status::ok);
    for (std::size_t k = 0; k < few.size(); ++k)
      EXPECT_LE((some.col(Eigen::Index(k)) - all.col(few[k])).norm(), 1e-12 * (1 + all.col(few[k]).norm()));
  }
}

// Where no effect is asked for that changes the equations, the standard model's own derivatives are taken.
template <int N>
void expect_those_of_the_standard_model(int cases) {
  test::Random random(11 * N);
  for (int n = 0; n < cases; ++n) {
    auto effects = test::random_effects<N>(random);
    std::vector<int> few, all = all_parameters<N>();
    effects.for_each([&](auto& effect, int) {
      using E = std::remove_cvref_t<decltype(effect)>;
      if (ActsOnRod<E, double, N> || HasEnvironment<E, double>) effect.values = E::neutral();
    });
    for (const int parameter : all)
      if (detail::reaches<N, Catalogue>[std::size_t(parameter)] != detail::Reach::equations) few.push_back(parameter);
    auto [system, rows] = test::random_recording<N>(effects, n % N, random);
    const bool loaded = n % 2 == 1;
    if (!loaded) {  // nor any weight
      Eigen::VectorXd x = P<N>::values(system);
      x.segment<3>(ParameterVector<N>::index(Parameter::gravity)).setZero();
      system = P<N>::with_values(system, x);
      rows.back().load = {};
    }
    Workspace<N> ws;
    RecordedPrediction<N, Catalogue> prediction;
    ASSERT_EQ(test::predict_last(system, rows, ws, prediction), Status::ok);
    Columns some(6, Eigen::Index(few.size())), every(6, Eigen::Index(all.size()));
    ASSERT_EQ(derivatives_of_last(system, rows, ws, prediction, few, some), Status::ok);
    ASSERT_EQ(derivatives_of_last(system, rows, ws, prediction, all, every), Status::ok);
    EXPECT_LT(few.size(), all.size());
    for (std::size_t k = 0; k < few.size(); ++k) {
      const Vec6 expected = every.col(few[k]);
      // Without load the standard model has equations of its own, with another discretisation error.
      EXPECT_LE((some.col(Eigen::Index(k)) - expected).norm(), (loaded ? 1e-9 : 1e-6) * (1 + expected.norm()))
          << P<N>::name(few[k]) << ", " << N << " tubes, case " << n;
    }
  }
}

TEST(RecordedDerivatives, StandardModel) {
  expect_those_of_the_standard_model<1>(4);
  expect_those_of_the_standard_model<2>(6);
  expect_those_of_the_standard_model<3>(6);
}

/// NaN and infinite parameters give a status and defined outputs.
TEST(Recorded, NotFinite) {
  test::Random random(4);
  const auto recorded = test::random_recording<2>({}, 0, random);
  for (int parameter = 0; parameter < Catalogue::On<2>::count; ++parameter)
    for (const double absurd : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      Eigen::VectorXd x = P<2>::values(recorded.system);
      x[ParameterVector<2>::count + parameter] = absurd;
      const auto system = P<2>::with_values(recorded.system, x);
      Workspace<2> ws;
      RecordedPrediction<2, Catalogue> prediction;
      EXPECT_EQ(test::predict_last(system, recorded.rows, ws, prediction), Status::not_finite)
          << P<2>::name(ParameterVector<2>::count + parameter);
      EXPECT_TRUE(prediction.reading.position.allFinite() && prediction.reading.rotation.allFinite());
      EXPECT_TRUE(prediction.solution.position.isZero(0));
      Columns derivatives(6, 1);
      EXPECT_EQ(
          (differentiate<2, Catalogue>(system, recorded.rows.back(), ws, prediction, std::vector{0}, derivatives)),
          Status::not_finite);
      EXPECT_TRUE(derivatives.isZero(0));
    }
}

TEST(Recorded, NoAllocation) {
  test::Random random(5);
  auto recorded = test::random_recording<3>(test::random_effects<3>(random), 1, random);
  touch(recorded, 1e-3, 30, 0.0);
  const auto& [system, rows] = recorded;
  const auto states = histories<3, Catalogue>(system, rows);
  const std::vector<int> all = all_parameters<3>();
  const auto history = sensitivities(system, rows, all);
  Columns derivatives(6, P<3>::count);
  Workspace<3> ws;
  RecordedPrediction<3, Catalogue> prediction;
  const test::HeapGuard guard;
  const Status predicted = predict(system, rows.back(), states.back(), ws, prediction);
  const Status differentiated =
      differentiate<3, Catalogue>(system, rows.back(), ws, prediction, all, derivatives, history.at(rows.size() - 1));
  EXPECT_EQ(guard.uses(), 0);
  EXPECT_EQ(predicted, Status::ok);
  EXPECT_EQ(differentiated, Status::ok);
}

template <class F>
constexpr bool never_throws = false;
template <class R, class... A>
constexpr bool never_throws<R (*)(A...) noexcept> = true;

TEST(Recorded, Noexcept) {
  static_assert(never_throws<decltype(&predict<3, Catalogue>)>);
  static_assert(never_throws<decltype(&differentiate<3, Catalogue>)>);
}

}  // namespace recorded_derivatives_test
