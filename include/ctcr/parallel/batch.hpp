#pragma once
// Many configurations over the threads of a pool.
#include <algorithm>
#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

#include "ctcr/mechanics/solve.hpp"
#include "ctcr/parallel/thread_pool.hpp"

namespace ctcr {

/// The input of one solve.
template <int N>
struct Configuration {
  Joints<N> joints;
  TipLoad load;
};

/// Configurations that one thread takes at a time and that may start from one another. Fixed, so that results do not
/// depend on the number of threads.
inline constexpr std::ptrdiff_t batch_chunk = 64;

namespace detail {

/// Whether a warm start is worth more than a cold one: beyond this it needs as many evaluations.
template <int N>
bool nearby(const Workspace<N>& ws, const Configuration<N>& next) noexcept {
  constexpr double translation = 0.01, rotation = 0.2, force = 0.05, moment = 0.005;
  return (next.joints.beta - ws.q.beta).cwiseAbs().maxCoeff() < translation &&
         (next.joints.alpha - ws.q.alpha).cwiseAbs().maxCoeff() < rotation &&
         (next.load.force - ws.load.force).norm() < force && (next.load.moment - ws.load.moment).norm() < moment;
}

}  // namespace detail

/// Solves `count` configurations, each from the one before where that is near (as along a path).
///
/// The answers are bit for bit the same for any number of threads. Memory: one workspace and one solution a thread.
/// @param input   input(i) -> Configuration<N> for i in [0, count)
/// @param output  output(i, const Solution<N>&) or output(i, const Solution<N>&, const Workspace<N>&), called once for each
///                i in any order; status tells what came of it
/// Both are called by several threads at once and must not throw.
/// Real time: no (allocates the workspaces). @throws std::bad_alloc
template <Derivatives D = Derivatives::none, class Stepper = MagnusRk4, int N, class Input, class Output>
void solve_batch(const Model<N>& model, std::ptrdiff_t count, const Input& input, const Output& output,
                 ThreadPool& pool, const Settings& settings = {}) {
  struct alignas(64) Worker {
    Workspace<N> ws;
    Solution<N> solution;
  };
  std::vector<Worker> workers(static_cast<std::size_t>(pool.size()));
  const auto chunks = (count + batch_chunk - 1) / batch_chunk;
  pool.parallel_for(static_cast<int>(chunks), [&](int chunk, int worker) noexcept {
    auto& [ws, solution] = workers[static_cast<std::size_t>(worker)];
    const std::ptrdiff_t first = chunk * batch_chunk;
    ws.reset();
    for (std::ptrdiff_t i = first; i < std::min(first + batch_chunk, count); ++i) {
      const Configuration<N> configuration = input(i);
      if (ws.warm && !detail::nearby(ws, configuration)) ws.reset();
      (void)solve<D, Stepper>(model, configuration.joints, configuration.load, ws, solution, settings);
      if constexpr (std::is_invocable_v<Output, std::ptrdiff_t, const Solution<N>&, const Workspace<N>&>)
        output(i, std::as_const(solution), std::as_const(ws));
      else
        output(i, std::as_const(solution));
    }
  });
}

}  // namespace ctcr
