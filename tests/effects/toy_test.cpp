// A user's own effect, by the robot that it amounts to.
#include <gtest/gtest.h>

#include "support/laws.hpp"

namespace ctcr {
namespace toy_test {

namespace stronger {
constexpr EffectInfo info{.id = "stronger", .title = "Toy"};
inline constexpr std::array parameters{
    EffectParameter{.name = "curvature", .neutral = 1, .per_tube = true},
    EffectParameter{.name = "stiffness", .neutral = 1, .per_tube = true},
};
}  // namespace stronger

/// More or less curved, and more or less stiff against bending.
template <int N, class P = double>
struct Stronger : EffectValues<stronger::parameters, N, P> {
  static constexpr const EffectInfo& info = stronger::info;
  void material(const TubePoint<P>& place, Material<P>& m) const noexcept {
    m.curvature[0] = m.curvature[0] * this->template get<0>(place.tube);
    m.bending_stiffness = m.bending_stiffness * this->template get<1>(place.tube);
  }
};

using Toys = EffectList<Stronger>;

TEST(ToyEffect, EqualsTheRobotThatItAmountsTo) {
  test::Random random(1);
  for (int n = 0; n < test::cases(20); ++n) {
    auto [robot, q, load] =
        test::smooth_case<2>(random, 0.1, 0.002, n % 2 == 0 ? Vec3(Vec3::Zero()) : test::tilted_gravity);
    for (Tube& tube : robot.tubes)  // with effects a curve of no curvature is a segment of its own
      if (tube.curvature == 0) tube.curved_length = 0;
    Toys::On<2> toys;
    std::get<0>(toys.list).values = {1.1, 0.8, 0.9, 1.3};
    Robot<2> other = robot;
    for (std::size_t i = 0; i < 2; ++i) {
      Tube& tube = other.tubes[i];
      const double GJ = tube.GJ();
      tube.curvature *= std::get<0>(toys.list).values[i];
      tube.bending_stiffness = tube.EI() * std::get<0>(toys.list).values[2 + i];
      tube.poisson_ratio = tube.EI() / GJ - 1;  // torsion as before
    }
    const Settings settings{.tolerance = 1e-12, .steps = 2, .accuracy = test::as_told};
    Workspace<2> ws;
    Solution<2> with_toys;
    ASSERT_EQ(solve(Model<2, Toys>(robot, toys), q, load, ws, with_toys, settings), Status::ok);
    const Solution<2> expected = test::solved<Derivatives::none>(other, q, load, 2);
    if (expected.stability < 0.2) continue;
    EXPECT_LE((with_toys.position - expected.position).norm(), 1e-10) << n;
    EXPECT_LE((with_toys.rotation - expected.rotation).norm(), 1e-9) << n;
  }
}

}  // namespace toy_test
}  // namespace ctcr
