// Whatever the robot, the joints and the load: outputs are defined, and an invalid robot is never `ok`.
#include "support/defined_outputs.hpp"

#include <gtest/gtest.h>

#include "support/garbage.hpp"
#include "support/laws.hpp"
#include "support/robot_text.hpp"

namespace ctcr {
namespace defined_outputs_test {

using test::chance, test::is_defined, test::spoil_each, test::uniform;

template <int N>
test::Case<N> random_case(double flush, test::Random& random) {
  test::Case<N> c{test::random_robot<N>(random), {}, {}};
  if (chance(random, 0.3)) c.robot.gravity = test::tilted_gravity;
  if (chance(random, 0.3))  // nested exactly
    for (std::size_t i = 1; i < N; ++i) c.robot.tubes[i].inner_diameter = c.robot.tubes[i - 1].outer_diameter;
  c.q = test::random_joints(c.robot, random, flush);
  if (chance(random, 0.6)) c.load = test::random_load(random, 0.3, chance(random, 0.5) ? 0.005 : 0);
  return c;
}

/// A case as text to paste, below the status.
template <int N>
std::string text(const test::Case<N>& c, Status status) {
  return std::string(to_string(status)) + "\n" + test::text(c);
}

template <int N>
std::string distances(const Solution<N>& s) {
  std::string all;
  for (const Pose& tip : s.tube_tips) all += " " + std::to_string(tip.position.norm());
  return all;
}

/// What no robot is without, said once more and simply.
template <int N>
bool can_exist(const Robot<N>& robot) {
  bool possible = robot.gravity.allFinite();
  for (const Tube& t : robot.tubes)
    possible = possible && t.EI() > 0 && t.GJ() > 0 && std::isfinite(t.EI() + t.GJ() + t.density + t.curvature) &&
               t.density >= 0 && t.length > 0 && t.curved_length >= 0 && t.inner_diameter >= 0 &&
               std::isfinite(t.length + t.youngs_modulus + t.outer_diameter) && t.poisson_ratio <= 0.5;
  return possible;
}

/// Solves from cold, then steps to the joints and to joints near by.
template <Derivatives D, int N>
void expect_defined(test::Case<N> c, test::Random& random, const Settings& settings = {.max_iterations = 8}) {
  const Model<N> model(c.robot);
  Workspace<N> ws;
  Solution<N> s;
  const auto expect = [&](Status status) {
    EXPECT_EQ(s.status, status);
    EXPECT_TRUE(is_defined(s, c)) << text(c, status) << "distances of the tips:" << distances(s);
    EXPECT_EQ(status == Status::invalid_robot, model.check() != Status::ok) << text(c, status);
    EXPECT_TRUE(!has_equilibrium(status) || can_exist(c.robot)) << text(c, status);
  };
  expect(solve<D>(model, c.q, c.load, ws, s, settings));
  expect(step<D>(model, c.q, c.load, ws, s, settings));
  c.q.alpha[0] += uniform(random, -0.1, 0.1);
  c.q.alpha[N - 1] += uniform(random, -0.1, 0.1);
  expect(step<D>(model, c.q, c.load, ws, s, settings));
}

template <int N>
void expect_defined_by_all(const test::Case<N>& c, int n, test::Random& random) {
  if (N < 5 && n % 3 == 0)  // those of 5 tubes are not compiled for other tests
    expect_defined < N<5 ? Derivatives::none : Derivatives::compliance>(c, random);
  else if (N < 5 && n % 3 == 1)
    expect_defined < N<5 ? Derivatives::jacobian : Derivatives::compliance>(c, random);
  else
    expect_defined<Derivatives::compliance>(c, random);
}

template <class T>
struct DefinedOutputs : testing::Test {};
TYPED_TEST_SUITE(DefinedOutputs, test::OneToFiveTubes);

TYPED_TEST(DefinedOutputs, OfGarbageRobots) {
  constexpr int N = TypeParam::N;
  test::Random random(100 + N);
  for (int n = 0; n < test::cases(3000) && !this->HasFailure(); ++n) {
    test::Case<N> c = random_case<N>(0.3, random);
    const double p = n % 2 == 0 ? 0.1 / N : 0.02 / N;
    test::spoil_tubes(c.robot, p, random);
    spoil_each(c.robot.gravity, p, random);
    expect_defined_by_all(c, n, random);
  }
}

TYPED_TEST(DefinedOutputs, OfGarbageJointsAndLoads) {
  constexpr int N = TypeParam::N;
  test::Random random(200 + N);
  for (int n = 0; n < test::cases(3000) && !this->HasFailure(); ++n) {
    test::Case<N> c = random_case<N>(0.3, random);
    const double p = n % 2 == 0 ? 0.1 / N : 0;
    spoil_each(c.q.beta, p, random);
    spoil_each(c.q.alpha, 2 * p, random);
    spoil_each(c.load.force, p, random);
    spoil_each(c.load.moment, p, random);
    expect_defined_by_all(c, n, random);
  }
}

TYPED_TEST(DefinedOutputs, WithGarbageSettings) {
  constexpr int N = TypeParam::N;
  constexpr double none = std::numeric_limits<double>::quiet_NaN(), any = std::numeric_limits<double>::infinity();
  test::Random random(250 + N);
  const auto one_of = [&](auto... choices) {
    return std::array{choices...}[std::uniform_int_distribution<std::size_t>(0, sizeof...(choices) - 1)(random)];
  };
  for (int n = 0; n < test::cases(1000) && !this->HasFailure(); ++n) {
    const Settings settings{.max_iterations = one_of(-1, 0, 1, 8),
                            .tolerance = one_of(1e-10, 0.0, -1.0, none),
                            .steps = one_of(-2, 0, 1),
                            .accuracy = one_of(1e-4, 0.0, -1.0, none, any),
                            .max_steps = one_of(-1, 0, 1, 64),
                            .evaluations = one_of(-1, 0, 1, 2)};
    expect_defined<Derivatives::compliance>(random_case<N>(0.3, random), random, settings);
  }
}

TYPED_TEST(DefinedOutputs, OfAllTubesFlush) {
  constexpr int N = TypeParam::N;
  test::Random random(300 + N);
  for (int n = 0; n < test::cases(300) && !this->HasFailure(); ++n) {
    test::Case<N> c = random_case<N>(1, random);
    for (Tube& t : c.robot.tubes) t.curved_length = chance(random, 0.5) ? t.length : 0;
    EXPECT_EQ(check_robot(c.robot), Status::ok) << text(c, Status::ok);
    expect_defined_by_all(c, n, random);
  }
}

TEST(DefinedOutputs, StayRotationsOnALongWalk) {
  test::Case<2> c{{{test::paper_robot().tubes[0], test::paper_robot().tubes[1]}, test::tilted_gravity},
                  {{-0.3, -0.2}, {0.1, 1.2}},
                  {.force = {0.05, 0, 0}}};
  const Model<2> model(c.robot);
  Workspace<2> ws;
  Solution<2> s;
  for (int n = 0; n < test::cases(30000); ++n) {
    c.q.alpha[0] += 1e-3;
    c.q.alpha[1] = 1.2 + std::sin(1e-3 * n);
    (void)step<Derivatives::jacobian>(model, c.q, c.load, ws, s);
    ASSERT_TRUE(is_defined(s, c)) << text(c, s.status);
  }
}

/// Cases from random attacks: NaN in the tips of the outer tubes; a frame that is no rotation.
TEST(DefinedOutputs, WhereTheyWereNot) {
  test::Random random(1);
  test::Case<2> c;
  c.robot.tubes = {Tube{1018046028.7389276, 0.28914660075690324, 1326.2519132087375, 0, 0.00050584225523716631,
                        1.3187341113273943, 0.9516379485325106, -34.412071478973402},
                   Tube{32957407891.207851, 0.046901815248815142, 0, 5e-324, 0.00127333537048443, 1.3187300203896204,
                        0.050638172708339702, 0}};
  c.q = {{-3.3977127547017642e-06, 0}, {-2.6205950655309636, 1e300}};
  expect_defined<Derivatives::compliance>(c, random);
  c.robot.tubes = {Tube{33854200790.863365, 0.091194757310242541, 10089.335001465179, 0.00020488663129567653,
                        0.00024623911541570091, 0.11180352921235995, 0.11180352921235995, 15.565523289049617},
                   Tube{1655975719.1168399, 0.5, 3953.9067079524398, 0.00024623911541570091, 0.00031033236795987294,
                        0.10568751663103923, 0.053208269099621446, 2.9623449124751011}};
  c.q = {{-0.040168774868797663, -0.034052762287476945}, {-9.5876702643149851, 4.9699148276317047}};
  c.load = {{-0.10722869887185266, -0.15829015863506074, 0.19499801907689895}, Vec3::Zero()};
  expect_defined<Derivatives::none>(c, random);
  expect_defined<Derivatives::compliance>(c, random);
}

}  // namespace defined_outputs_test
}  // namespace ctcr
