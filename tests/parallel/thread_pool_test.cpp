#include "ctcr/parallel/thread_pool.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <set>
#include <thread>
#include <vector>

#include "support/no_alloc.hpp"

namespace thread_pool_test {

using ctcr::ThreadPool;
using namespace std::chrono_literals;

class ThreadPoolOf : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Threads, ThreadPoolOf, testing::Values(1, 2, 3, 8));

TEST_P(ThreadPoolOf, Indices) {
  ThreadPool pool(GetParam());
  EXPECT_EQ(pool.size(), GetParam());
  for (const int n : {0, 1, 2, 3, 7, 64, 1000}) {
    std::vector<std::atomic<int>> calls(static_cast<std::size_t>(n) + 1);
    pool.parallel_for(n, [&](int index, int) { ++calls[static_cast<std::size_t>(index)]; });
    for (int index = 0; index < n; ++index) ASSERT_EQ(calls[static_cast<std::size_t>(index)], 1);
    EXPECT_EQ(calls.back(), 0);
  }
}

TEST_P(ThreadPoolOf, NegativeCounts) {
  ThreadPool pool(GetParam());
  bool called = false;
  pool.parallel_for(-5, [&](int, int) { called = true; });
  EXPECT_FALSE(called);
}

// Every loop must see its own function and count, whichever thread wakes late from the loop before.
TEST_P(ThreadPoolOf, ShortLoops) {
  ThreadPool pool(GetParam(), 1us);
  std::vector<std::int64_t> seen(9);
  for (std::int64_t loop = 0; loop < 20000; ++loop) {
    const int n = static_cast<int>(loop % 10);
    pool.parallel_for(n, [&seen, loop](int index, int) { seen[static_cast<std::size_t>(index)] = loop; });
    for (int index = 0; index < n; ++index) ASSERT_EQ(seen[static_cast<std::size_t>(index)], loop);
    if (loop % 1000 == 0) std::this_thread::sleep_for(1ms);  // lets the others fall asleep
  }
}

TEST_P(ThreadPoolOf, Workers) {
  ThreadPool pool(GetParam());
  std::vector<long> sums(static_cast<std::size_t>(pool.size()));
  pool.parallel_for(5000, [&](int index, int worker) {
    ASSERT_GE(worker, 0);
    ASSERT_LT(worker, pool.size());
    sums[static_cast<std::size_t>(worker)] += index;
  });
  EXPECT_EQ(std::accumulate(sums.begin(), sums.end(), 0L), 5000L * 4999L / 2);
}

TEST_P(ThreadPoolOf, NestedLoops) {
  ThreadPool pool(GetParam());
  std::vector<std::atomic<int>> calls(100);
  pool.parallel_for(10, [&](int outer, int worker) {
    const auto thread = std::this_thread::get_id();
    pool.parallel_for(10, [&](int inner, int inner_worker) {
      EXPECT_EQ(inner_worker, worker);
      EXPECT_EQ(std::this_thread::get_id(), thread);
      ++calls[static_cast<std::size_t>(10 * outer + inner)];
    });
  });
  for (const auto& count : calls) EXPECT_EQ(count, 1);
}

TEST_P(ThreadPoolOf, SeveralCallers) {
  ThreadPool pool(GetParam());
  std::atomic<long> sum{0};
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 3; ++caller)
    callers.emplace_back([&] {
      for (int loop = 0; loop < 200; ++loop) pool.parallel_for(20, [&](int index, int) { sum += index; });
    });
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(sum, 3L * 200 * 190);
}

TEST_P(ThreadPoolOf, StartsAndStops) {
  for (int i = 0; i < 50; ++i) {
    ThreadPool pool(GetParam(), i % 2 == 0 ? 0us : 20us);
    if (i % 3 == 0) std::this_thread::sleep_for(100us);  // some are stopped asleep, some awake
  }
}

TEST(ThreadPool, UsesItsThreads) {
  ThreadPool pool(3);
  std::atomic<int> arrived{0};
  std::set<std::thread::id> threads[3];
  // Each index waits for the others: only three threads at once can finish this.
  pool.parallel_for(3, [&](int index, int) {
    threads[index].insert(std::this_thread::get_id());
    for (++arrived; arrived < 3;) std::this_thread::yield();
  });
  threads[0].merge(threads[1]);
  threads[0].merge(threads[2]);
  EXPECT_EQ(threads[0].size(), 3U);
  EXPECT_TRUE(threads[0].contains(std::this_thread::get_id()));
}

// A thread that does not get to run must not hold up the rest: it may keep one index at most.
TEST(ThreadPool, BlockedThread) {
  ThreadPool pool(2);
  std::atomic<int> done{0};
  std::atomic<bool> held{false};
  pool.parallel_for(100, [&](int, int) {
    if (!held.exchange(true)) {
      while (done < 99) std::this_thread::yield();
    }
    ++done;
  });
  EXPECT_EQ(done, 100);
}

// The caller gives up spinning and sleeps; the last thread must wake it.
TEST(ThreadPool, SlowThread) {
  ThreadPool pool(2, 10us);
  for (int loop = 0; loop < 20; ++loop) {
    std::atomic<int> arrived{0};
    bool slow_done = false;
    pool.parallel_for(2, [&](int, int worker) {
      for (++arrived; arrived < 2;) std::this_thread::yield();
      if (worker == 0) return;
      std::this_thread::sleep_for(1ms);
      slow_done = true;
    });
    EXPECT_TRUE(slow_done);
  }
}

TEST(ThreadPool, DefaultSize) {
  EXPECT_EQ(ThreadPool(0).size(), static_cast<int>(std::max(1U, std::thread::hardware_concurrency())));
}

TEST(ThreadPool, ConstFunctions) {
  ThreadPool pool(2);
  std::atomic<int> sum{0};
  const auto add = [&](int index, int) { sum += index; };
  pool.parallel_for(4, add);
  EXPECT_EQ(sum, 6);
}

TEST(ThreadPool, TwoPools) {
  ThreadPool outer(2), inner(2);
  std::atomic<int> calls{0};
  outer.parallel_for(8, [&](int, int) { inner.parallel_for(8, [&](int, int) { ++calls; }); });
  EXPECT_EQ(calls, 64);
}

TEST(ThreadPool, NoAllocation) {
  ThreadPool pool(2, 0us);
  std::atomic<long> sum{0};
  const ctcr::test::HeapGuard guard;
  for (int loop = 0; loop < 1000; ++loop) pool.parallel_for(8, [&](int index, int) { sum += index; });
  EXPECT_EQ(guard.uses(), 0);
  EXPECT_EQ(sum, 28000);
}

}  // namespace thread_pool_test
