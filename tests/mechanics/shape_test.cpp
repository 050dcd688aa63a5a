// Laws of the shape: it starts as the joints say, ends at the solved tip, and is in balance everywhere between.
#include "ctcr/mechanics/shape.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "support/random_robots.hpp"
#include "support/solver.hpp"

namespace ctcr {
namespace shape_test {

template <int N>
struct Case {
  Robot<N> robot;
  Joints<N> q;
  TipLoad load;
};

/// Every kind of load in turn: none, force, force and moment, each with and without weight.
template <int N>
Case<N> random_case(test::Random& random, int k) {
  Case<N> c;
  c.robot = test::random_robot<N>(random);
  if (k % 2 == 1) c.robot.gravity = test::random_vector(random, 9.81);
  c.q = test::random_joints(c.robot, random, 0.2);
  if (k % 3 > 0) c.load = test::random_load(random, 0.2, k % 3 > 1 ? 0.01 : 0);
  return c;
}

template <int N>
struct Solved {
  Status status;
  Solution<N> tip;
  std::vector<ShapePoint<N>> points;
};

template <int N>
Solved<N> solve_shape(const Case<N>& c, const std::vector<double>& s, const Settings& settings = {}) {
  Solved<N> r;
  Workspace<N> ws;
  r.points.resize(s.size());
  r.status = shape<N>(Model<N>(c.robot), c.q, c.load, s, r.points, ws, r.tip, settings);
  return r;
}

template <int N>
std::vector<double> places(const Case<N>& c, std::size_t points) {
  std::vector<double> s(points + 2 * N);
  s.resize(shape_arc_lengths(Model<N>(c.robot), c.q, points, s));
  return s;
}

template <class F>
void for_random_cases(const F& f) {
  test::Random random(11);
  for (int k = 0; k < 24; ++k) {
    SCOPED_TRACE(k);
    f(random_case<1>(random, k));
    f(random_case<2>(random, k));
    f(random_case<3>(random, k));
    f(random_case<4>(random, k));
  }
}

TEST(Shape, StartsAsTheJointsSay) {
  for_random_cases([]<int N>(const Case<N>& c) {
    std::vector<double> s{0};
    for (int i = N - 1; i >= 0; --i) s.insert(s.begin(), c.q.beta[i]);
    const Solved<N> r = solve_shape(c, s);
    if (r.status != Status::ok) return;
    EXPECT_LT(r.points.back().bishop.position.norm(), 1e-12);
    EXPECT_LT((r.points.back().bishop.rotation - Mat3::Identity()).norm(), 1e-9);
    for (int i = 0; i < N; ++i) {
      const TubeShape& grasped = r.points[std::size_t(i)].tube[std::size_t(i)];
      EXPECT_TRUE(grasped.present);
      EXPECT_NEAR(std::remainder(grasped.angle - c.q.alpha[i], 2 * std::numbers::pi), 0, 1e-9);
      const TubeShape& plate = r.points.back().tube[std::size_t(i)];
      EXPECT_NEAR(plate.angle - grasped.angle, -c.q.beta[i] * plate.curvature[2], 1e-12);
    }
  });
}

TEST(Shape, EndsAtTheSolvedTips) {
  for_random_cases([]<int N>(const Case<N>& c) {
    std::vector<double> s;
    for (std::size_t i = N; i-- > 0;) s.push_back(c.robot.tubes[i].length + c.q.beta[Eigen::Index(i)]);
    for (std::size_t k = 1; k < N; ++k) s[k] = std::max(s[k], s[k - 1]);  // flush tips differ by rounding
    const Solved<N> r = solve_shape(c, s);
    if (r.status != Status::ok) return;
    for (std::size_t i = 0; i < N; ++i) {
      const ShapePoint<N>& end = r.points[N - 1 - i];
      EXPECT_TRUE(end.tube[i].present);
      EXPECT_LT((end.tube_pose(i).position - r.tip.tube_tips[i].position).norm(), 1e-11);
      EXPECT_LT((end.tube_pose(i).rotation - r.tip.tube_tips[i].rotation).norm(), 1e-9);
      for (std::size_t j = 0; j < N; ++j)
        if (end.s > c.robot.tubes[j].length + c.q.beta[Eigen::Index(j)] + 1e-9) {
          EXPECT_FALSE(end.tube[j].present);
        }
    }
    EXPECT_LT((r.points.back().force - c.load.force).norm(), 1e-9);
    EXPECT_LT((r.points.back().moment - c.load.moment).norm(), 1e-9);
  });
}

TEST(Shape, IsInBalanceEverywhere) {
  for_random_cases([]<int N>(const Case<N>& c) {
    const std::vector<double> s = places(c, 400);
    const Solved<N> r = solve_shape(c, s);
    if (r.status != Status::ok) return;
    // The rod beyond a place carries the tip load and its own weight; trapezoids from the tip towards the plate.
    Vec3 force = c.load.force, moment = c.load.moment;
    for (std::size_t k = s.size() - 1; k-- > 0;) {
      const ShapePoint<N>&here = r.points[k], &next = r.points[k + 1];
      Vec3 weight = Vec3::Zero();
      for (std::size_t i = 0; i < N; ++i)
        if (next.tube[i].present) weight += c.robot.tubes[i].mass_per_length() * (next.s - here.s) * c.robot.gravity;
      const Vec3 arm = next.bishop.position - here.bishop.position;
      moment += arm.cross(force + 0.5 * weight);
      force += weight;
      EXPECT_LT((here.force - force).norm(), 1e-6);
      EXPECT_LT((here.moment - moment).norm(), 1e-6);
    }
    for (const ShapePoint<N>& point : r.points) {
      Vec3 sum = Vec3::Zero();
      for (std::size_t i = 0; i < N; ++i) sum += point.tube_pose(i).rotation * point.tube[i].moment;
      EXPECT_LT((sum - point.moment).norm(), 1e-9);
    }
  });
}

TEST(Shape, FramesTurnWithTheirCurvature) {
  for_random_cases([]<int N>(const Case<N>& c) {
    const std::vector<double> s = places(c, 100);
    std::vector<double> pairs;
    constexpr double h = 1e-4;
    for (std::size_t k = 0; k + 1 < s.size(); ++k)
      if (s[k + 1] - s[k] > 3 * h) pairs.insert(pairs.end(), {s[k] + h, s[k] + 1.5 * h, s[k] + 2 * h});
    const Solved<N> r = solve_shape(c, pairs);
    if (r.status != Status::ok) return;
    for (std::size_t k = 0; k < pairs.size(); k += 3)
      for (std::size_t i = 0; i < N; ++i) {
        const ShapePoint<N>&a = r.points[k], &b = r.points[k + 1], &d = r.points[k + 2];
        ASSERT_EQ(a.tube[i].present, d.tube[i].present);
        if (!a.tube[i].present) continue;
        const Pose step = a.tube_pose(i).inverse() * d.tube_pose(i);
        EXPECT_LT((rotation_vector(step.rotation) / h - b.tube[i].curvature).norm(), 1e-4);
        EXPECT_LT((step.position / h - Vec3::UnitZ()).norm(), 2e-3);
      }
  });
}

TEST(Shape, ObeysTheLawOfEachTube) {
  for_random_cases([]<int N>(const Case<N>& c) {
    const Solved<N> r = solve_shape(c, places(c, 60));
    if (r.status != Status::ok) return;
    for (const ShapePoint<N>& point : r.points)
      for (std::size_t i = 0; i < N; ++i) {
        const Tube& tube = c.robot.tubes[i];
        const double along = point.s - c.q.beta[Eigen::Index(i)], start = tube.length - tube.curved_length;
        EXPECT_EQ(point.tube[i].present, along <= tube.length + 1e-12);
        if (!point.tube[i].present || std::abs(along - start) < 1e-9 || point.s == 0) continue;
        const Vec3 natural = Vec3(along > start ? tube.curvature : 0, 0, 0);
        const Vec3 stiffness(tube.EI(), tube.EI(), tube.GJ());
        const Vec3 strain = point.tube[i].curvature - natural;
        EXPECT_LT((stiffness.cwiseProduct(strain) - point.tube[i].moment).norm(), 1e-12);
      }
  });
}

TEST(Shape, BreakpointsBelongToTheirBaseSide) {
  // One tube alone bends as it is made: straight up to the curved start, that place included.
  Case<1> c;
  c.robot.tubes[0] = test::paper_robot().tubes[0];
  c.q.beta << -0.3;
  c.q.alpha << 0.7;
  const double start = c.robot.tubes[0].length - 0.05 - 0.3, tip = start + 0.05;
  const std::vector<double> s{-0.31, -0.3, -0.1, 0, start, std::nextafter(start, 1) + 1e-9, tip, tip + 1e-3};
  const Solved<1> r = solve_shape(c, s);
  ASSERT_EQ(r.status, Status::ok);
  const bool present[] = {false, true, true, true, true, true, true, false};
  const double bent[] = {0, 0, 0, 0, 0, 10, 10, 0};
  for (std::size_t k = 0; k < s.size(); ++k) {
    EXPECT_EQ(r.points[k].s, s[k]);
    EXPECT_EQ(r.points[k].tube[0].present, present[k]) << k;
    EXPECT_NEAR(r.points[k].tube[0].curvature[0], bent[k], 1e-9) << k;
    if (present[k]) {
      EXPECT_NEAR(r.points[k].tube[0].angle, 0.7, 1e-12) << k;
    }
  }
  EXPECT_NEAR(r.points[0].bishop.position[2], -0.31, 1e-15);
  EXPECT_LT((r.points.back().bishop.position - r.tip.position).norm(), 1e-12);
  EXPECT_NEAR(r.tip.position[2], start + std::sin(0.5) / 10, 1e-9);
  EXPECT_NEAR(r.tip.position.head<2>().norm(), (1 - std::cos(0.5)) / 10, 1e-9);
}

TEST(Shape, IsConverged) {
  for_random_cases([]<int N>(const Case<N>& c) {
    const std::vector<double> s = places(c, 50);
    const Solved<N> usual = solve_shape(c, s), fine = solve_shape(c, s, {.steps = 128});
    if (fine.status != Status::ok || fine.tip.stability < 0.05) return;
    for (std::size_t k = 0; k < s.size(); ++k) {
      EXPECT_LT((usual.points[k].bishop.position - fine.points[k].bishop.position).norm(), 1e-7);
      EXPECT_LT((usual.points[k].moment - fine.points[k].moment).norm(), 1e-7);
    }
  });
}

TEST(Shape, IsDefinedWhereNothingCanBeSolved) {
  Case<2> c;
  test::Random random(1);
  c.robot = test::random_robot<2>(random);
  c.q.beta << 0.1, 0;
  const Solved<2> r = solve_shape(c, {0, 0.1});
  EXPECT_EQ(r.status, Status::joints_out_of_order);
  for (const ShapePoint<2>& point : r.points)
    for (const TubeShape& tube : point.tube) EXPECT_FALSE(tube.present);
  EXPECT_EQ(r.points[1].s, 0.1);
}

TEST(ShapePlaces, AreUniformWithEveryBreakpointOnce) {
  for_random_cases([]<int N>(const Case<N>& c) {
    const std::vector<double> s = places(c, 20);
    for (std::size_t k = 1; k < s.size(); ++k) EXPECT_GT(s[k] - s[k - 1], 1e-12);
    EXPECT_EQ(s.front(), 0);
    EXPECT_NEAR(s.back(), c.robot.tubes[0].length + c.q.beta[0], 1e-12);
    const auto has = [&](double place) {
      return std::any_of(s.begin(), s.end(), [&](double at) { return std::abs(at - place) < 1e-12; });
    };
    for (int k = 0; k < 20; ++k) EXPECT_TRUE(has(k == 19 ? s.back() : s.back() * k / 19));
    for (std::size_t i = 0; i < N; ++i) {
      const Tube& tube = c.robot.tubes[i];
      const double beta = c.q.beta[Eigen::Index(i)], start = tube.length - tube.curved_length + beta;
      if (tube.length + beta > 1e-12) {
        EXPECT_TRUE(has(tube.length + beta));
      }
      if (tube.curvature != 0 && start > 1e-12) {
        EXPECT_TRUE(has(start));
      }
    }
  });
}

TEST(Shape, RefusesPlacesThatAreNone) {
  test::Random random(12);
  const Case<3> c = random_case<3>(random, 2);
  const std::vector<double> good{0, 0.01, 0.02};
  EXPECT_EQ(solve_shape(c, good).status, Status::ok);
  const auto expect_refused = [&](std::vector<double> s, Status expected) {
    const Solved<3> r = solve_shape(c, s);
    EXPECT_EQ(r.status, expected);
    EXPECT_EQ(r.tip.status, expected);
    for (const ShapePoint<3>& p : r.points) {
      EXPECT_TRUE(p.bishop.position.isZero(0) && p.bishop.rotation.isIdentity(0));
      EXPECT_FALSE(p.tube[0].present);
    }
  };
  for (std::size_t k = 0; k < good.size(); ++k)
    for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
      std::vector<double> s = good;
      s[k] = bad;
      expect_refused(s, Status::not_finite);
    }
  expect_refused({0, 0.02, 0.01}, Status::invalid_settings);
  std::vector<ShapePoint<3>> few(2);
  Workspace<3> ws;
  Solution<3> tip;
  EXPECT_EQ(shape<3>(Model<3>(c.robot), c.q, c.load, good, few, ws, tip), Status::invalid_settings);
}

TEST(Shape, OfJointsThatAreNoneHasNoPlaces) {
  test::Random random(13);
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    Case<3> c = random_case<3>(random, 0);
    c.q.beta[1] = bad;
    EXPECT_EQ(places(c, 20).size(), 0u);
  }
}

}  // namespace shape_test
}  // namespace ctcr
