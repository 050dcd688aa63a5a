#include "ctcr/friction/frictionless_torsion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "ctcr/mechanics/shape.hpp"
#include "support/walk.hpp"

namespace ctcr {
namespace frictionless_torsion_test {

using test::at, test::two_tubes;

/// Angles between the tubes at the contacts, against shape(); samples without an equilibrium take those of the one before.
TEST(FrictionlessTorsion, Torsion) {
  const System<2> system{{1, 1, VecN<2>::Zero(), VecN<2>::Zero()}, Model<2>(two_tubes()), {}, {.tolerance = 1e-12}};
  std::vector<RecordedRow<2>> rows;
  for (int k = 0; k <= 30; ++k) rows.push_back({{at(0, 0).beta, at(0.4 * k, 0.05 * k).alpha}, {}, {}});
  rows[0].theta.translation[0] = -1;  // unsolvable
  rows[20].theta.translation[0] = -1;
  set_frictionless_torsion<2>(system, rows);
  EXPECT_EQ(rows[0].torsion.back(), rows[1].torsion.front());
  EXPECT_EQ(rows[20].torsion.back(), rows[20].torsion[rows[20].torsion.size() - 2]);
  Workspace<2> ws;
  Solution<2> solution;
  double largest = 0;
  for (const RecordedRow<2>& row : rows) {
    if (row.theta.translation[0] == -1) continue;
    const Robot<2>& robot = two_tubes();
    const VecN<2>& beta = row.theta.translation;
    const double end = robot.tubes[1].length + beta[1] - 1e-9;  // where the outer tube ends, the last contact is
    for (int breakpoint = 0; breakpoint < Contacts<2>::breakpoints; ++breakpoint) {
      const Tube& tube = robot.tubes[std::size_t(breakpoint % 2)];
      double s = tube.length + beta[breakpoint % 2] - (breakpoint < 2 ? 0 : tube.curved_length);
      if (breakpoint == Contacts<2>::plate) s = 0;
      std::array<ShapePoint<2>, 1> here;
      ASSERT_EQ(shape<2>(system.model, {beta, row.theta.rotation}, {}, std::array{std::clamp(s, 0.0, end)}, here, ws,
                         solution),
                Status::ok);
      const double turned = here[0].tube[0].angle - here[0].tube[1].angle;
      const double at_base = row.theta.rotation[0] - row.theta.rotation[1];
      const double torsion = row.torsion.back()[Contacts<2>::index(0, breakpoint)];
      EXPECT_NEAR(std::remainder(torsion - (turned - at_base), 2 * std::numbers::pi), 0, 1e-5) << breakpoint;
      largest = std::max(largest, std::abs(torsion));
    }
  }
  EXPECT_GT(largest, 0.2);
}

/// Jumps of the moment of the inner tube at the contacts, against shape().
TEST(FrictionlessTorsion, MomentJumps) {
  const System<2> system{{1, 1, VecN<2>::Zero(), VecN<2>::Zero()}, Model<2>(two_tubes()), {}, {.tolerance = 1e-12}};
  std::vector<RecordedRow<2>> rows;
  for (int k = 0; k < 10; ++k) rows.push_back({{at(0, 0).beta, at(0.6 * k, -0.1 * k).alpha}, {}, {}});
  set_frictionless_torsion<2>(system, rows);
  const Robot<2>& robot = two_tubes();
  Workspace<2> ws;
  Solution<2> solution;
  for (const RecordedRow<2>& row : rows) {
    const VecN<2>& beta = row.theta.translation;
    const auto inner_moment = [&](double s) {  // of the inner tube, base frame
      std::array<ShapePoint<2>, 1> here;
      EXPECT_EQ(shape<2>(system.model, {beta, row.theta.rotation}, {}, std::array{s}, here, ws, solution), Status::ok);
      const TubeShape& tube = here[0].tube[0];
      return Vec3(here[0].bishop.rotation * rotation_z(tube.angle) * Vec3(tube.moment.x(), tube.moment.y(), 0));
    };
    const MomentJumps<2>& jumps = row.jumps.back();
    for (const int breakpoint : {1, 2, 3}) {
      const Tube& tube = robot.tubes[std::size_t(breakpoint % 2)];
      const double s = tube.length + beta[breakpoint % 2] - (breakpoint < 2 ? 0 : tube.curved_length);
      const bool is_met = s > 0 && s <= robot.tubes[1].length + beta[1];
      const double jump = is_met ? (inner_moment(s + 1e-7) - inner_moment(s - 1e-7)).norm() : 0;
      EXPECT_NEAR(jumps[Contacts<2>::index(0, breakpoint)], jump, 1e-5 * MomentJumps<2>::usual) << breakpoint;
    }
    EXPECT_NEAR(jumps[Contacts<2>::index(0, Contacts<2>::plate)], inner_moment(1e-7).norm(), 1e-6);  // straight behind
  }
  EXPECT_GT(rows[3].jumps.back()[Contacts<2>::index(0, 1)], 0.01);
}

}  // namespace frictionless_torsion_test
}  // namespace ctcr
