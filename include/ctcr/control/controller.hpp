#pragma once
// The paper's control scheme: one call a period, measured tip in, motor velocities out.
#include "ctcr/control/device.hpp"
#include "ctcr/control/force_estimate.hpp"
#include "ctcr/control/limits.hpp"
#include "ctcr/control/live_effects.hpp"
#include "ctcr/control/task_list.hpp"

namespace ctcr {

/// What the controller makes of the force at the tip.
enum class TipForce : std::uint8_t {
  unknown,   ///< the model has none
  known,     ///< the caller says what it is
  estimated  ///< from the deflection of the tip and the compliance
};

/// What became of a period.
template <class Tasks>
struct ControlReport {
  Status status = Status::not_converged;   ///< of the model and the goals; not ok: the robot is told to stand still
  LimitReport limits;                      ///< at which the step was held
  typename Tasks::Shortfalls shortfall{};  ///< of each task, above 1: it gave way
  Vec3 force = Vec3::Zero();               ///< that the model was solved with [N], base frame
  double stability = 0;                    ///< of the model

  /// Bit k: task k gave way.
  [[nodiscard]] std::uint32_t gave_way() const noexcept {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < shortfall.size(); ++k) bits |= std::uint32_t(shortfall[k] > 1) << k;
    return bits;
  }
};

/// Model-based Jacobian control by generalised damped least squares. Keeps the warm start of its model, the past of its
/// effects and the estimated force from call to call.
/// @tparam Tasks  TaskList<...>
/// Ref: Boyer et al., Section IV. Real time: advance() is, in bounded time.
template <int N, class Tasks = PaperTasks, class Fx = Standard>
class Controller {
public:
  Tasks tasks;
  AtLimits at_limits = AtLimits::hold;
  TipForce tip_force = TipForce::unknown;
  ForceEstimate estimate;

  /// @param system  the sensor sits on the innermost tube   @param period  of the calls [s]
  Controller(const System<N, Fx>& system, const Limits<N>& limits, double period, const Tasks& wanted = {}) noexcept
    : tasks(wanted),
      system_(system),
      limits_(limits),
      allowed_(system.model.robot(), limits),
      period_(period),
      live_(system.model.effects()),
      model_(system.model) {}

  /// Whether the robot may be controlled from these motor angles.
  /// @return ok; joints_out_of_order: the limits exclude them, or allow no joints at all; else as solve()
  [[nodiscard]] Status check_start(const MotorAngles<N>& theta) const noexcept {
    const Joints<N> q = joints(system_.transmission, theta);
    if (!allowed_.exist() || !allowed_.contain(q.beta)) return Status::joints_out_of_order;
    Workspace<N> ws;
    Solution<N> solution;
    return solve<Derivatives::jacobian>(system_.model, q, TipLoad{}, ws, solution, system_.settings);
  }

  /// One period.
  /// @param measured   motor angles and tracker reading (its rotation counts where orientation is tracked)
  /// @param reference  wanted pose and velocity of the sensor, base frame
  /// @param load       at the robot tip; only its moment counts unless the force is known
  /// @param velocity   of the motors [rad/s]; 0 where the status is not ok
  ControlReport<Tasks> advance(const Measurement<N>& measured, const Reference& reference, const TipLoad& load,
                               MotorAngles<N>& velocity) noexcept {
    ControlReport<Tasks> report;
    velocity = {};
    const Joints<N> motors = joints(system_.transmission, measured.theta);
    Joints<N> q = motors;
    if constexpr (!Fx::none) {
      q = live_.advance(motors, time_, ws_);
      time_ += period_;
      model_ = Model<N, Fx>(system_.model.robot(), live_.effects());
    }
    const Pose tip = tip_of(system_.sensor, measured.reading);
    TipLoad acting = load;
    if (tip_force != TipForce::known)
      acting.force = tip_force == TipForce::estimated ? estimate.force : Vec3(Vec3::Zero());
    report.force = acting.force;
    if (tip_force == TipForce::estimated) {
      report.status = step<Derivatives::compliance>(model_, q, acting, ws_, solution_, system_.settings);
      if (report.status == Status::ok || report.status == Status::singular)
        estimate.update(solution_.compliance.template topLeftCorner<3, 3>(), tip.position - solution_.position);
    } else {
      report.status = step<Derivatives::jacobian>(model_, q, acting, ws_, solution_, system_.settings);
    }
    report.stability = solution_.stability;
    const bool usable = report.status == Status::ok || report.status == Status::singular;
    if (!usable || !tip.position.allFinite()) {
      if (usable) report.status = Status::not_finite;
      ws_.reset();
      return report;
    }
    const Situation<N, Fx> situation{model_, system_.settings, acting, q, tip, reference, ws_, solution_};
    LeastSquares<N> goals;
    tasks.add(situation, goals);
    JointVelocity<N> v;
    const Status found = limited_minimum(goals, allowed_, limits_, motors.beta, period_, at_limits, v, report.limits);
    report.shortfall = tasks.shortfalls(situation, v);
    if (found != Status::ok) {
      report.status = found;
      return report;
    }
    velocity = {v.template head<N>() / system_.transmission.translation_ratio,
                v.template tail<N>() / system_.transmission.rotation_ratio};
    return report;
  }

  /// The model at the last period. Real time: yes.
  [[nodiscard]] const Solution<N>& solution() const noexcept { return solution_; }

private:
  System<N, Fx> system_;
  Limits<N> limits_;
  AllowedPositions<N> allowed_;
  double period_, time_ = 0;
  LiveEffects<N, Fx> live_;
  Model<N, Fx> model_;
  Workspace<N> ws_;
  Solution<N> solution_;
};

}  // namespace ctcr
