#pragma once
#include <algorithm>
#include <chrono>
#include <ctime>
#include <vector>

namespace bench {

/// CPU time of the calling thread [s]: what other processes do does not count, but shared caches and clocks do.
inline double thread_cpu_time() noexcept {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

/// Wall time [s]: the only honest clock for more than one thread.
inline double wall_time() noexcept {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Quantile p in [0, 1] of the values; reorders them.
inline double quantile(std::vector<double>& values, double p) {
  const auto place = values.begin() + std::ptrdiff_t(p * double(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

/// Seconds per call of f(0) .. f(count - 1): chunks of 50 calls, median of the repeats of each chunk, mean of chunks.
template <class Clock, class F>
double seconds_per_call(Clock clock, int count, int repeats, F&& f) {
  constexpr int chunk = 50;
  std::vector<std::vector<double>> times(std::size_t((count + chunk - 1) / chunk));
  for (int repeat = 0; repeat < repeats; ++repeat)
    for (std::size_t part = 0; part < times.size(); ++part) {
      const int begin = int(part) * chunk, end = std::min(count, begin + chunk);
      const double start = clock();
      for (int i = begin; i < end; ++i) f(i);
      times[part].push_back(clock() - start);
    }
  double sum = 0;
  for (auto& values : times) sum += quantile(values, 0.5);
  return sum / count;
}

}  // namespace bench
