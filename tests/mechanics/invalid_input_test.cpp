// Every input gets a Status, and whatever the status all outputs are defined.
#include <gtest/gtest.h>

#include <limits>

#include "support/laws.hpp"

namespace ctcr {
namespace invalid_input_test {

constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
constexpr Derivatives all = Derivatives::compliance;

const Robot<3> robot = test::paper_robot();
const Joints<3> good{{-0.3, -0.2, -0.1}, {0.1, 1.2, -2.3}};
const TipLoad weight{.force = {0, -0.1, 0}};

bool finite(const Solution<3>& s) {
  bool tips = true;
  for (const Pose& tip : s.tube_tips) tips = tips && tip.position.allFinite() && tip.rotation.allFinite();
  return tips && s.position.allFinite() && s.rotation.allFinite() && s.jacobian.allFinite() &&
         s.compliance.allFinite() && std::isfinite(s.stability);
}

/// Refused by solve() and step(), cold and warm, and the next good call is not disturbed.
void expect_refused(const Joints<3>& q, const TipLoad& load, Status expected) {
  const Model<3> model(robot);
  for (const bool warm : {false, true}) {
    Workspace<3> ws, other;
    Solution<3> s, before;
    EXPECT_EQ(solve<all>(model, good, weight, other, before), Status::ok);
    if (warm) (void)solve<all>(model, good, weight, ws, s);
    EXPECT_EQ(solve<all>(model, q, load, ws, s), expected);
    EXPECT_EQ(s.status, expected);
    EXPECT_TRUE(finite(s));
    EXPECT_TRUE(s.position.isZero(0) && s.rotation.isIdentity(0) && s.jacobian.isZero(0) && s.compliance.isZero(0));
    EXPECT_EQ(s.iterations, 0);
    EXPECT_EQ(step<all>(model, q, load, ws, s), expected);
    EXPECT_EQ(solve<all>(model, good, weight, ws, s), Status::ok);
    EXPECT_LT((s.position - before.position).norm(), 1e-10);
  }
}

TEST(InvalidInput, JointsAndLoads) {
  for (const double bad : {nan, infinity, -infinity}) {
    Joints<3> q = good;
    q.alpha[1] = bad;
    expect_refused(q, weight, Status::not_finite);
    q = good;
    q.beta[0] = bad;
    expect_refused(q, weight, Status::not_finite);
    expect_refused(good, {.force = {0, bad, 0}}, Status::not_finite);
    expect_refused(good, {.moment = {bad, 0, 0}}, Status::not_finite);
  }
  expect_refused({.beta = {-0.19, -0.2, -0.1}}, weight, Status::joints_out_of_order);
  expect_refused({.beta = {-0.34, -0.2, -0.1}}, weight, Status::joints_out_of_order);
  expect_refused({.beta = {-0.3, -0.2, -0.1995}}, weight, Status::tip_behind_plate);
}

TEST(InvalidInput, RobotOfNonsense) {
  const auto expect_not_ok = [](const Robot<3>& nonsense) {
    Workspace<3> ws;
    Solution<3> s;
    const Status status = solve<all>(Model<3>(nonsense), good, weight, ws, s);
    EXPECT_NE(status, Status::ok);
    EXPECT_EQ(s.status, status);
    EXPECT_TRUE(finite(s)) << to_string(status);
  };
  Robot<3> nonsense = robot;
  nonsense.tubes[1].curvature = nan;
  expect_not_ok(nonsense);
  nonsense = robot;
  nonsense.tubes[0].youngs_modulus = nan;
  expect_not_ok(nonsense);
  nonsense = robot;
  nonsense.gravity = Vec3(0, nan, 0);
  expect_not_ok(nonsense);
  nonsense = robot;
  nonsense.tubes[2].length = nan;
  expect_not_ok(nonsense);
}

TEST(InvalidInput, LoadsBeyondAllReason) {
  test::Random random(1);
  for (int n = 0; n < test::cases(30); ++n) {
    Workspace<3> ws;
    Solution<3> s;
    const Joints<3> q = test::random_joints(robot, random);
    const TipLoad load = test::random_load(random, n % 2 == 0 ? 1e3 : 1e200, 1);
    const Status status = solve<all>(Model<3>(robot), q, load, ws, s);
    EXPECT_EQ(s.status, status);
    EXPECT_TRUE(finite(s)) << to_string(status);
    EXPECT_TRUE(status != Status::ok || s.residual < 1e-10);
  }
}

TEST(InvalidInput, TooFewIterationsAreReported) {
  Workspace<3> ws;
  Solution<3> s;
  const Status status = solve<all>(Model<3>(robot), good, {.force = {0, -0.3, 0}}, ws, s, {.max_iterations = 1});
  EXPECT_EQ(status, Status::not_converged);
  EXPECT_GT(s.residual, 1e-10);
  EXPECT_TRUE(finite(s));
}

TEST(InvalidInput, AnAccuracyThatIsNoNumberIsNotKept) {
  const Model<3> model(robot);
  Workspace<3> ws;
  Solution<3> s;
  EXPECT_EQ(solve<all>(model, good, weight, ws, s, {.accuracy = nan}), Status::inaccurate);
  EXPECT_TRUE(finite(s));
}

TEST(InvalidInput, WithoutEvaluationsNothingConverges) {
  const Model<3> model(robot);
  for (const int none : {0, -1, std::numeric_limits<int>::min()}) {
    Workspace<3> ws;
    Solution<3> s;
    EXPECT_NE(solve<all>(model, good, weight, ws, s, {.max_iterations = none}), Status::ok);
    EXPECT_TRUE(finite(s));
  }
}

/// At most max_iterations evaluations, or 4 where that is less, whatever tolerance and accuracy are asked.
TEST(InvalidInput, NoSolveTakesMoreThanItsIterations) {
  test::Random random(3);
  const auto power = [&](double low, double high) { return std::pow(10, test::uniform(random, low, high)); };
  for (int n = 0; n < test::cases(600); ++n) {
    Robot<3> any = robot;
    if (n % 3 == 0) any.gravity = Vec3(0, -9.81, 0);
    if (n % 5 == 0)
      for (Tube& tube : any.tubes) tube.curvature *= 4;
    const Settings settings{.max_iterations = int(test::uniform(random, -1, 40)),
                            .tolerance = power(-12, 0.5),
                            .accuracy = power(-12, -2),
                            .max_steps = 200};
    const Model<3> model(any);
    const TipLoad load = n % 2 == 0 ? TipLoad{} : test::random_load(random, power(-3, 1), 0.01);
    Joints<3> q = test::random_joints(any, random);
    Workspace<3> ws;
    Solution<3> s;
    for (int warm = 0; warm < 3; ++warm) {
      (void)solve<Derivatives::jacobian>(model, q, load, ws, s, settings);
      EXPECT_LE(s.iterations, std::max(settings.max_iterations, 4));
      q.alpha.array() += test::uniform(random, -0.5, 0.5);
    }
  }
}

/// A load that is too small to bend anything leaves the robot as it is without, and its derivatives as they are of a small
/// load, whether squares of it underflow or not.
TEST(InvalidInput, TheSmallestLoads) {
  for (const Vec3& direction : {Vec3(0, -1, 0), Vec3(1, 0, 0), Vec3(0.3, 0.4, -0.5)})
    for (const double size : {5e-324, 1e-310, 1e-300, 1e-163, 1e-158, 1e-154, 1e-150, 1e-20}) {
      const TipLoad force{.force = size * direction}, moment{.moment = size * direction};
      for (const TipLoad& load : {force, moment}) {
        const Model<3> model(robot);
        const auto expect_as_without = [&](auto derivatives) {
          constexpr Derivatives D = decltype(derivatives)::value;
          Workspace<3> ws, none;
          Solution<3> s, without;
          ASSERT_EQ(solve<D>(model, good, {}, none, without), Status::ok);
          for (const bool warm : {false, true}) {
            ASSERT_EQ(solve<D>(model, good, load, ws, s), Status::ok) << size << (warm ? " warm" : " cold");
            EXPECT_LT((s.position - without.position).norm(), 1e-5);
            EXPECT_LT((s.jacobian - without.jacobian).cwiseAbs().maxCoeff(), 1e-3);
            EXPECT_LE((s.compliance - without.compliance).norm(), 1e-3 * without.compliance.norm());
            ASSERT_EQ(step<D>(model, good, load, ws, s), Status::ok);
          }
        };
        expect_as_without(std::integral_constant<Derivatives, Derivatives::none>{});
        expect_as_without(std::integral_constant<Derivatives, Derivatives::jacobian>{});
        expect_as_without(std::integral_constant<Derivatives, all>{});
      }
    }
}

}  // namespace invalid_input_test
}  // namespace ctcr
