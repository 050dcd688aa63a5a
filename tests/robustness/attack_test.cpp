// Random robots against the judge: `ok` is an equilibrium, stable and accurate, and outputs are defined whatever is asked.
#include "robustness/attack.hpp"

#include <gtest/gtest.h>

#include <iostream>

namespace ctcr {
namespace attack_test {

template <class T>
struct RandomRobots : testing::Test {};
TYPED_TEST_SUITE(RandomRobots, test::OneToFiveTubes);

constexpr unsigned seed = 20261126;

template <int N, class Draw>
test::Tally attack(const char* name, int cases, const Draw& draw) {
  test::Random random(seed + unsigned(N));
  test::Tally tally;
  const test::Attack how;
  test::Attacker<N> attacker(how, random, tally);
  for (int k = 0; k < test::cases(cases); ++k)
    attacker.at(draw(random), std::string(name) + ", N = " + std::to_string(N) + ", seed " + std::to_string(seed + N) +
                                  ", case " + std::to_string(k));
  for (std::size_t k = 0; k < std::min<std::size_t>(tally.faults.size(), 5); ++k) ADD_FAILURE() << tally.faults[k];
  EXPECT_EQ(tally.faults.size(), 0u) << "of " << tally.answers << " answers";
  return tally;
}

TYPED_TEST(RandomRobots, SuchAsPeopleBuild) {
  constexpr int N = TypeParam::N;
  const test::Tally tally = attack<N>("sane", 12000, [](test::Random& random) { return test::sane_case<N>(random); });
  EXPECT_GT(tally.judged, 0);
  std::vector<double> asymmetry = tally.asymmetry;
  std::ranges::sort(asymmetry);
  std::cout << "asymmetry of C, N = " << N << ": median " << asymmetry[asymmetry.size() / 2] << ", 99 % "
            << asymmetry[asymmetry.size() * 99 / 100] << ", worst " << asymmetry.back() << "\n";
  std::cout << test::evaluations_table(tally, "N = " + std::to_string(N));
  for (const auto& [start, evaluations] : tally.evaluations) EXPECT_LE(std::ranges::max(evaluations), 300) << start;
}

TYPED_TEST(RandomRobots, Harder) {
  constexpr int N = TypeParam::N;
  attack<N>("wide", 3000, [](test::Random& random) { return test::wide_case<N>(random); });
}

TYPED_TEST(RandomRobots, ThatCannotExist) {
  constexpr int N = TypeParam::N;
  const test::Tally tally =
      attack<N>("garbage", 5000, [](test::Random& random) { return test::garbage_case<N>(random); });
  EXPECT_GT(tally.statuses.size(), 5u);
}

}  // namespace attack_test
}  // namespace ctcr
