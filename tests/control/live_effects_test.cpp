// Effects that follow a motion period by period are those of the recorded rows.
#include "ctcr/control/live_effects.hpp"

#include <gtest/gtest.h>

#include "ctcr/effects/backlash_rotation.hpp"
#include "ctcr/effects/delay.hpp"
#include "ctcr/effects/friction.hpp"
#include "random_control.hpp"

namespace ctcr {
namespace live_effects_test {

using Path3 = EffectList<Friction, BacklashRotation, Delay>;

TEST(LiveEffects, RememberWhatRecordedRowsDo) {
  test::Random random(41);
  Path3::On<3> effects;
  std::get<0>(effects.list).values = {0.03, 0.02, 0.05, 0.008, 0.3, 0.4};
  std::get<1>(effects.list).values = {0.01, 0.02, 0.015};
  std::get<2>(effects.list).values = {0.06};
  const System<3, Path3> system{{1, 1, Vec3::Zero(), Vec3::Zero()}, Model<3, Path3>(test::paper_robot(), effects), {}};
  std::vector<RecordedRow<3>> rows;
  Joints<3> q{{-0.3, -0.2, -0.1}, Vec3::Zero()};
  for (int k = 0; k < 200; ++k) {
    for (int i = 0; i < 3; ++i) {
      q.beta[i] += test::uniform(random, -1e-3, 1e-3);
      q.alpha[i] += test::uniform(random, -0.05, 0.05);
    }
    rows.push_back({{q.beta, q.alpha}, {}, {.time = 0.025 * k}});
  }
  const auto recorded = memories(system, std::span<const RecordedRow<3>>(rows));
  LiveEffects<3, Path3> live(effects);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    (void)live.advance({rows[k].theta.translation, rows[k].theta.rotation}, rows[k].at.time);
    const auto check = [&]<std::size_t I>(std::integral_constant<std::size_t, I>) {
      const auto& now = std::get<I>(live.effects().list).past.state;
      const auto& then = std::get<I>(recorded[k]).state;
      for (std::size_t i = 0; i < now.size(); ++i)
        EXPECT_NEAR(now[i], then[i], 1e-12) << "effect " << I << " row " << k;
    };
    check(std::integral_constant<std::size_t, 0>{});
    check(std::integral_constant<std::size_t, 1>{});
    check(std::integral_constant<std::size_t, 2>{});
  }
}

}  // namespace live_effects_test
}  // namespace ctcr
