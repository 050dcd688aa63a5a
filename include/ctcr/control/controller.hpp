#pragma once
// The paper's control scheme: one call a period, measured tip in, motor velocities out.
#include <algorithm>
#include <array>
#include <cmath>

#include "ctcr/control/device.hpp"
#include "ctcr/control/force_estimate.hpp"
#include "ctcr/control/limits.hpp"
#include "ctcr/control/live_effects.hpp"
#include "ctcr/control/tasks.hpp"
#include "ctcr/system/predict.hpp"

namespace ctcr {

/// How the controller takes account of a force at the tip.
enum class TipForce : std::uint8_t {
  unknown,   ///< the model has none
  known,     ///< given by the caller
  estimated  ///< from the deflection of the tip and the compliance
};

/// The report on a control period.
template <class Tasks>
struct ControlReport {
  Status status = Status::not_converged;  ///< of the period, see advance(); unless ok, the robot is told to stand still
  LimitReport limits;                     ///< at which the step was held
  typename Tasks::Shortfalls shortfall{};  ///< of each task, above 1 or NaN: it gave way
  Vec3 force = Vec3::Zero();               ///< that the model was solved with [N], base frame
  double stability = 0;                    ///< of the model

  /// Bit k: task k gave way.
  [[nodiscard]] std::uint32_t gave_way() const noexcept {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < shortfall.size(); ++k) bits |= std::uint32_t(!(shortfall[k] <= 1)) << k;
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
  /// Delay of the tracker's readings behind the motor angles of the same period [s], up to 8 periods: the model predicts
  /// the motion of the tip since then. Ref: Smith's predictor.
  double reading_age = 0;

  /// @param system  the sensor sits on the innermost tube   @param period  of the calls [s], > 0
  /// A robot that cannot exist is answered by invalid_robot in all calls, and settings that mean nothing by
  /// invalid_settings: check_limits(), limits that allow no joints at all, the period, check_transmission(),
  /// check_sensor(), a sensor on another tube.
  Controller(const System<N, Fx>& system, const Limits<N>& limits, double period, const Tasks& wanted = {}) noexcept
    : tasks(wanted),
      system_(system),
      limits_(limits),
      allowed_(system.model.robot(), limits),
      period_(period),
      settings_(check_settings()),
      now_{LiveEffects<N, Fx>(system.model), system.model, {}, {}} {}

  /// Whether the robot may be controlled from these motor angles.
  /// @return ok; invalid_settings; joints_out_of_order: the limits exclude them; else as solve()
  [[nodiscard]] Status check_start(const MotorAngles<N>& theta) const noexcept {
    if (settings_ != Status::ok) return settings_;
    const Joints<N> q = joints(system_.transmission, theta);
    if (!allowed_.contain(q.beta)) return Status::joints_out_of_order;
    Workspace<N> ws;
    Solution<N> solution;
    return solve<Derivatives::jacobian>(system_.model, q, TipLoad{}, ws, solution, system_.settings);
  }

  /// One period.
  /// @param measured   motor angles and tracker reading. Its rotation counts where orientation is tracked, or the sensor
  ///                   sits beside the tip; of a tracker that reads none give the identity.
  /// @param reference  wanted pose and velocity of the tip, base frame
  /// @param load       at the robot tip; only its moment counts unless the force is known
  /// @param velocity   of the motors [rad/s], finite; 0 unless the status is ok
  /// @return status ok; that of the model: singular: it is about to snap, and its Jacobian leads nowhere; singular: the
  ///         goals leave a direction free; not_finite: a motor angle, reading, reference or goal is NaN or too large,
  ///         the rotation of the reading or the reference is none (is_rotation()), or the reading is farther from the front
  ///         plate than twice the length of the robot; invalid_settings: those given to the constructor, those of the
  ///         estimate where it is used (ForceEstimate::check()), or a negative weight. What is refused stays out of the memory
  ///         of effects, force and warm start.
  ControlReport<Tasks> advance(const Measurement<N>& measured, const Reference& reference, const TipLoad& load,
                               MotorAngles<N>& velocity) noexcept {
    ControlReport<Tasks> report;
    velocity = {};
    if (settings_ != Status::ok) {
      report.status = settings_;
      return report;
    }
    if (tip_force == TipForce::estimated && estimate.check() != Status::ok) {
      report.status = estimate.check();
      return report;
    }
    Pose tip = tip_of(system_.sensor, measured.reading);
    TipLoad acting = load;
    if (tip_force != TipForce::known)
      acting.force = tip_force == TipForce::estimated ? estimate.force : Vec3(Vec3::Zero());
    if (all_finite(acting.force)) report.force = acting.force;
    const Joints<N> motors = joints(system_.transmission, measured.theta);
    const Joints<N> q = tip_force == TipForce::estimated ? settle<Derivatives::compliance>(now_, motors, acting)
                                                         : settle<Derivatives::jacobian>(now_, motors, acting);
    time_ += period_;
    report.status = now_.solution.status;
    report.stability = now_.solution.stability;
    if (!has_equilibrium(report.status)) {
      // Joints that are refused tell nothing of the robot. With others it may be the estimated force that is impossible.
      if (check_joints(system_.model.robot(), q) == Status::ok) {
        if (tip_force == TipForce::estimated) estimate.doubt();
        now_.ws.reset();
      }
      count_ = 0;
      return report;
    }
    const Vec3 moved = moved_since_reading();
    // The tip is no farther away than the robot is long; twice that forgives wrong frames.
    if (!(tip.position.norm() <= 2 * system_.model.robot().tubes[0].length) ||
        !is_rotation(measured.reading.rotation) || !is_rotation(reference.pose.rotation)) {
      report.status = Status::not_finite;
      return report;
    }
    if (tip_force == TipForce::estimated)
      estimate.update(now_.solution.compliance.template topLeftCorner<3, 3>(), tip.position - now_.solution.position);
    tip.position += moved;
    ControlState<N, Fx> state{now_.model, system_.settings, acting, q, tip, reference, now_.ws, now_.solution};
    JointVelocity<N> v;
    Status found = report.status;
    if (found == Status::ok)
      found = minimum(state, motors, v, report.limits);
    else
      v.setZero();
    if constexpr (Fx::template On<N>::depends_on_torsion) {
      if (found == Status::ok && now_.model.effects().act_by_torsion()) {
        state.reference.velocity.template head<3>() += missing(motors, v, acting);
        found = minimum(state, motors, v, report.limits);
      }
    }
    report.shortfall = tasks.shortfalls(state, v);
    report.status = found;
    if (found != Status::ok) return report;
    velocity = {v.template head<N>() / system_.transmission.translation_ratio,
                v.template tail<N>() / system_.transmission.rotation_ratio};
    if (!(std::abs(velocity.translation.sum() + velocity.rotation.sum()) < HUGE_VAL)) [[unlikely]] {
      velocity = {};
      report.status = Status::not_finite;
    }
    return report;
  }

