#pragma once
// Tasks that compete in one least-squares step, fixed at compile time.
#include <array>
#include <tuple>
#include <utility>

#include "ctcr/control/damping.hpp"
#include "ctcr/control/limit_avoidance.hpp"
#include "ctcr/control/obstacle_avoidance.hpp"
#include "ctcr/control/posture.hpp"
#include "ctcr/control/stability_margin.hpp"
#include "ctcr/control/tracking.hpp"

namespace ctcr {

/// A task has a name, add(situation, goals), and shortfall(situation, q'), which says how far a step falls short of
/// what it wants: above 1 it gave way. All calls are real time.
template <class... Task>
struct TaskList {
  static constexpr int size = int(sizeof...(Task));
  static constexpr std::array<const char*, sizeof...(Task)> names{Task::name...};
  using Shortfalls = std::array<double, sizeof...(Task)>;

  std::tuple<Task...> tasks;

  template <class T>
  [[nodiscard]] T& get() noexcept {
    return std::get<T>(tasks);
  }

  template <int N, class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    std::apply([&](const Task&... task) { (task.add(s, goals), ...); }, tasks);
  }

  template <int N, class Fx>
  [[nodiscard]] Shortfalls shortfalls(const ControlState<N, Fx>& s, const JointVelocity<N>& v) const noexcept {
    return std::apply([&](const Task&... task) { return Shortfalls{task.shortfall(s, v)...}; }, tasks);
  }
};

/// The tasks of Boyer et al., Section IV, with their weights.
using PaperTasks = TaskList<Tracking, Damping, LimitAvoidance, ObstacleAvoidance>;

}  // namespace ctcr
