// Tubes that rub wind each other up.
#include "ctcr/pipeline/wind_up.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "ctcr/calibration/recording.hpp"
#include "support/walk.hpp"

namespace ctcr {
namespace wind_up_test {

using test::at, test::effect, test::Random, test::two_tubes, test::Walk, test::with_friction;

constexpr double elastic = 1;  // the second law of friction

Robot<2> straight() {
  Robot<2> robot = two_tubes();
  for (Tube& tube : robot.tubes) tube.curvature = 0;
  return robot;
}
Catalogue::On<2> rubbing_along(double torque_per_length, double slip_angle) {
  Catalogue::On<2> effects;
  effect<Friction, 2>(effects).values = {0, 0, torque_per_length, slip_angle, 0, elastic};
  return effects;
}
/// By how much the tips of straight tubes at `at(.., ..)` turn against each other per torque [rad m / N m].
double softness(const Robot<2>& robot, const Joints<2>& q) {
  const double overlap = robot.tubes[1].length + q.beta[1];
  double sum = 0;
  for (int i = 0; i < 2; ++i) sum += overlap * (-q.beta[i] + 0.5 * overlap) / robot.tubes[std::size_t(i)].GJ();
  return sum;
}

TEST(WindUp, ContactAndTubesAreSpringsInARow) {
  const Robot<2> robot = straight();
  constexpr double torque = 0.02, turn = 0.15;
  for (const double slip : {0.02, 0.1, 0.3}) {
    Walk<2> walk(robot, rubbing_along(torque, slip));
    walk.to(at(0, 0)).to(at(turn, 0));
    wind_up(walk.system, std::span(walk.rows));
    const double wound = torque * softness(robot, at(turn, 0));
    const double h = std::min(1.0, turn / (slip + wound));
    EXPECT_NEAR(walk.remembered<Friction>()[0], h, 2e-3) << slip;
    EXPECT_NEAR(walk.rows[1].twist.back()[0], -h * wound, 1e-4) << slip;
  }
}

/// A walk among curved tubes that turns back and forth.
Walk<2> curved_walk(double law, unsigned seed) {
  Random random(seed);
  Walk<2> walk(two_tubes(), with_friction(0.03, 0.7, law));
  for (int k = 0; k < 12; ++k)
    walk.to(at(test::uniform(random, -1.5, 1.5), test::uniform(random, -1, 1), -0.35 + 1e-3 * k));
  add_twist<2>(System<2>{walk.system.transmission, Model<2>(two_tubes()), {}, walk.system.settings}, walk.rows);
  return walk;
}

TEST(WindUp, TwistIsThatOfTheEquilibrium) {
  for (const double law : {0.0, elastic}) {
    Walk<2> walk = curved_walk(law, 1);
    const std::vector<RecordedRow<2>> plain = walk.rows;
    EXPECT_GT(wind_up(walk.system, std::span(walk.rows)), 0.05);
    const auto memory = memories<2, Catalogue>(walk.system, walk.rows);
    double wound = 0;
    for (std::size_t row = 0; row < walk.rows.size(); ++row) {
      Workspace<2> ws;
      RecordedPrediction<2, Catalogue> p;
      ASSERT_EQ(predict(walk.system, walk.rows[row], memory[row], ws, p), Status::ok);
      const auto& twist = walk.rows[row].twist.back();
      EXPECT_NEAR(twist_between(ws, twist)[0], twist[0], 2e-4) << row;
      wound = std::max(wound, std::abs(twist[0] - plain[row].twist.back()[0]));
    }
    EXPECT_GT(wound, 0.05);
    EXPECT_LT(wind_up(walk.system, std::span(walk.rows)), 1e-3) << "it was not wound up to its end";
  }
}

TEST(WindUp, IsNothingWhereNothingRubs) {
  Walk<2> walk(two_tubes(), with_friction(0));
  walk.to(at(0, 0)).to(at(1, 0));
  ThreadPool pool(1);
  Recording<2, Catalogue> recording(walk.system, walk.rows, std::vector<Pose>(walk.rows.size()), {}, pool);
  EXPECT_EQ(recording.wind_up(Eigen::VectorXd(0)), 0);
}

TEST(WindUp, DoesNotDependOnHowAWayIsRecorded) {
  const Joints<2> start = at(0, 0), end = at(2.5, -1.5, -0.34);
  const auto walked = [&](int parts, bool cut) {
    Walk<2> walk(two_tubes(), with_friction(0.03, 0.7, elastic));
    for (int k = 0; k <= parts; ++k) {
      const double part = double(k) / parts;
      Joints<2> q;
      q.alpha = start.alpha + part * (end.alpha - start.alpha);
      q.beta = start.beta + part * (end.beta - start.beta);
      walk.to(q);
    }
    add_twist<2>(System<2>{walk.system.transmission, Model<2>(two_tubes()), {}, walk.system.settings}, walk.rows);
    if (!cut)
      for (auto& row : walk.rows) row.twist = {row.twist.back()};
    wind_up(walk.system, std::span(walk.rows));
    return walk;
  };
  const Walk<2> whole = walked(1, true), divided = walked(60, true), uncut = walked(1, false);
  EXPECT_GT(whole.rows[1].twist.size(), 10u);
  const double there = divided.rows.back().twist.back()[0];
  EXPECT_NEAR(whole.rows.back().twist.back()[0], there, 5e-3);
  EXPECT_GT(std::abs(uncut.rows.back().twist.back()[0] - there), 0.02) << "the way is so even that it proves nothing";
}

}  // namespace wind_up_test
}  // namespace ctcr
