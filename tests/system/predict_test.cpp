#include "ctcr/system/predict.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>

#include "ctcr/system/parameters.hpp"
#include "support/laws.hpp"
#include "support/no_alloc.hpp"

namespace predict_test {

using namespace ctcr;

template <int N>
struct Command {
  System<N> system;
  MotorAngles<N> theta;
  TipLoad load;
};

/// A robot in a smooth place, with a transmission that brings it there and a tracker anywhere.
template <int N>
Command<N> random_command(bool loaded, int tube, test::Random& random) {
  const test::Case<N> c =
      test::smooth_case<N>(random, loaded ? 0.2 : 0, 0, loaded ? test::tilted_gravity : Vec3::Zero());
  const Transmission<N> transmission{test::uniform(random, 2e-4, 5e-4), -test::uniform(random, 0.5, 2),
                                     -0.1 * VecN<N>::Random().cwiseAbs(), VecN<N>::Random()};
  const PoseSensor sensor{{rotation_matrix(test::random_vector(random, 3)), test::random_vector(random, 0.5)},
                          tube,
                          {rotation_matrix(test::random_vector(random, 3)), test::random_vector(random, 0.05)}};
  return {{transmission, Model<N>(c.robot), sensor, {.tolerance = 1e-12, .steps = 20, .accuracy = test::as_told}},
          motor_angles(transmission, c.q),
          c.load};
}

template <int N>
Prediction<N> predicted(const System<N>& system, const MotorAngles<N>& theta, const TipLoad& load) {
  Workspace<N> ws;
  Prediction<N> prediction;
  EXPECT_EQ(predict(system, theta, load, ws, prediction), Status::ok);
  return prediction;
}

/// Reading from motor angles, step by step.
TEST(Predict, Reading) {
  test::Random random(1);
  for (int n = 0; n < 12; ++n) {
    const auto [system, theta, load] = random_command<3>(n % 2 == 0, n % 3, random);
    const Prediction<3> p = predicted(system, theta, load);
    const Transmission<3>& t = system.transmission;
    EXPECT_EQ(p.q.beta, VecN<3>(t.translation_ratio * theta.translation + t.home_translation));
    const Robot<3>& robot = system.model.robot();
    const Solution<3> solution = test::solved<Derivatives::none>(robot, p.q, load, system.settings.steps);
    const Pose& T_ref = system.sensor.T_tracker_base;
    const Pose& tip = solution.tube_tips[std::size_t(system.sensor.tube)];
    const Pose& T_tip_sensor = system.sensor.T_tip_sensor;
    const Vec3 place = tip.rotation * T_tip_sensor.position + tip.position;
    EXPECT_LE((p.reading.position - (T_ref.rotation * place + T_ref.position)).norm(), 1e-10);
    EXPECT_LE((p.reading.rotation - T_ref.rotation * tip.rotation * T_tip_sensor.rotation).norm(), 1e-9);
  }
}

/// Usual changes of a parameter, by which its derivative is judged, and a step for differences.
std::pair<double, double> scale(const ParameterKind& kind) {
  if (kind.name.ends_with("diameter")) return {1e-3, 1e-6};
  if (kind.unit == "m/rad") return {1e-3, 1e-8};
  if (kind.unit == "m") return {0.1, 1e-5};
  const double middle = kind.low > 0 ? std::sqrt(kind.low * kind.high) : 1.0;
  return {middle, 1e-3 * middle};
}

template <int N>
void expect_derivatives_of_the_residual(bool loaded, int cases) {
  using P = ParameterVector<N>;
  using Parameters = SystemParameters<N, Standard>;
  test::Random random(std::uint64_t(10 * N + loaded));
  for (int n = 0; n < cases; ++n) {
    const auto [system, theta, load] = random_command<N>(loaded, n % N, random);
    Workspace<N> ws;
    Prediction<N> prediction;
    PredictionDerivatives<N> exact;
    ASSERT_EQ(predict(system, theta, load, ws, prediction), Status::ok);
    ASSERT_EQ(differentiate(system, theta, ws, prediction, exact), Status::ok);
    const Pose measured = {rotation_matrix(test::random_vector(random, 2)) * prediction.reading.rotation,
                           prediction.reading.position + test::random_vector(random, 0.01)};
    EXPECT_EQ(residual(measured, prediction, exact), residual(measured, prediction.reading));

    const auto expect = [&](const Vec6& column, const auto& residual_at, double magnitude, double h, std::string what) {
      const Vec6 slope =
          (8 * (residual_at(h) - residual_at(-h)) - (residual_at(2 * h) - residual_at(-2 * h))) / (12 * h);
      EXPECT_LE((column - slope).norm(), 1e-6 * (slope.norm() + 1e-2 / magnitude)) << what << ", case " << n;
    };
    const Eigen::VectorXd values = Parameters::values(system);
    for (int p = 0; p < P::count; ++p) {
      const auto [kind, i] = P::entry(p);
      if (kind == Parameter::bending_stiffness) continue;  // not given
      const auto [size, h] = scale(P::info(kind));
      expect(
          exact.by_parameters.col(p),
          [&, index = p](double x) {
            Eigen::VectorXd moved = values;
            moved[index] += x;
            return residual(measured, predicted(Parameters::with_values(system, moved), theta, load).reading);
          },
          size, h, std::string(P::name(p)));
    }
    for (int j = 0; j < 2 * N; ++j)
      expect(
          exact.by_motors.col(j),
          [&](double x) {
            MotorAngles<N> moved = theta;
            (j < N ? moved.translation[j] : moved.rotation[j - N]) += x;
            return residual(measured, predicted(system, moved, load).reading);
          },
          1.0, j < N ? 0.03 : 1e-3, "motor " + std::to_string(j));
  }
}

/// Of the residual, by motor angles and by every parameter, against differences.
TEST(Predict, Derivatives) {
  for (const bool loaded : {false, true}) {
    expect_derivatives_of_the_residual<1>(loaded, 3);
    expect_derivatives_of_the_residual<3>(loaded, 6);
  }
}

/// A failed prediction is passed on, with derivatives of zero.
TEST(Predict, Failure) {
  test::Random random(2);
  const auto [system, theta, load] = random_command<3>(false, 0, random);
  Workspace<3> ws;
  Prediction<3> prediction;
  ASSERT_EQ(predict(system, theta, load, ws, prediction), Status::ok);
  Joints<3> behind = prediction.q;
  behind.beta[0] = 0.01;
  const MotorAngles<3> refused = motor_angles(system.transmission, behind);
  ASSERT_EQ(predict(system, refused, load, ws, prediction), Status::joints_out_of_order);
  PredictionDerivatives<3> derivatives;
  EXPECT_EQ(differentiate(system, refused, ws, prediction, derivatives), Status::joints_out_of_order);
  EXPECT_TRUE(derivatives.by_motors.isZero(0) && derivatives.by_parameters.isZero(0));
}

/// A sensor on a tube that is not there, or with a rotation that is none, is refused; all outputs are defined.
TEST(Predict, Sensor) {
  test::Random random(4);
  const auto [good, theta, load] = random_command<3>(false, 0, random);
  System<3> beyond = good, behind = good, turned = good;
  beyond.sensor.tube = 3;
  behind.sensor.tube = -1;
  turned.sensor.T_tracker_base.rotation *= std::nan("");
  for (const System<3>& system : {beyond, behind, turned}) {
    Workspace<3> ws;
    Prediction<3> prediction;
    ASSERT_EQ(predict(good, theta, load, ws, prediction), Status::ok);
    EXPECT_EQ(predict(system, theta, load, ws, prediction), Status::invalid_settings);
    EXPECT_EQ(prediction.solution.status, Status::invalid_settings);
    EXPECT_TRUE(prediction.reading.rotation.isIdentity(0) && prediction.reading.position.isZero(0));
    PredictionDerivatives<3> derivatives;
    EXPECT_EQ(differentiate(system, theta, ws, prediction, derivatives), Status::invalid_settings);
    EXPECT_TRUE(derivatives.by_motors.isZero(0) && derivatives.by_parameters.isZero(0));
  }
}

TEST(Predict, NoAllocation) {
  test::Random random(3);
  for (const bool loaded : {false, true}) {
    const auto [system, theta, load] = random_command<3>(loaded, 1, random);
    Workspace<3> ws;
    Prediction<3> prediction;
    PredictionDerivatives<3> derivatives;
    const test::HeapGuard guard;
    (void)predict(system, theta, load, ws, prediction);
    (void)differentiate(system, theta, ws, prediction, derivatives);
    (void)residual(Pose{}, prediction, derivatives);
    EXPECT_EQ(guard.uses(), 0);
  }
}

}  // namespace predict_test
