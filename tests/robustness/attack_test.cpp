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

#ifdef __SANITIZE_ADDRESS__
constexpr int share = 5;  // of the cases: one takes twenty times as long
#else
constexpr int share = 1;
#endif

/// @param draw   the next case   @param model_of  its model, and its effects as Attacker::at() takes them
template <int N, class Draw, class ModelOf>
test::Tally attack(const char* name, int cases, const Draw& draw, const ModelOf& model_of) {
  test::Random random(seed + unsigned(N));
  test::Tally tally;
  const test::Attack how;
  test::Attacker<N> attacker(how, random, tally);
  for (int k = 0; k < test::cases(cases / share); ++k) {
    const test::Case<N> c = draw(random);
    const auto [model, known] = model_of(c.robot, random);
    attacker.at(c, model, known,
                std::string(name) + ", N = " + std::to_string(N) + ", seed " + std::to_string(seed + N) + ", case " +
                    std::to_string(k));
  }
  for (std::size_t k = 0; k < std::min<std::size_t>(tally.faults.size(), 5); ++k) ADD_FAILURE() << tally.faults[k];
  EXPECT_EQ(tally.faults.size(), 0u) << "of " << tally.answers << " answers";
  return tally;
}

template <int N>
auto without_effects(const Robot<N>& robot, test::Random&) {
  return std::pair(Model<N>(robot), test::Known<N>{});
}

TYPED_TEST(RandomRobots, SuchAsPeopleBuild) {
  constexpr int N = TypeParam::N;
  const test::Tally tally = attack<N>("sane", 800, test::sane_case<N>, without_effects<N>);
  EXPECT_GT(tally.judged, 0);
  std::cout << test::evaluations_table(tally, "N = " + std::to_string(N));
  for (const auto& [start, evaluations] : tally.evaluations) EXPECT_LE(std::ranges::max(evaluations), 300) << start;
}

TYPED_TEST(RandomRobots, Harder) {
  constexpr int N = TypeParam::N;
  attack<N>("wide", 300, test::wide_case<N>, without_effects<N>);
}

TYPED_TEST(RandomRobots, ThatCannotExist) {
  constexpr int N = TypeParam::N;
  const test::Tally tally = attack<N>("garbage", 1000, test::garbage_case<N>, without_effects<N>);
  EXPECT_GT(tally.statuses.size(), 5u);
}

template <class T>
struct RandomRobotsWithEffects : testing::Test {};
TYPED_TEST_SUITE(RandomRobotsWithEffects, test::OneToThreeTubes);

/// All effects of the catalogue at once, each somewhere within three standard deviations of its neutral values.
TYPED_TEST(RandomRobotsWithEffects, OfAnySize) {
  constexpr int N = TypeParam::N;
  const auto with_effects = [](const Robot<N>& robot, test::Random& random) {
    return std::pair(Model<N, Catalogue>(robot, test::random_effects<N>(random, 3)), std::optional<test::Known<N>>{});
  };
  const test::Tally tally = attack<N>("effects", 200, test::sane_case<N>, with_effects);
  EXPECT_GT(tally.evaluations.at("cold").size(), 0u);
  std::cout << test::evaluations_table(tally, "effects, N = " + std::to_string(N));
}

/// Effects of the material and of a weight at the tip, which the independent model knows: the answers are equilibria of a
/// robot with these effects, and stable.
TYPED_TEST(RandomRobotsWithEffects, OfTheMaterial) {
  constexpr int N = TypeParam::N;
  const auto of_the_material = [](const Robot<N>& robot, test::Random& random) {
    Catalogue::On<N> drawn = test::random_effects<N>(random, 3), effects;
    test::Known<N> known;
    const auto take = [&]<template <int, class> class E>() -> const E<N, double>& {
      return test::effect<E, N>(effects) = test::effect<E, N>(drawn);
    };
    const auto& softening = take.template operator()<Softening>();
    const auto& anisotropy = take.template operator()<Anisotropy>();
    const auto& profile = take.template operator()<PrecurvatureProfile>();
    const auto& bend = take.template operator()<StraightCurvature>();
    const auto& helix = take.template operator()<HelicalPrecurvature>();
    const auto& weight = take.template operator()<TipWeight>();
    for (int i = 0; i < N; ++i)
      known.materials[std::size_t(i)] = {
          .softening = softening.template get<0>(i),
          .plateau = softening.template get<1>(),
          .sharpness = softening.template get<2>(),
          .along = anisotropy.template get<0>(i),
          .across = anisotropy.template get<1>(i),
          .profile = {profile.template get<0>(i), profile.template get<1>(i), profile.template get<2>(i),
                      profile.template get<3>(i), profile.template get<4>(i)},
          .bend = {bend.template get<0>(i), bend.template get<1>(i)},
          .slope = bend.template get<2>(i),
          .bow = bend.template get<3>(i),
          .twist = helix.template get<0>(i)};
    known.tip_force = weight.template get<0>() * robot.gravity +
                      Vec3(weight.template get<1>(), weight.template get<2>(), weight.template get<3>());
    return std::pair(Model<N, Catalogue>(robot, effects), known);
  };
  EXPECT_GT(attack<N>("effects of the material", 120, test::sane_case<N>, of_the_material).judged, 0);
}

/// The equations with effects, none of which changes anything: the independent model judges them.
TYPED_TEST(RandomRobotsWithEffects, TooSmallToMatter) {
  constexpr int N = TypeParam::N;
  const auto hardly_any = [](const Robot<N>& robot, test::Random&) {
    return std::pair(Model<N, Catalogue>(robot, test::hardly_any_effects<N>()), test::Known<N>{});
  };
  EXPECT_GT(attack<N>("hardly any effects", 200, test::sane_case<N>, hardly_any).judged, 0);
}

}  // namespace attack_test
}  // namespace ctcr
