// The paper's Table I on this machine: computation rates of one Newton step by number of threads, the paper's figures,
// the rival and ours side by side.
#include <cstdio>
#include <cstdlib>

#include "ctcr/parallel/thread_pool.hpp"
#include "support/cases.hpp"
#include "support/timing.hpp"

namespace {

using namespace bench;

constexpr int repeats = 21;

/// Rates the paper printed [kHz], Intel Xeon W-2275. Ref: Boyer et al., Table I.
struct PaperRow {
  const char* name;
  int one_thread, four_threads, best, best_threads;
};
constexpr std::array<PaperRow, 5> paper{{{"Unloaded", 154, 277, 277, 4},
                                         {"Unloaded + J", 63, 128, 181, 10},
                                         {"Loaded", 41, 91, 134, 6},
                                         {"Loaded + J", 20, 54, 87, 12},
                                         {"Loaded + J + C", 14, 36, 68, 18}}};

template <class Case, class Clock, class Loop>
double rival_seconds(Clock clock, const Loop& loop) {
  const auto& solved = RivalSolved<Case::loaded>::instance();
  typename RivalSolved<Case::loaded>::Rival::Solution solution;
  return seconds_per_call(clock, int(solved.configurations.size()), repeats, [&](int i) {
    const Configuration& c = solved.configurations[std::size_t(i)];
    auto unknowns = solved.unknowns[std::size_t(i)];
    solved.rival.template step<Case::rival_outputs>(c.joints, c.load, unknowns, solution, loop);
  });
}

template <class Case>
double rival_by_hand_seconds() {
  const auto& solved = RivalSolved<Case::loaded>::instance();
  const rival::Rival<3, Case::loaded, rival::ScalarForm> rival(table_ii());
  typename decltype(rival)::Solution solution;
  return seconds_per_call(thread_cpu_time, int(solved.configurations.size()), repeats, [&](int i) {
    const Configuration& c = solved.configurations[std::size_t(i)];
    auto unknowns = solved.unknowns[std::size_t(i)];
    rival.template step<Case::rival_outputs>(c.joints, c.load, unknowns, solution);
  });
}

template <class Case>
double our_seconds() {
  const auto& solved = Solved<Case::loaded>::instance();
  auto workspaces = solved.workspaces;
  ctcr::Solution<3> solution;
  return seconds_per_call(thread_cpu_time, n_configurations, repeats, [&](int i) {
    const Configuration& c = solved.configurations[std::size_t(i)];
    const ctcr::Status status =
        ctcr::step<Case::derivatives>(solved.model, c.joints, c.load, workspaces[std::size_t(i)], solution);
    if (status != ctcr::Status::ok) std::abort();
  });
}

template <class Case>
bool results_are_right() {
  return Solved<Case::loaded>::instance().all_solved && RivalSolved<Case::loaded>::instance().agrees() &&
         derivatives_are_right<Case>();
}

double kHz(double seconds) { return 1e-3 / seconds; }

}  // namespace

int main() {
  ctcr::ThreadPool pool(2);
  const auto two_threads = [&](int n, auto&& f) { pool.parallel_for(n, [&](int index, int) { f(index); }); };
  std::puts(
      "Rates of one Newton step in kHz, 3 tubes, 1000 random configurations of the Table II robot.\n"
      "One thread: CPU time; two threads: wall time; medians. Rates of other machines are not comparable.\n");
  std::puts(
      "                     paper, its machine     | rival, here         by hand | ours, here  ratio to the rival");
  std::puts(
      "                 IVPs  1 thread  4    best  |  1 thread  2       1 thread |   1 thread  written plainly  by "
      "hand");
  std::size_t row = 0;
  double final_ratio = 0;
  bool all_right = true;
  for_each_case([&](auto entry) {
    using Case = decltype(entry);
    const PaperRow& p = paper[row++];
    const bool right = results_are_right<Case>();
    all_right = all_right && right;
    const double plain = rival_seconds<Case>(thread_cpu_time, rival::Serial{});
    const double plain_two = rival_seconds<Case>(wall_time, two_threads);
    const double by_hand = rival_by_hand_seconds<Case>();
    const double ours = our_seconds<Case>();
    final_ratio = plain / ours;
    std::printf("%-16s %4d  %8d %4d %4d/%-2d | %9.0f %4.0f  %13.0f | %10.0f %16.1f %8.1f%s\n", p.name,
                rival::Rival<3, Case::loaded>::ivps(Case::rival_outputs), p.one_thread, p.four_threads, p.best,
                p.best_threads, kHz(plain), kHz(plain_two), kHz(by_hand), kHz(ours), plain / ours, by_hand / ours,
                right ? "" : "  WRONG RESULTS");
  });
  std::printf("\nLoaded + J + C: %.1f times the rival (required: 20)\n", final_ratio);
  return all_right && final_ratio >= 20.0 ? 0 : 1;
}
