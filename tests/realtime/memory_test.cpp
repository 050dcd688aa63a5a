// One thread's memory for three tubes: 64 kB for what the user keeps and what a call needs on the stack together.
#include <gtest/gtest.h>
#include <pthread.h>

#include <cstring>
#include <vector>

#include "support/laws.hpp"

namespace ctcr {
namespace {

constexpr std::size_t limit = 64 * 1024;
using Largest = Evaluation<3, Loading::weight, Derivatives::compliance>;

static_assert(sizeof(Workspace<3>) + sizeof(Solution<3>) + sizeof(Model<3>) < 8 * 1024);
static_assert(sizeof(Largest) < 8 * 1024);
static_assert(sizeof(Workspace<4>) + sizeof(Solution<4>) + sizeof(Model<4>) < limit / 4);

void* solve_hard_cases(void*) {
  static Model<3> light(test::paper_robot());
  static Workspace<3> ws;
  static Solution<3> s;
  const Joints<3> q{{-0.35, -0.2, -0.1}, {0.1, 2.2, -2.3}};
  (void)solve<Derivatives::compliance>(light, q, {{0.1, -0.2, 0}, {0.001, 0, 0}}, ws, s);
  (void)solve<Derivatives::compliance>(light, q, {{50, -20, 0}, {0.1, 0, 0}}, ws, s);
  (void)step<Derivatives::compliance>(light, q, {.force = {0.1, -0.2, 0}}, ws, s);
  (void)solve<Derivatives::jacobian>(light, q, {}, ws, s);
  Robot<3> robot = test::paper_robot();
  robot.gravity = test::tilted_gravity;
  const Model<3> heavy(robot);
  (void)solve<Derivatives::compliance>(heavy, q, {{50, -20, 0}, {0.1, 0, 0}}, ws, s);
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
std::size_t stack_used(void* (*run)(void*)) {
  constexpr unsigned char paint = 0xA5;
  constexpr std::size_t size = 1024 * 1024, page = 4096;
  std::vector<unsigned char> memory(size + page, paint);
  unsigned char* stack = memory.data() + page - reinterpret_cast<std::uintptr_t>(memory.data()) % page;
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstack(&attributes, stack, size - page);
  pthread_t thread;
  EXPECT_EQ(pthread_create(&thread, &attributes, run, nullptr), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&attributes);
  std::size_t untouched = 0;
  while (untouched < size - page && stack[untouched] == paint) ++untouched;
  return size - page - untouched;
}

TEST(Memory, OneThreadWithThreeTubesNeedsLessThan64kB) {
  if (!honest_stack) GTEST_SKIP() << "the stack of an optimised build is what counts";
  const std::size_t idle = stack_used([](void*) -> void* { return nullptr; });
  const std::size_t used = stack_used(solve_hard_cases) - idle;
  const std::size_t kept = sizeof(Workspace<3>) + sizeof(Solution<3>) + sizeof(Model<3>);
  RecordProperty("stack_bytes", static_cast<int>(used));
  EXPECT_GT(used, sizeof(Largest)) << "the measurement saw nothing";
  EXPECT_LE(used + kept, limit) << used << " on the stack, " << kept << " kept";
}

}  // namespace
}  // namespace ctcr
