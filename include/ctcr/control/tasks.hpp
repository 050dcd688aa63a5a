#pragma once
// Tasks that compete in one least-squares step (gdls.hpp), and the list of those of a controller, fixed at compile time.
//
// A task has a name, add(state, goals), which adds its goal to the least-squares problem, and shortfall(state, q'), which
// says how far a step falls short of what the task wants: above 1 it gave way. All calls are real time.
#include <array>
#include <tuple>
#include <utility>

#include "ctcr/control/control_state.hpp"

namespace ctcr {

/// Follow the reference: feedforward of its velocity and feedback of the error. A rotation weight of 0 leaves the
/// orientation free. Ref: Boyer et al., Section IV.A. Real time: yes.
struct Tracking {
  static constexpr const char* name = "tracking";
  Weight weight{1e7, 0};
  double gain = 20;           ///< of the feedback [1/s]
  double correction = 20e-3;  ///< feedback is not faster than this [m/s]
  double tolerance = 1e-3;    ///< deviation from the wanted tip velocity beyond which it gave way [m/s]

  template <class S>
  [[nodiscard]] Vec6 velocity(const S& s) const noexcept {
    Vec6 feedback;
    feedback << s.reference.pose.position - s.tip.position,
        rotation_vector(s.reference.pose.rotation * s.tip.rotation.transpose());
    feedback *= gain;
    const double speed = feedback.head<3>().norm();
    // From where squares are too large for a number, the error has no direction: NaN, instead of none.
    return s.reference.velocity + (speed <= correction ? 1.0 : correction / speed + 0 * speed) * feedback;
  }

  template <int N, class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    goals.add_tip_goal(s.solution.jacobian, velocity(s), weight);
  }

  /// How far the task gives way at q', in units of its tolerance.
  template <int N, class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>& s, const JointVelocity<N>& v) const noexcept {
    const Vec6 missing = s.solution.jacobian * v - velocity(s);
    const double turn = weight.rotation > 0 ? missing.tail<3>().norm() * rotation_per_translation : 0;
    return std::max(missing.head<3>().norm(), turn) / tolerance;
  }

private:
  static constexpr double rotation_per_translation = 0.05;  ///< [m]: 1 mm/s counts as much as 1.1 degrees/s
};

/// Move the joints little. Ref: Boyer et al., Section IV.A. Real time: yes.
struct Damping {
  static constexpr const char* name = "damping";
  Weight weight{1e6, 10};
  double translation = 20e-3, rotation = 2;  ///< speeds beyond which it gave way [m/s], [rad/s]

  template <int N, class Fx>
  void add(const ControlState<N, Fx>&, LeastSquares<N>& goals) const noexcept {
    goals.add_joint_goal(JointVelocity<N>::Zero(), weight);
  }

  template <int N, class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>&, const JointVelocity<N>& v) const noexcept {
    return std::max(v.template head<N>().cwiseAbs().maxCoeff() / translation,
                    v.template tail<N>().cwiseAbs().maxCoeff() / rotation);
  }
};

/// Keep away from the limits of the actuators: down the gradient of L, the sum of the squared gaps. Gaps add up to a
/// constant, so L is least where they are equal. Ref: Boyer et al., Section IV.A. Real time: yes.
struct LimitAvoidance {
  static constexpr const char* name = "limit avoidance";
  Weight weight{100, 0};
  double rate = 100;      ///< v = -rate dL/dq [1/s]
  double comfort = 5e-3;  ///< gap below which a step that narrows it gave way [m]

  /// dL/dq.
  template <int N>
  [[nodiscard]] static JointVelocity<N> gradient(const Robot<N>& robot, const VecN<N>& beta) noexcept {
    const Gaps<N> g = gaps(robot, beta);
    JointVelocity<N> d = JointVelocity<N>::Zero();
    for (int i = 0; i < N; ++i) {
      d[i] += 2 * (g.tips[i] - g.bases[i]);
      if (i > 0) d[i] += 2 * (g.bases[i - 1] - g.tips[i - 1]);
    }
    return d;
  }

  template <int N, class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    goals.add_joint_goal(-rate * gradient(s.model.robot(), s.q.beta), weight);
  }

  template <int N, class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>& s, const JointVelocity<N>& v) const noexcept {
    const Gaps<N> now = gaps(s.model.robot(), s.q.beta);
    const VecN<N> ahead = s.q.beta + v.template head<N>();
    const Gaps<N> later = gaps(s.model.robot(), ahead);
    double worst = 0;
    for (int i = 0; i < N; ++i) {
      if (later.bases[i] < now.bases[i]) worst = std::max(worst, 2 - now.bases[i] / comfort);
      if (later.tips[i] < now.tips[i]) worst = std::max(worst, 2 - now.tips[i] / comfort);
    }
    return worst;
  }
};

/// A ball that the tip must not touch. Base frame.
struct Obstacle {
  Vec3 centre = Vec3::Zero();  ///< [m]
  double radius = 0;           ///< [m]; 0: there is none
};

/// Keep the tip away from an obstacle: a velocity that points away from it, inversely proportional to the square of the
/// distance to its surface. Ref: Boyer et al., Section IV.A. Real time: yes.
struct ObstacleAvoidance {
  static constexpr const char* name = "obstacle avoidance";
  Weight weight{10, 0};
  Obstacle obstacle;
  double gain = 0.1;     ///< velocity times squared distance [m^3/s]
  double range = 10e-3;  ///< distance below which a step towards the obstacle gave way [m]

