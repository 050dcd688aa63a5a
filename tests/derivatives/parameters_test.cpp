#include "ctcr/derivatives/parameters.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "support/laws.hpp"
#include "support/no_alloc.hpp"

namespace parameters_test {

using namespace ctcr;

/// What acts on the robot: each has equations of its own.
enum class Acting { nothing, force, wrench, weight };

/// A solved case.
template <int N>
struct Solved : test::Case<N> {
  Workspace<N> ws;
  Solution<N> solution;
};

/// @param straight  whether tubes may be straight
template <int N>
Solved<N> random_case(Acting acting, const Settings& settings, bool straight, test::Random& random) {
  const double force = acting == Acting::nothing ? 0 : 0.2, moment = acting == Acting::force ? 0 : force / 40;
  const Vec3 gravity = acting == Acting::weight ? test::tilted_gravity : Vec3::Zero();
  Solved<N> c;
  const auto is_straight = [](const Tube& tube) { return tube.curvature == 0; };
  do {
    static_cast<test::Case<N>&>(c) = test::smooth_case<N>(random, force, moment, gravity);
  } while (!straight && std::ranges::any_of(c.robot.tubes, is_straight));
  for (Tube& tube : c.robot.tubes)
    if (test::chance(random, 0.3)) tube.bending_stiffness = tube.EI();
  EXPECT_EQ(solve<Derivatives::jacobian>(Model<N>(c.robot), c.q, c.load, c.ws, c.solution, settings), Status::ok);
  return c;
}

/// Magnitude of a robot parameter's usual changes, by which its derivative is judged.
template <int N>
double magnitude(const Robot<N>& robot, int index) {
  const auto [kind, i] = ParameterVector<N>::entry(index);
  if (kind == Parameter::gravity) return 10;
  const double value = robot.tubes[std::size_t(i)].*ParameterVector<N>::info(kind).field;
  return kind == Parameter::length || kind == Parameter::curved_length ? 0.1 : value != 0 ? value : 5.0;
}

template <int N>
Robot<N> with_change(Robot<N> robot, int index, double change) {
  const auto [kind, i] = ParameterVector<N>::entry(index);
  if (kind == Parameter::gravity)
    robot.gravity[i] += change;
  else
    robot.tubes[std::size_t(i)].*ParameterVector<N>::info(kind).field += change;
  return robot;
}

template <int N>
Pose solved_tip(const Solved<N>& c, const Robot<N>& robot, const Joints<N>& q, int tube, const Settings& settings) {
  Workspace<N> ws = c.ws;
  Solution<N> solution;
  EXPECT_EQ(solve(Model<N>(robot), q, c.load, ws, solution, settings), Status::ok);
  return solution.tube_tips[std::size_t(tube)];
}

void expect_column(const Vec6& exact, const Vec6& difference, double magnitude, const std::string& what) {
  const double allowed = 1e-6 * (difference.norm() + 1e-2 / magnitude);
  EXPECT_LE((exact - difference).norm(), allowed)
      << what << "\nexact      " << exact.transpose() << "\ndifference " << difference.transpose();
}

template <int N>
void expect_equal_to_differences(Acting acting, const Settings& settings, bool coarse, int cases) {
  test::Random random(std::uint64_t(100 * N + int(acting)));
  constexpr int gravity = ParameterVector<N>::index(Parameter::gravity);
  for (int n = 0; n < cases; ++n) {
    const Solved<N> c = random_case<N>(acting, settings, !coarse, random);
    const int tube = n % N;
    TipDerivatives<N> exact;
    ASSERT_EQ(differentiate_tip(Model<N>(c.robot), c.ws, tube, exact), Status::ok);
    const std::string at = ", tip of tube " + std::to_string(tube + 1) + ", case " + std::to_string(n);
    for (int p = 0; p < ParameterVector<N>::robot_count; ++p) {
      // Weightless robots are integrated without weight: with few steps, that is another discrete model.
      if (coarse && acting != Acting::weight && p >= gravity) continue;
      const Parameter kind = ParameterVector<N>::entry(p).kind;
      if (kind == Parameter::bending_stiffness && c.robot.tubes[std::size_t(p % N)].bending_stiffness == 0) continue;
      const double size = magnitude(c.robot, p);
      const bool length = kind == Parameter::length || kind == Parameter::curved_length;
      const auto pose = [&](double x) { return solved_tip(c, with_change(c.robot, p, x), c.q, tube, settings); };
      expect_column(exact.by_parameters.col(p), test::slope(pose, length ? 1e-5 : 1e-3 * size), size,
                    std::string(ParameterVector<N>::name(p)) + at);
    }
    for (int j = 0; j < 2 * N; ++j) {
      const auto pose = [&](double x) {
        Joints<N> q = c.q;
        (j < N ? q.beta[j] : q.alpha[j - N]) += x;
        return solved_tip(c, c.robot, q, tube, settings);
      };
      expect_column(exact.by_joints.col(j), test::slope(pose, j < N ? 1e-5 : 1e-3), j < N ? 0.1 : 1.0,
                    "joint " + std::to_string(j) + at);
    }
  }
}

constexpr Acting all[] = {Acting::nothing, Acting::force, Acting::wrench, Acting::weight};

TEST(TipDerivatives, AreThoseOfTheDiscreteModel) {
  const Settings settings{.tolerance = 1e-12, .accuracy = test::as_told};
  for (const Acting acting : all) {
    expect_equal_to_differences<1>(acting, settings, true, 10);
    expect_equal_to_differences<2>(acting, settings, true, 20);
    expect_equal_to_differences<3>(acting, settings, true, 30);
  }
}

TEST(TipDerivatives, AreThoseOfTheFineModel) {
  const Settings settings{.tolerance = 1e-12, .steps = 30, .accuracy = test::as_told};
  for (const Acting acting : all) {
    expect_equal_to_differences<1>(acting, settings, false, 4);
    expect_equal_to_differences<2>(acting, settings, false, 4);
    expect_equal_to_differences<3>(acting, settings, false, 6);
  }
}

TEST(TipDerivatives, ByJointsAreTheJacobianOfTheSolution) {
  test::Random random(1);
  const Settings settings{.tolerance = 1e-12, .steps = 30, .accuracy = test::as_told};
  for (const Acting acting : all)
    for (int n = 0; n < 10; ++n) {
      const Solved<3> c = random_case<3>(acting, settings, false, random);
      TipDerivatives<3> exact;
      ASSERT_EQ(differentiate_tip(Model<3>(c.robot), c.ws, 0, exact), Status::ok);
      EXPECT_LE((exact.by_joints - c.solution.jacobian).norm(), 1e-7 * c.solution.jacobian.norm());
      EXPECT_LE((exact.by_joints - c.solution.jacobian).rightCols<3>().norm(), 1e-10 * c.solution.jacobian.norm());
    }
}

/// Sum over the tubes of parameter times derivative: the change when all grow by the same part.
template <int N>
Vec6 all_together(const TipDerivatives<N>& d, const Robot<N>& robot, Parameter kind) {
  Vec6 sum = Vec6::Zero();
  for (int i = 0; i < N; ++i)
    sum += d.by_parameters.col(ParameterVector<N>::index(kind, i)) *
           (robot.tubes[std::size_t(i)].*ParameterVector<N>::info(kind).field);
  return sum;
}

/// Without load only ratios of stiffnesses matter.
TEST(TipDerivatives, StiffnessRatiosMatterUnloaded) {
  test::Random random(2);
  for (int n = 0; n < 50; ++n) {
    Solved<3> c = random_case<3>(Acting::nothing, {}, true, random);
    for (Tube& tube : c.robot.tubes) tube.bending_stiffness = 0;
    TipDerivatives<3> d;
    ASSERT_EQ(differentiate_tip(Model<3>(c.robot), c.ws, 0, d), Status::ok);
    const Vec6 single = d.by_parameters.col(0) * c.robot.tubes[0].youngs_modulus;
    EXPECT_LE(all_together(d, c.robot, Parameter::youngs_modulus).norm(), 1e-12 + 1e-10 * single.norm());
    EXPECT_LE(
        (all_together(d, c.robot, Parameter::inner_diameter) + all_together(d, c.robot, Parameter::outer_diameter))
            .norm(),
        1e-12 + 1e-10 * single.norm());
  }
}

TEST(TipDerivatives, StiffnessLoadAndWeightScaleTogether) {
  test::Random random(3);
  const Settings settings{.tolerance = 1e-13, .accuracy = test::as_told};
  for (int n = 0; n < 50; ++n) {
    Solved<3> c = random_case<3>(Acting::weight, settings, false, random);
    for (Tube& tube : c.robot.tubes) tube.bending_stiffness = 0;
    const Model<3> model(c.robot);
    ASSERT_EQ(solve<Derivatives::compliance>(model, c.q, c.load, c.ws, c.solution, settings), Status::ok);
    TipDerivatives<3> d;
    ASSERT_EQ(differentiate_tip(model, c.ws, 0, d), Status::ok);
    const Vec6 by_weight =
        d.by_parameters.middleCols<3>(ParameterVector<3>::index(Parameter::gravity)) * c.robot.gravity;
    const Vec6 by_load = c.solution.compliance * (Vec6() << c.load.force, c.load.moment).finished();
    const Vec6 by_stiffness = all_together(d, c.robot, Parameter::youngs_modulus);
    EXPECT_LE((by_stiffness + by_load + by_weight).norm(), 1e-9 * by_stiffness.norm());
    EXPECT_LE((all_together(d, c.robot, Parameter::density) - by_weight).norm(), 1e-9 * by_weight.norm());
  }
}

TEST(TipDerivatives, ByLoadsAreTheComplianceOfAnyTube) {
  test::Random random(5);
  const Settings settings{.tolerance = 1e-12, .accuracy = test::as_told};
  for (const Acting acting : all)
    for (int n = 0; n < 12; ++n) {
      Solved<3> c = random_case<3>(acting, settings, false, random);
      const Model<3> model(c.robot);
      ASSERT_EQ(solve<Derivatives::compliance>(model, c.q, c.load, c.ws, c.solution, settings), Status::ok);
      const int tube = n % 3;
      TipDerivatives<3> exact;
      Mat6 compliance;
      ASSERT_EQ(differentiate_tip(model, c.ws, tube, exact, compliance), Status::ok);
      if (tube == 0) {
        EXPECT_LE((compliance - c.solution.compliance).norm(), 1e-9 * compliance.norm());
        EXPECT_LE((exact.by_joints - c.solution.jacobian).rightCols<3>().norm(), 1e-9 * c.solution.jacobian.norm());
      }
      for (int j = 0; j < 6; ++j) {
        const auto pose = [&](double x) {
          TipLoad load = c.load;
          (j < 3 ? load.force[j] : load.moment[j - 3]) += x;
          Workspace<3> ws = c.ws;
          Solution<3> solution;
          EXPECT_EQ(solve<Derivatives::compliance>(model, c.q, load, ws, solution, settings), Status::ok);
          return solution.tube_tips[std::size_t(tube)];
        };
        expect_column(compliance.col(j), test::slope(pose, j < 3 ? 1e-3 : 1e-4), 0.1,
                      "load " + std::to_string(j) + ", tip of tube " + std::to_string(tube + 1));
      }
    }
}

TEST(TipDerivatives, AreZeroWithoutASolutionOrTube) {
  test::Random random(6);
  const auto expect_zero = [](const Model<3>& model, const Workspace<3>& ws, int tube, Status status) {
    TipDerivatives<3> d;
    d.by_joints.setOnes();
    Mat6 compliance = Mat6::Ones();
    EXPECT_EQ(differentiate_tip(model, ws, tube, d), status);
    EXPECT_TRUE(d.by_joints.isZero(0) && d.by_parameters.isZero(0));
    d.by_joints.setOnes();
    EXPECT_EQ(differentiate_tip(model, ws, tube, d, compliance), status);
    EXPECT_TRUE(d.by_joints.isZero(0) && d.by_parameters.isZero(0) && compliance.isZero(0));
  };
  expect_zero(Model<3>(test::paper_robot()), {}, 0, Status::not_converged);
  for (const Acting acting : all) {
    const Solved<3> c = random_case<3>(acting, {}, true, random);
    for (const int tube : {-1, 3}) expect_zero(Model<3>(c.robot), c.ws, tube, Status::invalid_settings);
  }
}

TEST(TipDerivatives, DoNotTouchTheHeap) {
  test::Random random(4);
  for (const Acting acting : all) {
    const Solved<3> c = random_case<3>(acting, {}, true, random);
    const Model<3> model(c.robot);
    TipDerivatives<3> d;
    Mat6 compliance;
    const test::HeapGuard guard;
    (void)differentiate_tip(model, c.ws, 1, d);
    (void)differentiate_tip(model, c.ws, 1, d, compliance);
    EXPECT_EQ(guard.uses(), 0);
  }
}

}  // namespace parameters_test
