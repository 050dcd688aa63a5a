// The judge itself: it agrees with closed forms, and it finds what is wrong with an answer that was spoilt.
#include "robustness/judge.hpp"

#include <gtest/gtest.h>

#include "robustness/random_designs.hpp"

namespace ctcr {
namespace judge_test {

using test::IndependentRod, test::Random, test::uniform;

/// A tube that is curved from end to end lies on a circle in the plane of its y axis.
TEST(Judge, KnowsTheCircle) {
  Robot<1> robot;
  robot.tubes[0] = {.youngs_modulus = 60e9,
                    .inner_diameter = 1e-3,
                    .outer_diameter = 1.5e-3,
                    .length = 0.1,
                    .curved_length = 0.1,
                    .curvature = 12};
  const Joints<1> q{VecN<1>(-0.02), VecN<1>(0)};
  const TipLoad load{};
  IndependentRod<1>::Tip tip{Mat3::Identity(), VecN<1>::Zero()};
  IndependentRod<1>::Miss found;
  EXPECT_LT((IndependentRod<1>(robot, q, load).solve(tip, found)), 1e-9);
  const double angle = 12 * 0.08;
  EXPECT_LT((found.tip - Vec3(0, -(1 - std::cos(angle)) / 12, std::sin(angle) / 12)).norm(), 1e-8);
}

/// An upright rod under its Euler load: stable below, unstable above. F = EI (pi / 2 L)^2.
TEST(Judge, KnowsEulersLoad) {
  Robot<1> robot;
  robot.tubes[0] = {.youngs_modulus = 60e9, .inner_diameter = 1e-3, .outer_diameter = 1.5e-3, .length = 0.2};
  const Joints<1> q{VecN<1>(0), VecN<1>(0)};
  const double euler = robot.tubes[0].EI() * std::pow(std::numbers::pi / 2 / 0.2, 2);
  const IndependentRod<1>::Tip tip{Mat3::Identity(), VecN<1>::Zero()};
  for (const double part : {0.5, 0.95, 1.05, 3.0}) {
    const TipLoad load{{0, 0, -part * euler}, Vec3::Zero()};
    const double determinant = IndependentRod<1>(robot, q, load).smallest_determinant(tip);
    if (part < 1) {
      EXPECT_NEAR(determinant, std::pow(std::cos(std::numbers::pi / 2 * std::sqrt(part)), 2), 1e-4);
    }
    // Both planes buckle at once, so that the determinant touches zero and does not change its sign.
    EXPECT_EQ(determinant > 1e-3, part < 1) << part;
  }
}

template <class T>
struct JudgeOf : testing::Test {};
TYPED_TEST_SUITE(JudgeOf, test::OneToFiveTubes);

TYPED_TEST(JudgeOf, FindsWhatIsSpoilt) {
  constexpr int N = TypeParam::N;
  Random random(N);
  const double accuracy = Settings{}.accuracy;
  int seen = 0;
  for (int k = 0; k < 20; ++k) {
    const test::Case<N> c = test::sane_case<N>(random);
    const Model<N> model(c.robot);
    Workspace<N> ws;
    Solution<N> s;
    if (solve<Derivatives::compliance>(model, c.q, c.load, ws, s) != Status::ok || test::length_of(c) < 0.01) continue;
    ++seen;
    EXPECT_EQ(test::wrong_equilibrium(c, ws, s, accuracy), "");
    bool same_branch = false;
    EXPECT_EQ(test::differs_from_finer_steps(c, model, ws, s, accuracy, same_branch), "");
    EXPECT_TRUE(same_branch);
    EXPECT_TRUE(test::is_defined(s, c));
    Solution<N> off = s;
    off.position += test::length_of(c) * 7e-4 * Vec3(0.6, 0, 0.8);
    EXPECT_NE(test::wrong_equilibrium(c, ws, off, accuracy), "");
    EXPECT_NE(test::differs_from_finer_steps(c, model, ws, off, accuracy, same_branch), "");
    off = s;
    off.tube_tips[N - 1].rotation(1, 1) += 1e-9;
    EXPECT_FALSE(test::is_defined(off, c));
    off = s;
    off.compliance(2, 2) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(test::is_defined(off, c));
  }
  EXPECT_GT(seen, 10);
}

/// Opposed curved tubes in the symmetric equilibrium that no robot keeps: a solver that called it `ok` would be found out.
TEST(Judge, FindsAnUnstableEquilibrium) {
  test::Case<2> c;
  double diameter = 1e-3;
  for (Tube& tube : c.robot.tubes) {
    tube = {.youngs_modulus = 60e9,
            .inner_diameter = diameter,
            .outer_diameter = diameter + 0.3e-3,
            .length = 0.2,
            .curved_length = 0.2,
            .curvature = 15};
    diameter += 0.4e-3;
  }
  c.q.alpha = {0, std::numbers::pi};
  const Model<2> model(c.robot);
  Workspace<2> ws;
  Evaluation<2, Loading::none, Derivatives::none> ev;
  const TipGuess<2> straight = detail::straight_guess(c.q);
  evaluate<Derivatives::none, Loading::none, MagnusRk4>(model.coefficients(), c.q, c.load, straight, Steps<2>(16), ev);
  ASSERT_LT(ev.residual, 1e-3);
  ws.guess = straight;
  Solution<2> s;
  s.position = ev.position;
  s.rotation = ev.rotation;
  EXPECT_EQ(test::wrong_equilibrium(c, ws, s, 1e-4).substr(0, 8), "unstable");
}

}  // namespace judge_test
}  // namespace ctcr
