// One thread's memory for three tubes: 64 kB for what the user keeps and what a call needs on the stack together.
#include <gtest/gtest.h>
#include <pthread.h>

#include <cstring>
#include <vector>

#include "support/laws.hpp"

namespace ctcr {
namespace memory_test {

constexpr std::size_t limit = 64 * 1024;
using Largest = Evaluation<3, Loading::weight, Derivatives::compliance>;

static_assert(sizeof(Workspace<3>) + sizeof(Solution<3>) + sizeof(Model<3>) < 8 * 1024);
static_assert(sizeof(Largest) < 8 * 1024);
static_assert(sizeof(Workspace<4>) + sizeof(Solution<4>) + sizeof(Model<4>) < limit / 4);

/// Every kind of loading, solved from cold, and one load beyond reason that makes a solve try all it can.
void* solve_hard_cases(void* solved) {
  constexpr Derivatives all = Derivatives::compliance;
  Robot<3> robot = test::paper_robot();
  static const Model<3> light(robot);
  robot.gravity = test::tilted_gravity;
  static const Model<3> heavy(robot);
  static Workspace<3> ws;
  static Solution<3> s;
  const Joints<3> q{{-0.3, -0.2, -0.1}, {0.1, 2.2, -2.3}};
  const TipLoad force{.force = {0.1, -0.2, 0}}, wrench{{0.1, -0.2, 0}, {0.001, 0, 0}}, huge{{50, -20, 0}, {0.1, 0, 0}};
  bool ok = solve<Derivatives::jacobian>(light, q, {}, ws, s) == Status::ok;
  for (const TipLoad& load : {force, wrench}) {
    ws.reset();
    ok = ok && solve<all>(light, q, load, ws, s) == Status::ok && step<all>(light, q, load, ws, s) == Status::ok;
  }
  ws.reset();
  ok = ok && solve<all>(heavy, q, wrench, ws, s) == Status::ok;
  (void)solve<all>(heavy, q, huge, ws, s);
  *static_cast<bool*>(solved) = ok;
  return nullptr;
}

#if defined(__SANITIZE_ADDRESS__)
constexpr bool honest_stack = false;  // the sanitizer pads every variable
#elif defined(__OPTIMIZE__)
constexpr bool honest_stack = true;
#else
constexpr bool honest_stack = false;
#endif

/// Deepest use of the stack by a thread, measured by the paint that it left untouched [bytes].
std::size_t stack_used(void* (*run)(void*), void* argument) {
  constexpr unsigned char paint = 0xA5;
  constexpr std::size_t size = 1024 * 1024, page = 4096;
  std::vector<unsigned char> memory(size + page, paint);
  unsigned char* stack = memory.data() + page - reinterpret_cast<std::uintptr_t>(memory.data()) % page;
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstack(&attributes, stack, size - page);
  pthread_t thread;
  EXPECT_EQ(pthread_create(&thread, &attributes, run, argument), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&attributes);
  std::size_t untouched = 0;
  while (untouched < size - page && stack[untouched] == paint) ++untouched;
  return size - page - untouched;
}

/// Per thread.
TEST(Memory, ThreeTubesNeedLessThan64kB) {
  if (!honest_stack) GTEST_SKIP() << "the stack of an optimised build is what counts";
  bool solved = false;
  const std::size_t used = stack_used(solve_hard_cases, &solved);  // with what a thread needs for itself
  const std::size_t kept = sizeof(Workspace<3>) + sizeof(Solution<3>) + sizeof(Model<3>);
  RecordProperty("stack_bytes", static_cast<int>(used));
  EXPECT_TRUE(solved);
  EXPECT_GT(used, 4 * sizeof(Largest)) << "the measurement saw nothing";
  EXPECT_LE(used + kept, limit) << used << " on the stack, " << kept << " kept";
}

}  // namespace memory_test
}  // namespace ctcr