  /// The model at the last period. Real time: yes.
  [[nodiscard]] const Solution<N>& solution() const noexcept { return now_.solution; }

private:
  /// The model on its way.
  struct Moving {
    LiveEffects<N, Fx> live;
    Model<N, Fx> model;
    Workspace<N> ws;
    Solution<N> solution;
  };

  [[nodiscard]] Status check_settings() const noexcept {
    if (system_.model.check() != Status::ok) return system_.model.check();
    const bool possible = period_ > 0 && period_ < HUGE_VAL && check_transmission(system_.transmission) == Status::ok &&
                          check_sensor(system_.sensor, 1) == Status::ok && check_limits(limits_) == Status::ok &&
                          allowed_.exist();
    return possible ? Status::ok : Status::invalid_settings;
  }

  /// Moves on to the joints of the motors; returns those of the tubes.
  template <Derivatives D>
  Joints<N> settle(Moving& to, const Joints<N>& motors, const TipLoad& load) const noexcept {
    Joints<N> q = motors;
    if constexpr (!Fx::none) {
      const auto equilibrium = [&](const auto& effects, const Joints<N>& tubes) {
        to.model = Model<N, Fx>(system_.model.robot(), effects);
        return has_equilibrium(follow<Derivatives::none>(to, tubes, load)) ? &to.model : nullptr;
      };
      q = to.live.advance(motors, time_, to.ws, equilibrium);
      to.model = Model<N, Fx>(system_.model.robot(), to.live.effects());
    }
    (void)follow<D>(to, q, load);
    return q;
  }

  /// Equilibrium of the model at the joints of the tubes: by a control step, or anew where that does not reach it.
  template <Derivatives D>
  Status follow(Moving& to, const Joints<N>& q, const TipLoad& load) const noexcept {
    const Status status = step<D>(to.model, q, load, to.ws, to.solution, system_.settings);
    if (status != Status::needs_solve) return status;
    return solve<D>(to.model, q, load, to.ws, to.solution, system_.settings);
  }

  /// The motion of the tip in the last `reading_age`, by the model [m].
  Vec3 moved_since_reading() noexcept {
    std::copy_backward(past_.begin(), past_.end() - 1, past_.end());
    past_[0] = now_.solution.position;
    count_ = std::min(count_ + 1, past_.size());
    const double periods = std::clamp(reading_age / period_, 0.0, double(count_ - 1));
    const std::size_t k = periods > 0 ? std::min(std::size_t(periods), count_ - 1) : 0;  // NaN stays in the sum below
    const Vec3 &later = past_[k], &earlier = past_[std::min(k + 1, count_ - 1)];
    return past_[0] - (later + (periods - double(k)) * (earlier - later));
  }

  Status minimum(const ControlState<N, Fx>& state, const Joints<N>& motors, JointVelocity<N>& v,
                 LimitReport& limits) const noexcept {
    LeastSquares<N> goals;
    tasks.add(state, goals);
    limits = {};
    return limited_minimum(goals, allowed_, limits_, motors.beta, period_, at_limits, v, limits);
  }

  /// Velocity [m/s] that the tip lacks in a period of v beside that by the Jacobian, which takes friction as it stands: what
  /// turns back has to overcome it first.
  [[nodiscard]] Vec3 missing(const Joints<N>& motors, const JointVelocity<N>& v, const TipLoad& load) const noexcept {
    Moving next = now_;
    const Joints<N> then{motors.beta + period_ * v.template head<N>(), motors.alpha + period_ * v.template tail<N>()};
    (void)settle<Derivatives::none>(next, then, load);
    if (!has_equilibrium(next.solution.status)) return Vec3::Zero();
    return now_.solution.jacobian.template topRows<3>() * v -
           (next.solution.position - now_.solution.position) / period_;
  }

  System<N, Fx> system_;
  Limits<N> limits_;
  AllowedPositions<N> allowed_;
  double period_, time_ = 0;
  Status settings_;  ///< whether the robot can exist, and sensor, limits and period mean something
  Moving now_;
  std::array<Vec3, 9> past_{};  ///< positions of the model's tip, the newest first
  std::size_t count_ = 0;       ///< of those that are known
};

}  // namespace ctcr
