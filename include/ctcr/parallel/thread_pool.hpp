#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <type_traits>
#include <vector>

namespace ctcr {

/// Fixed set of threads that share the indices of a loop.
///
/// The calling thread takes part, so a pool of one thread creates none. Indices are claimed one at a time, and a call
/// returns when all indices are done, not when all threads have reported: a thread that another process keeps from
/// running delays the loop only while it holds an index. Idle threads spin for a while, then sleep.
///
/// One loop at a time: a call from inside a loop, or while another thread's loop runs, is done serially by its caller.
///
/// Real time: `parallel_for` neither allocates nor locks. It makes a system call only to wake sleeping threads (they
/// then come too late for work of a few microseconds; a control loop that wants them spins longer than its period) or
/// after waiting longer than `spin` for another thread's last index. Construction and destruction are not real time.
///
/// Measured, 2 threads on 2 cores (EPYC 7003): hand-off and return 0.25 us median, 0.7 us at 99.9 %; 5 us when the
/// other thread sleeps. With another process on the second core: 0.7 us median, 1.5 us at 99.9 %, and the mean of a loop
/// is that of one thread; but a thread that is preempted inside an index (rare when an index takes microseconds) keeps
/// the caller waiting for a time slice of the scheduler, 4 ms, unless the threads have real-time priority.
class ThreadPool {
public:
  /// @param threads  number of threads that work, the caller included; below 1: one for each core
  /// @param spin     how long an idle thread spins before it sleeps; 0 when there are more threads than cores
  /// @throws std::system_error when the system refuses a thread
  explicit ThreadPool(int threads, std::chrono::nanoseconds spin = std::chrono::microseconds(50))
    : ThreadPool(threads > cores() ? std::chrono::nanoseconds::zero() : spin) {
    if (threads < 1) threads = cores();
    threads_.reserve(static_cast<std::size_t>(threads - 1));
    for (int worker = 1; worker < threads; ++worker) threads_.emplace_back([this, worker] { serve(worker); });
  }

  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  ~ThreadPool() {
    unclaimed_.store(stop);
    unclaimed_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  /// Number of threads that work, the caller included.
  int size() const noexcept { return static_cast<int>(threads_.size()) + 1; }

  /// Calls f(index, worker) for each index in [0, n), in no particular order, and returns when all calls have returned.
  ///
  /// @param n  number of indices; nothing happens when n <= 0
  /// @param f  must not throw; worker in [0, size()) tells the threads of one call apart (for per-thread storage; a
  ///           call from inside a loop passes the worker of its caller). What f wrote is visible after the return.
  /// Real time: yes, see above.
  template <class F>
  void parallel_for(int n, F&& f) noexcept {
    const Place here = place_;
    const bool nested = here.pool == this;
    if (n <= 1 || threads_.empty() || nested || busy_.exchange(true, std::memory_order_acquire)) {
      const int worker = nested ? here.worker : 0;
      for (int index = 0; index < n; ++index) f(index, worker);
      return;
    }
    using Function = std::remove_reference_t<F>;
    job_.call = [](const void* function, int index, int worker) noexcept {
      (*static_cast<Function*>(const_cast<void*>(function)))(index, worker);
    };
    job_.function = std::addressof(f);
    job_.n = n;
    unfinished_.store(n, std::memory_order_relaxed);
    unclaimed_.store(n);
    unclaimed_.notify_all();

    place_ = {this, 0};
    take_indices(0);
    place_ = here;
    for (int left; (left = unfinished_.load(std::memory_order_acquire)) != 0;) wait_for_change(unfinished_, left);
    busy_.store(false, std::memory_order_release);
  }

private:
  struct Job {
    void (*call)(const void* function, int index, int worker) noexcept;
    const void* function;
    int n;
  };
  struct Place {
    const ThreadPool* pool;
    int worker;
  };
  static constexpr int stop = -1;
  static constexpr int cache_line = 64;

  // The public constructor delegates to this one so that, when a thread cannot be started, the destructor still runs
  // and joins those that could.
  explicit ThreadPool(std::chrono::nanoseconds spin) : spin_(spin) {}

  static int cores() noexcept { return std::max(1, static_cast<int>(std::thread::hardware_concurrency())); }

  void serve(int worker) noexcept {
    place_ = {this, worker};
    while (true) {
      take_indices(worker);
      const int unclaimed = unclaimed_.load(std::memory_order_relaxed);
      if (unclaimed == stop) return;
      if (unclaimed == 0) wait_for_change(unclaimed_, 0);
    }
  }

  // The job is read only after an index was claimed: from then until that index is reported as finished the job cannot
  // end, so a thread that wakes late can never see a job half replaced by the next one.
  void take_indices(int worker) noexcept {
    int unclaimed = unclaimed_.load(std::memory_order_relaxed);
    while (unclaimed > 0) {
      if (!unclaimed_.compare_exchange_weak(unclaimed, unclaimed - 1, std::memory_order_acquire,
                                            std::memory_order_relaxed))
        continue;
      job_.call(job_.function, job_.n - unclaimed, worker);
      if (unfinished_.fetch_sub(1) == 1) unfinished_.notify_one();
      unclaimed = unclaimed_.load(std::memory_order_relaxed);
    }
  }

  void wait_for_change(const std::atomic<int>& value, int old) const noexcept {
    const auto end = std::chrono::steady_clock::now() + spin_;
    do {
      for (int i = 0; i < 32; ++i) {
        if (value.load(std::memory_order_relaxed) != old) return;
        pause();
      }
    } while (std::chrono::steady_clock::now() < end);
    value.wait(old, std::memory_order_relaxed);
  }

  static void pause() noexcept {
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#elif defined(__aarch64__)
    asm volatile("yield");
#endif
  }

  static constinit inline thread_local Place place_{nullptr, 0};

  // Changes that a thread may sleep on are sequentially consistent: else the look for sleepers in notify could come
  // before the change, and a thread that falls asleep in between would never wake.
  alignas(cache_line) std::atomic<int> unclaimed_{0};   // indices nobody has taken yet; `stop` ends the threads
  alignas(cache_line) std::atomic<int> unfinished_{0};  // indices that have not returned yet
  alignas(cache_line) Job job_{};
  std::atomic<bool> busy_{false};
  std::chrono::nanoseconds spin_;
  std::vector<std::thread> threads_;
};

}  // namespace ctcr