  /// From the surface to the tip [m].
  [[nodiscard]] double distance(const Vec3& tip) const noexcept {
    return (tip - obstacle.centre).norm() - obstacle.radius;
  }

  template <int N, class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    if (obstacle.radius <= 0) return;  // NaN is an obstacle that nobody knows
    constexpr double nearest = 1e-4;   // [m]: the velocity stays finite on the surface, and points out from inside
    const double d = std::max(distance(s.tip.position), nearest);
    Vec6 away = Vec6::Zero();
    away.head<3>() = gain / (d * d) * (s.tip.position - obstacle.centre).normalized();
    goals.add_tip_goal(s.solution.jacobian, away, weight);
  }

  template <int N, class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>& s, const JointVelocity<N>& v) const noexcept {
    if (obstacle.radius <= 0) return 0;
    const Vec3 move = (s.solution.jacobian * v).template head<3>();
    const bool nears = move.dot(s.tip.position - obstacle.centre) < 0;
    return nears ? 2 - distance(s.tip.position) / range : 0;
  }
};

/// Drift towards preferred joints where the other tasks leave freedom. Real time: yes.
template <int N>
struct Posture {
  static constexpr const char* name = "posture";
  Weight weight{};
  Joints<N> preferred;
  double rate = 0.1;        ///< [1/s]
  double tolerance = 0.05;  ///< distance from the preferred positions beyond which it gave way [m]

  template <class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    JointVelocity<N> v;
    v << preferred.beta - s.q.beta, preferred.alpha - s.q.alpha;
    goals.add_joint_goal(rate * v, weight);
  }

  template <class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>& s, const JointVelocity<N>&) const noexcept {
    return weight.translation > 0 ? (preferred.beta - s.q.beta).cwiseAbs().maxCoeff() / tolerance : 0;
  }
};

/// Keep away from snapping: where Solution::stability is below `wanted`, up its gradient, found by differences (2N + 1
/// solves from the warm start, only there). Real time: yes.
struct StabilityMargin {
  static constexpr const char* name = "stability margin";
  Weight weight{};
  double wanted = 0.3;  ///< det B_u: 1 without interaction between the tubes, 0 where the robot snaps
  double rate = 1;      ///< of its increase [1/s]

  /// d(stability)/dq by one-sided differences.
  template <int N, class Fx>
  [[nodiscard]] static JointVelocity<N> gradient(const ControlState<N, Fx>& s) noexcept {
    constexpr double translation = 1e-5, rotation = 1e-4;
    JointVelocity<N> g = JointVelocity<N>::Zero();
    double here = 0;
    const auto at = [&s](const Joints<N>& q, double& stability) noexcept {
      Workspace<N> ws = s.ws;
      Solution<N> there;
      const Status status = solve<Derivatives::jacobian>(s.model, q, s.load, ws, there, s.settings);
      stability = there.stability;
      return has_equilibrium(status);
    };
    if (!at(s.q, here)) return g;
    for (int j = 0; j < 2 * N; ++j) {
      Joints<N> q = s.q;
      // A step that would leave the order of the tubes is left out: that joint cannot help there.
      const double step = j < N ? -translation : rotation;
      (j < N ? q.beta[j] : q.alpha[j - N]) += step;
      double there = 0;
      if (at(q, there)) g[j] = (there - here) / step;
    }
    return g;
  }

  template <int N, class Fx>
  void add(const ControlState<N, Fx>& s, LeastSquares<N>& goals) const noexcept {
    if ((weight.translation == 0 && weight.rotation == 0) || s.solution.stability >= wanted) return;
    const JointVelocity<N> g = gradient(s);
    const double steepness = g.squaredNorm();
    if (steepness > 0) goals.add_joint_goal(rate * (wanted - s.solution.stability) / steepness * g, weight);
  }

  template <int N, class Fx>
  [[nodiscard]] double shortfall(const ControlState<N, Fx>& s, const JointVelocity<N>&) const noexcept {
    return weight.translation > 0 || weight.rotation > 0 ? 2 - s.solution.stability / wanted : 0;
  }
};

/// The requirements on a task.
template <class Task, int N, class Fx>
concept ActsAsTask =
    requires(const Task& task, const ControlState<N, Fx>& s, LeastSquares<N>& goals, const JointVelocity<N>& v) {
      { Task::name } -> std::convertible_to<const char*>;
      task.add(s, goals);
      { task.shortfall(s, v) } -> std::convertible_to<double>;
    };

/// Tasks that act together. Real time: yes.
template <class... Task>
struct TaskList {
  static_assert(detail::all_differ<Task...>, "a task stands in the list twice: get<>() could not tell them apart");
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
    static_assert((ActsAsTask<Task, N, Fx> && ...),
                  "a task needs a name, add(state, goals) and shortfall(state, velocity)");
    std::apply([&](const Task&... task) { (task.add(s, goals), ...); }, tasks);
  }

  template <int N, class Fx>
  [[nodiscard]] Shortfalls shortfalls(const ControlState<N, Fx>& s, const JointVelocity<N>& v) const noexcept {
    static_assert((ActsAsTask<Task, N, Fx> && ...),
                  "a task needs a name, add(state, goals) and shortfall(state, velocity)");
    return std::apply([&](const Task&... task) { return Shortfalls{task.shortfall(s, v)...}; }, tasks);
  }
};

/// The tasks of Boyer et al., Section IV, with their weights.
using PaperTasks = TaskList<Tracking, Damping, LimitAvoidance, ObstacleAvoidance>;

}  // namespace ctcr
