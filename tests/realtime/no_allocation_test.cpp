// Nothing that runs in real time touches the heap, whatever the input and however the solve ends.
#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "support/laws.hpp"
#include "support/no_alloc.hpp"

namespace ctcr {
namespace no_allocation_test {

using test::HeapGuard, test::Random;

template <class T>
struct NoAllocation : testing::Test {};
TYPED_TEST_SUITE(NoAllocation, test::TubeCounts);

/// Heap uses of cold and warm solves and steps over random cases, easy and hard.
template <Derivatives D, int N>
long heap_uses() {
  Random random(91);
  long uses = 0;
  for (int n = 0; n < test::cases(40); ++n) {
    Robot<N> robot = test::random_robot<N>(random);
    if (n % 4 == 3) robot.gravity = test::tilted_gravity;
    Joints<N> q = test::random_joints(robot, random, 0.2);
    // Every tenth load is beyond reason, so that all attempts of a solve are made.
    const TipLoad load = n % 4 == 0 ? TipLoad{} : test::random_load(random, n % 10 == 9 ? 100 : 0.3, 0.01);
    const HeapGuard guard;
    const Model<N> model(robot);
    Workspace<N> ws;
    Solution<N> s;
    (void)solve<D>(model, q, load, ws, s);
    for (int k = 0; k < 5; ++k) {
      q.alpha[0] += 0.01;
      (void)step<D>(model, q, load, ws, s);
    }
    q.alpha[0] = std::numeric_limits<double>::quiet_NaN();
    (void)step<D>(model, q, load, ws, s);
    uses += guard.uses();
  }
  return uses;
}

TYPED_TEST(NoAllocation, SolveAndStep) {
  EXPECT_EQ((heap_uses<Derivatives::none, TypeParam::N>()), 0);
  EXPECT_EQ((heap_uses<Derivatives::jacobian, TypeParam::N>()), 0);
  EXPECT_EQ((heap_uses<Derivatives::compliance, TypeParam::N>()), 0);
}

TEST(Guard, CatchesAPlantedAllocationInTheStep) {
  const Model<3> model(test::paper_robot());
  Workspace<3> ws;
  Solution<3> s;
  const HeapGuard guard;
  (void)step<Derivatives::jacobian>(model, Joints<3>{.beta = {-0.3, -0.2, -0.1}}, {}, ws, s);
  EXPECT_EQ(guard.uses(), 0);
  const auto planted = std::make_unique<Solution<3>>(s);
  asm volatile("" : : "g"(planted.get()) : "memory");
  EXPECT_EQ(guard.uses(), 1);
}

}  // namespace no_allocation_test
}  // namespace ctcr
