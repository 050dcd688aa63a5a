// The tip errors of wrong parameters, against cold solves to rounding of the same configurations.
#include "ctcr/simulation/sensitivity.hpp"

#include <gtest/gtest.h>

#include "support/random_robots.hpp"
#include "support/solver.hpp"

namespace ctcr {
namespace sensitivity_test {

using P = SystemParameters<3, Standard>;
using Index = P::Robot;

constexpr std::uint64_t seed = 5;
constexpr int steps = 4;

/// Both ends of some parameters: of a tube, of the joints, and of the tracker.
Variations<3> variations(double most_force) {
  const System<3> nominal{{2e-3, -1, {-0.298, -0.2205, -0.145}, {0.1, 0.2, 0.3}},
                          Model<3>(test::paper_robot()),
                          {{rotation_matrix({0, 1.2, 0.3}), {-0.06, 0.02, -0.18}}},
                          {.steps = steps}};
  const Eigen::VectorXd x = P::values(nominal);
  Variations<3> v{nominal, {}, x, x, most_force};
  const auto vary = [&](Parameter kind, int i, double size) {
    const int at = Index::index(kind, i);
    for (const double change : {-size, size}) {
      Eigen::VectorXd changed = x;
      changed[at] += change;
      v.systems.push_back(P::with_values(nominal, changed));
    }
    v.low[at] -= size;
    v.high[at] += size;
  };
  vary(Parameter::youngs_modulus, 0, 15e9);
  vary(Parameter::curved_length, 1, 5e-3);
  vary(Parameter::curvature, 2, 0.7);
  vary(Parameter::length, 1, 5e-3);
  vary(Parameter::home_translation, 2, 5e-3);
  vary(Parameter::home_rotation, 1, 0.087);
  vary(Parameter::tracker_position, 0, 3e-3);
  vary(Parameter::tracker_rotation, 2, 0.052);
  return v;
}

/// The one configuration of a block.
void configuration(const Variations<3>& v, std::uint64_t block, Joints<3>& q, TipLoad& load) {
  std::seed_seq mixed{seed, seed >> 32, block, block >> 32};
  std::mt19937_64 random(mixed);
  draw_configuration(v.nominal.model.robot(), v.most_force, random, q, load);
}

/// Where a system's sensor reads with the joints that `theta` means to it; a tube that cannot be there moves to where it
/// can. In four times the usual steps, so that it does not matter which system they are chosen for.
Vec3 cold(const System<3>& system, const MotorAngles<3>& theta, const TipLoad& load) {
  Joints<3> q = joints(system.transmission, theta);
  detail::put_in_order(system.model.robot(), q);
  Workspace<3> ws;
  Solution<3> solution;
  EXPECT_EQ(solve(system.model, q, load, ws, solution, {.steps = steps}), Status::ok);
  return reading(system.sensor, solution.tube_tips).position;
}

TEST(Sensitivity, IsThatOfColdSolves) {
  for (const double most_force : {0.0, 0.3}) {
    const Variations<3> v = variations(most_force);
    double off = 0, mean = 0;
    int count = 0;
    for (std::uint64_t block = 0; block < 40; ++block) {
      std::vector<DistanceStatistics> found(v.systems.size() + 1);
      EXPECT_GT(tip_sensitivity<3>(v, seed, block, 1, found), 0);
      Joints<3> q;
      TipLoad load;
      configuration(v, block, q, load);
      const MotorAngles<3> theta = motor_angles(v.nominal.transmission, q);
      const Vec3 right = cold(v.nominal, theta, load);
      for (std::size_t i = 0; i < v.systems.size(); ++i) {
        ASSERT_EQ(found[i].count, 1);
        const double wanted = (cold(v.systems[i], theta, load) - right).norm();
        EXPECT_NEAR(found[i].maximum, wanted, 1e-7) << "system " << i << ", block " << block;
        off += std::abs(found[i].maximum - wanted);
        mean += wanted;
        ++count;
      }
      EXPECT_EQ(found.back().count, 1);
      EXPECT_LT(found.back().maximum, 0.15);
    }
    EXPECT_LT(off, 1e-6 * mean);
    EXPECT_GT(mean / count, 1e-3);
  }
}

/// What makes it fast: few evaluations a tip, four at a time.
TEST(Sensitivity, TipsTakeFewEvaluations) {
  const Variations<3> v = variations(0.3);
  std::vector<DistanceStatistics> found(v.systems.size() + 1);
  const auto evaluations = tip_sensitivity<3>(v, seed, 0, 200, found);
  constexpr int solved = 12 + 1;  // a wrong tracker frame costs none
  EXPECT_LT(double(evaluations) / (200 * solved), 4.5);
}

TEST(Sensitivity, AShiftOfTheTrackerMovesEveryTipAsMuch) {
  const Variations<3> v = variations(0.3);
  std::vector<DistanceStatistics> found(v.systems.size() + 1);
  (void)tip_sensitivity<3>(v, seed, 0, 20, found);
  for (const std::size_t end : {12, 13}) {
    EXPECT_EQ(found[end].count, 20);
    EXPECT_NEAR(found[end].sum / 20, 3e-3, 1e-12);
    EXPECT_NEAR(found[end].maximum, 3e-3, 1e-12);
  }
}

}  // namespace sensitivity_test
}  // namespace ctcr
