// Effects at neutral values change nothing, and no effects cost nothing.
#include <gtest/gtest.h>

#include <algorithm>
#include <type_traits>

#include "support/catalogue_cases.hpp"

namespace ctcr {
namespace neutral_test {

using test::Random;

static_assert(std::is_same_v<Model<3>, Model<3, EffectList<>>>);
static_assert(std::is_same_v<Model<3>::Numbers, Coefficients<3>>);
static_assert(std::is_empty_v<Standard::On<3>> && Standard::On<3>::count == 0);
struct Parts {
  Robot<3> robot;
  Coefficients<3> coefficients;
  Status check;
};
static_assert(sizeof(Model<3>) == sizeof(Parts));
static_assert(std::is_trivially_destructible_v<Model<3, Catalogue>>);

// Effects of a list by their ids, in the order of the list.
using SofteningAndFriction =
    Catalogue::Those<[](std::string_view id) { return id == softening::info.id || id == friction::info.id; }>;
static_assert(std::is_same_v<SofteningAndFriction, EffectList<Friction, Softening>>);
static_assert(std::is_same_v<Catalogue::Those<[](std::string_view) { return false; }>, Standard>);

template <class T>
struct NeutralEffects : testing::Test {};
using EffectTubeCounts = testing::Types<test::TubeCount<1>, test::TubeCount<2>, test::TubeCount<3>>;
TYPED_TEST_SUITE(NeutralEffects, EffectTubeCounts);

TYPED_TEST(NeutralEffects, GiveTheStandardModel) {
  constexpr int N = TypeParam::N;
  Random random(7 + N);
  const Settings settings{.tolerance = 1e-12, .steps = 4, .accuracy = test::as_told};
  int compared = 0;
  for (int n = 0; n < test::cases(60); ++n) {
    Robot<N> robot = test::random_robot<N>(random);
    if (n % 3 > 0) robot.gravity = test::tilted_gravity;
    // With effects a curve of no curvature is a segment of its own, which integrates a little better.
    for (Tube& tube : robot.tubes)
      if (tube.curvature == 0) tube.curved_length = 0;
    const Joints<N> q = test::random_joints(robot, random, n % 4 == 0 ? 0.2 : 0);
    const TipLoad load = test::random_load(random, 0.1, n % 2 == 0 ? 0.002 : 0);
    Workspace<N> ws, general_ws;
    Solution<N> plain, general;
    const Model<N> standard(robot);
    const Model<N, Catalogue> model(robot, test::hardly_any_effects<N>());
    ASSERT_TRUE(model.coefficients().on_rod);
    if (solve<Derivatives::compliance>(standard, q, load, ws, plain, settings) != Status::ok) continue;
    // From the same equilibrium: a robot that can snap has several.
    general_ws.guess = ws.guess;
    general_ws.guess.rotation = plain.rotation;
    general_ws.warm = true;
    ASSERT_EQ(solve<Derivatives::compliance>(model, q, load, general_ws, general, settings), Status::ok) << n;
    if (plain.stability < 0.1) continue;
    ++compared;
    EXPECT_LE((general.position - plain.position).norm(), 1e-12) << n;
    EXPECT_LE((general.rotation - plain.rotation).norm(), 1e-11) << n;
    for (std::size_t i = 0; i < N; ++i)
      EXPECT_LE((general.tube_tips[i].position - plain.tube_tips[i].position).norm(), 1e-12) << n;
    EXPECT_NEAR(general.stability, plain.stability, 1e-9);
    EXPECT_LE((general.compliance - plain.compliance).norm(), 1e-9 * plain.compliance.norm()) << n;
    const auto error = (general.jacobian - plain.jacobian).eval();
    EXPECT_LE(error.template rightCols<2 * N - 1>().norm(), 1e-9 * plain.jacobian.norm()) << n;
    if (test::smallest_gap(robot, q) < 1e-9) continue;  // where tubes are flush, each path has the slope of one side
    EXPECT_LE(error.col(0).norm(), 1e-9 * plain.jacobian.norm()) << n;
  }
  EXPECT_GT(compared, test::cases(60) / 2);
}

TYPED_TEST(NeutralEffects, GiveTheStandardModelWithoutLoad) {
  constexpr int N = TypeParam::N;
  Random random(17 + N);
  const Settings settings{
      .tolerance = 1e-12, .steps = 32, .accuracy = test::as_told};  // the standard model has another scheme there
  for (int n = 0; n < test::cases(10); ++n) {
    const auto c = test::smooth_case<N>(random, 0, 0, Vec3::Zero());
    Workspace<N> ws;
    Solution<N> general;
    ASSERT_EQ(solve(Model<N, Catalogue>(c.robot, test::hardly_any_effects<N>()), c.q, {}, ws, general, settings),
              Status::ok);
    const Solution<N> plain = test::solved<Derivatives::none>(c.robot, c.q, {}, settings.steps);
    EXPECT_LE((general.position - plain.position).norm(), 1e-9) << n;
    EXPECT_LE((general.rotation - plain.rotation).norm(), 1e-8) << n;
  }
}

/// Where no effect changes the rod.
TYPED_TEST(NeutralEffects, TakeTheFastPath) {
  constexpr int N = TypeParam::N;
  Random random(23 + N);
  const auto c = test::smooth_case<N>(random, 0.1, 0.002, test::tilted_gravity);
  Catalogue::On<N> effects;
  EXPECT_FALSE((Model<N, Catalogue>(c.robot, effects).coefficients().on_rod));
  test::effect<SensorOffset>(effects).values[0] = 1e-3;
  test::effect<BacklashRotation>(effects).values[0] = 1e-3;
  const Model<N, Catalogue> model(c.robot, effects);
  EXPECT_FALSE(model.coefficients().on_rod);
  Workspace<N> ws, plain_ws;
  Solution<N> general, plain;
  ASSERT_EQ(solve(model, c.q, c.load, ws, general), Status::ok);
  ASSERT_EQ(solve(Model<N>(c.robot), c.q, c.load, plain_ws, plain), Status::ok);
  EXPECT_LE((general.position - plain.position).norm(), 1e-12);
  EXPECT_LE((general.rotation - plain.rotation).norm(), 1e-11);
}

TYPED_TEST(NeutralEffects, HaveExactDerivativesByJointsAndLoad) {
  constexpr int N = TypeParam::N;
  Random random(27 + N);
  const Settings settings{
      .tolerance = 1e-12, .steps = 4, .accuracy = test::as_told};  // as many wherever the joints are
  for (int n = 0; n < test::cases(8); ++n) {
    auto c = test::smooth_case<N>(random, 0.1, 0.002, test::tilted_gravity);
    const bool neutral = n % 2 == 0;
    const Model<N, Catalogue> model(c.robot, neutral ? test::hardly_any_effects<N>() : test::random_effects<N>(random));
    Workspace<N> ws;
    Solution<N> exact;
    ASSERT_EQ(solve<Derivatives::compliance>(model, c.q, c.load, ws, exact, settings), Status::ok);
    const auto pose = [&](const Joints<N>& q, const TipLoad& load) {
      Workspace<N> from = ws;
      Solution<N> s;
      EXPECT_EQ(solve(model, q, load, from, s, settings), Status::ok);
      return s.pose();
    };
    for (int j = 0; j < 2 * N; ++j) {
      const auto moved = [&](double x) {
        Joints<N> q = c.q;
        (j < N ? q.beta[j] : q.alpha[j - N]) += x;
        return pose(q, c.load);
      };
      const Vec6 slope = test::slope(moved, j < N ? 1e-4 : 3e-3);
      EXPECT_LE((exact.jacobian.col(j) - slope).norm(), 1e-7 * (1 + slope.norm())) << "joint " << j << ", case " << n;
    }
    for (int j = 0; j < 6; ++j) {
      const auto loaded = [&](double x) {
        TipLoad load = c.load;
        (j < 3 ? load.force[j] : load.moment[j - 3]) += x;
        return pose(c.q, load);
      };
      const Vec6 slope = test::slope(loaded, j < 3 ? 3e-4 : 3e-5);
      EXPECT_LE((exact.compliance.col(j) - slope).norm(), 1e-7 * (1 + slope.norm())) << "load " << j << ", case " << n;
    }
  }
}

/// Variants and starting values name parameters of their effect: variants in order, starts of details, shapes and choices.
TEST(Catalogue, DescribesItsParameters) {
  Catalogue::On<2>{}.for_each([](const auto& effect, int) {
    const auto& list = effect.parameters;
    const auto find = [&](std::string_view name) {
      const auto at = std::ranges::find(list, name, &EffectParameter::name);
      EXPECT_NE(at, list.end()) << effect.info.id << ": " << name;
      return at;
    };
    for (const Variant& variant : effect.info.variants) {
      if (variant.first.empty()) continue;
      EXPECT_LE(find(variant.first), find(variant.last)) << effect.info.id;
    }
    for (const auto& start : effect.info.starts)
      for (const StartValue& one : start) {
        if (one.parameter.empty()) continue;
        const EffectParameter& parameter = *find(one.parameter);
        EXPECT_NE(parameter.role, Role::amplitude);
        EXPECT_NE(parameter.neutral, one.value);
        EXPECT_TRUE(one.value >= parameter.soft.low && one.value <= parameter.soft.high);
      }
  });
}

}  // namespace neutral_test
}  // namespace ctcr
