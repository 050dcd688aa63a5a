// Models with every effect keep what is promised of solve() and step().
#include <gtest/gtest.h>

#include <limits>

#include "support/catalogue_cases.hpp"
#include "support/no_alloc.hpp"

namespace ctcr {
namespace realtime_test {

TEST(EffectsInRealTime, DoNotTouchTheHeap) {
  test::Random random(1);
  for (int n = 0; n < test::cases(12); ++n) {
    Robot<3> robot = test::random_robot<3>(random);
    if (n % 2 == 0) robot.gravity = test::tilted_gravity;
    Joints<3> q = test::random_joints(robot, random, 0.2);
    const TipLoad load = test::random_load(random, n % 6 == 5 ? 100 : 0.1, 0.002);  // one beyond reason
    const auto effects = test::random_effects<3>(random);
    const test::HeapGuard guard;
    const Model<3, Catalogue> model(robot, effects);
    Workspace<3> ws;
    Solution<3> s;
    (void)solve<Derivatives::compliance>(model, q, load, ws, s);
    for (int k = 0; k < 3; ++k) {
      q.alpha[0] += 0.01;
      (void)step<Derivatives::compliance>(model, q, load, ws, s);
    }
    q.alpha[0] = std::numeric_limits<double>::quiet_NaN();
    (void)step<Derivatives::compliance>(model, q, load, ws, s);
    EXPECT_EQ(guard.uses(), 0);
    EXPECT_EQ(s.status, Status::not_finite);
    EXPECT_TRUE(s.position.isZero(0));
  }
}

TEST(EffectsInRealTime, AStepFollowsTheJoints) {
  test::Random random(2);
  for (int n = 0; n < test::cases(10); ++n) {
    auto c = test::smooth_case<3>(random, 0.1, 0.002, test::tilted_gravity);
    const Model<3, Catalogue> model(c.robot, test::random_effects<3>(random));
    Workspace<3> ws, cold;
    Solution<3> s, solved;
    ASSERT_EQ(solve<Derivatives::compliance>(model, c.q, c.load, ws, s), Status::ok);
    if (s.stability < 0.2) continue;
    c.q.alpha[1] += 0.01;
    c.q.beta[0] += 2e-4;
    ASSERT_EQ(step<Derivatives::compliance>(model, c.q, c.load, ws, s), Status::ok);
    EXPECT_EQ(s.iterations, 1);
    ASSERT_EQ(solve<Derivatives::compliance>(model, c.q, c.load, cold, solved), Status::ok);
    EXPECT_LE((s.position - solved.position).norm(), 1e-6);
  }
}

TEST(EffectsInRealTime, AnswerAbsurdValues) {
  test::Random random(3);
  const auto c = test::smooth_case<3>(random, 0.1, 0, test::tilted_gravity);
  for (const double absurd :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e200}) {
    Catalogue::On<3> effects;
    test::effect<Anisotropy, 3>(effects).values = {absurd, 0, 0, 0, 0, 0};
    Workspace<3> ws;
    Solution<3> s;
    const Status status = solve<Derivatives::compliance>(Model<3, Catalogue>(c.robot, effects), c.q, c.load, ws, s);
    EXPECT_TRUE(status == Status::not_finite || absurd == 1e200);
    EXPECT_TRUE(s.position.allFinite() && s.rotation.allFinite() && s.compliance.allFinite() && s.jacobian.allFinite());
  }
}

}  // namespace realtime_test
}  // namespace ctcr
