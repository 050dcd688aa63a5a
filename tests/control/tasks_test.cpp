#include "ctcr/control/tasks.hpp"

#include <gtest/gtest.h>

#include "random_control.hpp"
#include "support/solver.hpp"

namespace ctcr {
namespace tasks_test {

using test::Random, test::uniform;

/// A robot solved somewhere, with what tasks see of it.
struct Place {
  Model<3> model{test::paper_robot()};
  Settings settings;
  Joints<3> q;
  Workspace<3> ws;
  Solution<3> solution;
  Reference reference;
  explicit Place(const Joints<3>& at) : q(at) { (void)solve<Derivatives::jacobian>(model, q, TipLoad{}, ws, solution); }
  [[nodiscard]] ControlState<3> state() const {
    return {model, settings, {}, q, solution.pose(), reference, ws, solution};
  }
};
const Joints<3> somewhere{{-0.30, -0.21, -0.12}, {0.3, 1.2, -0.7}};

/// The minimum of one task and a little damping.
template <class Task>
JointVelocity<3> answer(const Task& task, const Place& place) {
  LeastSquares<3> goals;
  task.add(place.state(), goals);
  goals.add_joint_goal(JointVelocity<3>::Zero(), {1e-9 + 1e-6 * goals.largest_weight(), 1e-9});
  JointVelocity<3> v;
  EXPECT_EQ(goals.minimum(v), Status::ok);
  return v;
}

double sum_of_squared_gaps(const Robot<3>& robot, const Vec3& beta) {
  const Gaps<3> g = gaps(robot, beta);
  return g.bases.squaredNorm() + g.tips.squaredNorm();
}

TEST(Gaps, AddUpToTheLengthOfTheInnermostTube) {
  Random random(31);
  for (int n = 0; n < test::cases(50); ++n) {
    const auto robot = test::random_robot<3>(random);
    const Gaps<3> g = gaps(robot, test::random_joints(robot, random).beta);
    EXPECT_NEAR(g.bases.sum() + g.tips.sum(), robot.tubes[0].length, 1e-12);
    EXPECT_GE(std::min(g.bases.minCoeff(), g.tips.minCoeff()), -1e-12);
  }
}

TEST(LimitAvoidance, GradientOfTheSumOfSquaredGaps) {
  Random random(32);
  for (int n = 0; n < test::cases(50); ++n) {
    const auto robot = test::random_robot<3>(random);
    const Vec3 beta = test::random_joints(robot, random).beta;
    const JointVelocity<3> gradient = LimitAvoidance::gradient(robot, beta);
    for (int i = 0; i < 3; ++i) {
      constexpr double h = 1e-6;
      const double difference = (sum_of_squared_gaps(robot, beta + h * Vec3::Unit(i)) -
                                 sum_of_squared_gaps(robot, beta - h * Vec3::Unit(i))) /
                                (2 * h);
      EXPECT_NEAR(gradient[i], difference, 1e-8);
    }
    EXPECT_EQ(gradient.tail<3>().norm(), 0);
  }
}

TEST(Tracking, FeedforwardAndBoundedFeedback) {
  Place place(somewhere);
  place.reference = {place.solution.pose()};
  place.reference.velocity.head<3>() = Vec3(1e-3, -2e-3, 3e-3);
  const Tracking tracking;
  EXPECT_LT((tracking.velocity(place.state()) - place.reference.velocity).norm(), 1e-15);
  const Vec3 tip = (place.solution.jacobian * answer(tracking, place)).head<3>();
  EXPECT_LT((tip - place.reference.velocity.head<3>()).norm(), 1e-5);
  place.reference.pose.position += Vec3(0.1, 0, 0);
  const Vec3 far = tracking.velocity(place.state()).head<3>() - place.reference.velocity.head<3>();
  EXPECT_NEAR(far.norm(), tracking.correction, 1e-12);
  EXPECT_GT(tracking.shortfall(place.state(), JointVelocity<3>::Zero().eval()), 1);
}

/// Of a reference that is far away, unless it is too far to compute with.
TEST(Tracking, FeedbackHasADirectionOrIsNoNumber) {
  Place place(somewhere);
  const Tracking tracking;
  for (const double far : {1.0, 1e100, 1e200, 1e300}) {
    place.reference = {place.solution.pose()};
    place.reference.pose.position += far * Vec3(0.6, 0, -0.8);
    const Vec3 v = tracking.velocity(place.state()).head<3>();
    EXPECT_TRUE((v - tracking.correction * Vec3(0.6, 0, -0.8)).norm() < 1e-12 || (far > 1e150 && !v.allFinite()));
  }
}

TEST(Tracking, OfThePoseTurnsTheTip) {
  Place place(somewhere);
  const Vec3 turn(0.01, -0.02, 0.005);
  place.reference = {{rotation_matrix(turn) * place.solution.rotation, place.solution.position}};
  const Tracking tracking{.weight = {1e7, 1e5}, .gain = 2};
  const Vec6 moved = place.solution.jacobian * answer(tracking, place);
  EXPECT_LT((moved.tail<3>() - 2 * turn).norm(), 0.05 * turn.norm());
}

/// And points away from the obstacle.
TEST(ObstacleAvoidance, FallsWithTheSquaredDistance) {
  Place place(somewhere);
  ObstacleAvoidance task{.obstacle = {place.solution.position + Vec3(0, 9e-3, 0), 5e-3}, .gain = 1e-6};
  const Vec3 near = (place.solution.jacobian * answer(task, place)).head<3>();
  EXPECT_LT((near.normalized() - Vec3(0, -1, 0)).norm(), 1e-2);
  EXPECT_NEAR(near.norm(), 1e-6 / (4e-3 * 4e-3), 0.01 * near.norm());
  task.obstacle.centre = place.solution.position + Vec3(0, 13e-3, 0);
  const Vec3 far = (place.solution.jacobian * answer(task, place)).head<3>();
  EXPECT_NEAR(far.norm() / near.norm(), 0.25, 0.01);
  task.obstacle.radius = 0;
  EXPECT_EQ(answer(task, place).norm(), 0);
}

TEST(Posture, LeadsThere) {
  const Place place(somewhere);
  Posture<3> task;
  task.weight = {1, 1};
  task.preferred = {{-0.29, -0.2, -0.11}, {0, 1, 0}};
  const JointVelocity<3> v = answer(task, place);
  EXPECT_LT((v.head<3>() - task.rate * (task.preferred.beta - place.q.beta)).norm(), 1e-5);
  EXPECT_LT((v.tail<3>() - task.rate * (task.preferred.alpha - place.q.alpha)).norm(), 1e-5);
}

TEST(StabilityMargin, RaisesTheDeterminant) {
  Random random(33);
  int tried = 0;
  for (int n = 0; n < test::cases(20); ++n) {
    Place place(test::random_joints(test::paper_robot(), random));
    const StabilityMargin task{.weight = {1, 1}, .wanted = place.solution.stability + 0.1};
    const JointVelocity<3> v = answer(task, place);
    if (v.norm() == 0 || place.solution.status != Status::ok) continue;
    constexpr double h = 1e-3;
    Joints<3> q = place.q;
    q.beta += h * v.head<3>();
    q.alpha += h * v.tail<3>();
    Solution<3> later;
    if (solve<Derivatives::jacobian>(place.model, q, TipLoad{}, place.ws, later) != Status::ok) continue;
    EXPECT_GT(later.stability, place.solution.stability - 1e-9);
    ++tried;
  }
  EXPECT_GT(tried, test::cases(20) / 2);
}

}  // namespace tasks_test
}  // namespace ctcr
