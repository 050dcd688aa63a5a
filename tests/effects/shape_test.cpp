// The shape of a robot with effects.
#include <gtest/gtest.h>

#include "support/catalogue_cases.hpp"

namespace ctcr {
namespace shape_test {

using test::Random;

constexpr int N = 2;

template <class Model>
std::vector<ShapePoint<N>> shape_of(const Model& model, const test::Case<N>& c, Solution<N>& tip) {
  std::array<double, 30> s;
  const std::size_t count = shape_arc_lengths(model, c.q, 20, s);
  std::vector<double> at{c.q.beta[0], c.q.beta[1] / 2};
  at.insert(at.end(), s.begin(), s.begin() + std::ptrdiff_t(count));
  std::vector<ShapePoint<N>> points(at.size());
  Workspace<N> ws;
  EXPECT_EQ(shape<N>(model, c.q, c.load, at, points, ws, tip, {.tolerance = 1e-12, .steps = 32}), Status::ok);
  return points;
}

TEST(ShapeWithEffects, IsTheStandardShapeWhereTheyAreNeutral) {
  Random random(1);
  for (int n = 0; n < test::cases(8); ++n) {
    const auto c = test::smooth_case<N>(random, 0.1, 0.002, n % 2 == 0 ? test::tilted_gravity : Vec3(Vec3::Zero()));
    // Where the curve of a straight tube starts is a breakpoint for effects alone.
    if (c.robot.tubes[0].curvature == 0 || c.robot.tubes[1].curvature == 0) continue;
    Solution<N> tip, general_tip;
    const auto plain = shape_of(Model<N>(c.robot), c, tip);
    const auto general = shape_of(Model<N, Catalogue>(c.robot), c, general_tip);
    ASSERT_EQ(plain.size(), general.size());
    for (std::size_t k = 0; k < plain.size(); ++k) {
      EXPECT_LE((plain[k].bishop.position - general[k].bishop.position).norm(), 1e-10);
      EXPECT_LE((plain[k].bishop.rotation - general[k].bishop.rotation).norm(), 1e-9);
      EXPECT_LE((plain[k].moment - general[k].moment).norm(), 1e-10);
      EXPECT_LE((plain[k].force - general[k].force).norm(), 1e-10);
      for (std::size_t i = 0; i < N; ++i) {
        const TubeShape &a = plain[k].tube[i], &b = general[k].tube[i];
        EXPECT_EQ(a.present, b.present);
        EXPECT_NEAR(a.angle, b.angle, 1e-9);
        EXPECT_LE((a.curvature - b.curvature).norm(), 1e-7);
        EXPECT_LE((a.moment - b.moment).norm(), 1e-10);
      }
    }
  }
}

TEST(ShapeWithEffects, CarriesTheLoadFromTheTipToTheBase) {
  Random random(2);
  for (int n = 0; n < test::cases(8); ++n) {
    const auto c = test::smooth_case<N>(random, 0.1, 0.002, Vec3::Zero());
    auto effects = test::random_effects<N>(random);
    for (double& h : test::effect<Friction, N>(effects).history.state) h = test::uniform(random, -1, 1);
    Solution<N> tip;
    const auto points = shape_of(Model<N, Catalogue>(c.robot, effects), c, tip);
    const auto& extra = test::effect<TipWeight, N>(effects).values;
    const Vec3 force = c.load.force + Vec3(extra[1], extra[2], extra[3]);
    EXPECT_LE((points.back().bishop.position - tip.position).norm(), 1e-12);
    EXPECT_LE((points.back().tube_pose(0).rotation - tip.rotation).norm(), 1e-12);
    for (const ShapePoint<N>& p : points) {
      if (p.s < 0) continue;
      const Vec3 moment = c.load.moment + (tip.position - p.bishop.position).cross(force);
      EXPECT_LE((p.force - force).norm(), 1e-9) << n;
      EXPECT_LE((p.moment - moment).norm(), 1e-6) << n << ", s = " << p.s;  // torque through a kink: to its third power
      Vec3 bending = Vec3::Zero();
      for (std::size_t i = 0; i < N; ++i) bending += p.tube_pose(i).rotation * p.tube[i].moment;
      EXPECT_LE((bending - p.moment).norm(), 1e-12) << n;
    }
    // Behind the plate a tube twists by its torque alone, up to what its drive gives way.
    const double compliance = test::effect<TorsionalCompliance, N>(effects).values[0];
    const TubeShape& grasped = points[0].tube[0];
    EXPECT_NEAR(grasped.angle - compliance * grasped.moment.z(), c.q.alpha[0], 1e-9);
  }
}

}  // namespace shape_test
}  // namespace ctcr
