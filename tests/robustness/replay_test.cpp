// Robots that once were answered wrongly.
#include <gtest/gtest.h>

#include <fstream>

#include "robustness/attack.hpp"

namespace ctcr {
namespace replay_test {

template <int N>
test::Case<N> case_of(const char* name) {
  std::ifstream file(std::string("tests/robustness/cases/") + name + ".txt");
  test::Case<N> c;
  EXPECT_TRUE(test::read(file, c)) << name << ": run from the project's folder";
  return c;
}

/// @return status of the cold solve
template <int N>
Status replay(const char* name) {
  const test::Case<N> c = case_of<N>(name);
  test::Random random(1);
  test::Tally tally;
  const test::Attack attack{.moved = 1, .thorough = 1};
  test::Attacker<N>(attack, random, tally).at(c, Model<N>(c.robot), test::Known<N>{}, name);
  for (const std::string& fault : tally.faults) ADD_FAILURE() << fault;
  Workspace<N> ws;
  Solution<N> s;
  return solve<Derivatives::compliance>(Model<N>(c.robot), c.q, c.load, ws, s);
}

TEST(Replay, ReadsWhatIsWritten) {
  test::Random random(3);
  for (int k = 0; k < 100; ++k) {
    const test::Case<3> c = test::garbage_case<3>(random);
    test::Case<3> back;
    std::istringstream in(test::text(c));
    ASSERT_TRUE(test::read(in, back)) << test::text(c);
    EXPECT_EQ(test::text(back), test::text(c));
  }
}

TEST(Replay, ARobotWhoseErrorOfIntegrationWasLarge) { EXPECT_EQ(replay<1>("n1"), Status::ok); }

TEST(Replay, ColdSolvesThatFoundAnUnstableEquilibrium) {
  EXPECT_EQ(replay<3>("unstable_n3"), Status::ok);
  EXPECT_EQ(replay<5>("unstable_n5"), Status::ok);
}

TEST(Replay, SolvesThatCalledWhatTheyDidNotSolveSingular) {
  EXPECT_NE(replay<3>("singular_n3"), Status::singular);
  EXPECT_NE(replay<5>("singular_n5"), Status::singular);
}

TEST(Replay, OutputsThatWereNotDefined) {
  for (const char* name : {"nonfinite_n2", "notfinite_n2", "notrotation_n2"}) (void)replay<2>(name);
}

}  // namespace replay_test
}  // namespace ctcr
