// Random robots against the judge: `ok` is an equilibrium, stable and accurate, and outputs are defined whatever is asked.
#include "robustness/attack.hpp"

#include <gtest/gtest.h>

#include <iostream>

#include "support/catalogue_cases.hpp"

namespace ctcr {
namespace attack_test {

template <class T>
struct RandomRobots : testing::Test {};
TYPED_TEST_SUITE(RandomRobots, test::OneToFiveTubes);

constexpr unsigned seed = 20261126;

/// @param draw   the next case   @param model_of  its model; `known`: as Attacker::at() takes it
template <int N, class Draw, class ModelOf>
test::Tally attack(const char* name, int cases, const Draw& draw, const ModelOf& model_of, bool known = true) {
  test::Random random(seed + unsigned(N));
  test::Tally tally;
  const test::Attack how;
  test::Attacker<N> attacker(how, random, tally);
  for (int k = 0; k < test::cases(cases); ++k) {
    const test::Case<N> c = draw(random);
    attacker.at(c, model_of(c.robot, random), known,
                std::string(name) + ", N = " + std::to_string(N) + ", seed " + std::to_string(seed + N) + ", case " +
                    std::to_string(k));
  }
  for (std::size_t k = 0; k < std::min<std::size_t>(tally.faults.size(), 5); ++k) ADD_FAILURE() << tally.faults[k];
  EXPECT_EQ(tally.faults.size(), 0u) << "of " << tally.answers << " answers";
  return tally;
}

template <int N>
Model<N> without_effects(const Robot<N>& robot, test::Random&) {
  return Model<N>(robot);
}

TYPED_TEST(RandomRobots, SuchAsPeopleBuild) {
  constexpr int N = TypeParam::N;
  const test::Tally tally = attack<N>("sane", 12000, test::sane_case<N>, without_effects<N>);
  EXPECT_GT(tally.judged, 0);
  std::cout << test::evaluations_table(tally, "N = " + std::to_string(N));
  for (const auto& [start, evaluations] : tally.evaluations) EXPECT_LE(std::ranges::max(evaluations), 300) << start;
}

TYPED_TEST(RandomRobots, Harder) {
  constexpr int N = TypeParam::N;
  attack<N>("wide", 3000, test::wide_case<N>, without_effects<N>);
}

TYPED_TEST(RandomRobots, ThatCannotExist) {
  constexpr int N = TypeParam::N;
  const test::Tally tally = attack<N>("garbage", 5000, test::garbage_case<N>, without_effects<N>);
  EXPECT_GT(tally.statuses.size(), 5u);
}

template <class T>
struct RandomRobotsWithEffects : testing::Test {};
TYPED_TEST_SUITE(RandomRobotsWithEffects, test::OneToThreeTubes);

/// All effects of the catalogue at once, each somewhere within three standard deviations of its neutral values.
TYPED_TEST(RandomRobotsWithEffects, OfAnySize) {
  constexpr int N = TypeParam::N;
  const auto with_effects = [](const Robot<N>& robot, test::Random& random) {
    return Model<N, Catalogue>(robot, test::random_effects<N>(random, 3));
  };
  const test::Tally tally = attack<N>("effects", 400, test::sane_case<N>, with_effects, false);
  EXPECT_GT(tally.evaluations.at("cold").size(), 0u);
  std::cout << test::evaluations_table(tally, "effects, N = " + std::to_string(N));
}

/// The equations with effects, none of which changes anything: the independent model judges them.
TYPED_TEST(RandomRobotsWithEffects, TooSmallToMatter) {
  constexpr int N = TypeParam::N;
  const auto hardly_any = [](const Robot<N>& robot, test::Random&) {
    return Model<N, Catalogue>(robot, test::hardly_any_effects<N>());
  };
  EXPECT_GT(attack<N>("hardly any effects", 400, test::sane_case<N>, hardly_any).judged, 0);
}

}  // namespace attack_test
}  // namespace ctcr
