#pragma once
// Closed loops of a robot of N tubes.
#include <ctcr/control/closed_loop.hpp>
#include <ctcr/parallel/thread_pool.hpp>
#include <ctcr/simulation/sensitivity.hpp>
#include <ctcr/simulation/simulated_robot.hpp>

#include "any_control.hpp"
#include "systems_of.hpp"

namespace ctcr::python {

template <int N>
using AllTasks = TaskList<Tracking, Damping, LimitAvoidance, ObstacleAvoidance, StabilityMargin, Posture<N>>;

template <int N>
AllTasks<N> tasks_of(const TaskValues& v) {
  const auto weight = [&](int k) { return Weight{v.weights(k, 0), v.weights(k, 1)}; };
  return {{Tracking{weight(0), v.gain, v.correction, v.tracking_tolerance},
           Damping{weight(1), v.damping_translation, v.damping_rotation},
           LimitAvoidance{weight(2), v.avoidance_rate, v.comfort},
           ObstacleAvoidance{weight(3), {v.obstacle, v.obstacle_radius}, v.strength, v.range},
           StabilityMargin{weight(4), v.stability, v.stability_rate},
           Posture<N>{weight(5), {v.posture_beta, v.posture_alpha}, v.posture_rate}}};
}

/// AnyDevice as a Device.
template <int N>
class OuterDevice {
public:
  explicit OuterDevice(const AnyDevice& outer) : outer_(outer), values_(2 * N) {}

  Status measure(Measurement<N>& out) noexcept {
    if (!outer_.measure(values_, reading_.position, reading_.rotation)) return Status::not_finite;
    out = {{values_.head<N>(), values_.tail<N>()}, reading_};
    return Status::ok;
  }
  Status move(const MotorAngles<N>& velocity, double period) noexcept {
    values_ << velocity.translation, velocity.rotation;
    return outer_.move(values_, period) ? Status::ok : Status::not_finite;
  }
  [[nodiscard]] const Pose& exact_reading() const noexcept { return reading_; }

private:
  const AnyDevice& outer_;
  Eigen::VectorXd values_;
  Pose reading_;
};

template <int N>
LoopResult closed_loop(const LoopRequest& r) {
  LoopResult out;
  const Limits<N> limits{r.limits.base_gap,       r.limits.tip_gap,  r.limits.translation_speed,
                         r.limits.rotation_speed, r.limits.beta_low, r.limits.beta_high};
  const TipLoad load{r.force, Vec3::Zero()};

  const auto system_with = [](const SystemValues& v) {
    return with_constant_effects<N>(system_of<N>(v.parameters, 0, v.steps), v.effects);
  };
  const System<N, AllEffects> system = system_with(r.controller), real = system_with(r.plant);
  // The path and the obstacle stand in space: a controller with another T_ref sees them elsewhere.
  const Pose T_base_world = system.sensor.T_tracker_base.inverse() * real.sensor.T_tracker_base;
  std::vector<Vec3> points;
  for (Eigen::Index i = 0; i < r.points.rows(); ++i)
    points.push_back((T_base_world * Pose{Mat3::Identity(), r.points.row(i).transpose()}).position);
  const AnyPath path = path_through(points, r.spline, r.speed, r.acceleration);
  const AnyPath start{[first = path.at(0)](double) { return first; }, r.settle};
  TaskValues seen = r.tasks;
  seen.obstacle = (T_base_world * Pose{Mat3::Identity(), seen.obstacle}).position;

  const MotorAngles<N> home = motor_angles(system.transmission, Joints<N>{r.beta, r.alpha});
  Controller<N, AllTasks<N>, AllEffects> controller(system, limits, r.period, tasks_of<N>(seen));
  controller.at_limits = r.limits.redistribute ? AtLimits::redistribute : AtLimits::hold;
  controller.tip_force = r.tip_force == "known"       ? TipForce::known
                         : r.tip_force == "estimated" ? TipForce::estimated
                                                      : TipForce::unknown;
  controller.reading_age = r.reading_age;
  if (const Status status = controller.check_start(home); status != Status::ok) {
    out.status = to_string(status);
    return out;
  }
  const Pose T_world_base = T_base_world.inverse();
  const Pose T_world_tracker = T_world_base * system.sensor.T_tracker_base.inverse();
  const auto wanted = [&](const Reference& reference) { return (T_world_base * reference.pose).position; };
  const auto drive = [&](auto& plant) {
    const auto tip = [&] { return (T_world_tracker * plant.exact_reading()).position; };
    Status status = run(controller, plant, start, r.period, load, [](const auto&) { return true; });
    out.settled = (tip() - wanted(path.at(0))).norm();
    out.started = status == Status::ok;

    const auto rows = Eigen::Index(path.duration() / r.period + 0.5) + 1;
    out.time.setZero(rows);
    out.joints.setZero(rows, 2 * N);
    out.tip.setZero(rows, 3);
    out.wanted.setZero(rows, 3);
    out.shortfall.setZero(rows, AllTasks<N>::size);
    out.held.setZero(rows, 4);
    out.force.setZero(rows, 3);
    out.stability.setZero(rows);
    out.model_status.setZero(rows);
    Eigen::Index k = 0;
    if (status == Status::ok)
      status = run(controller, plant, path, r.period, load, [&](const auto& row) {
        const Joints<N> q = joints(system.transmission, row.measured.theta);
        out.time[k] = row.time;
        out.joints.block<1, N>(k, 0) = q.beta.transpose();
        out.joints.block<1, N>(k, N) = q.alpha.transpose();
        out.tip.block<1, 3>(k, 0) = tip().transpose();
        out.wanted.block<1, 3>(k, 0) = wanted(row.reference).transpose();
        for (int t = 0; t < AllTasks<N>::size; ++t) out.shortfall(k, t) = row.report.shortfall[std::size_t(t)];
        const LimitReport& held = row.report.limits;
        out.held.row(k) << held.base_gaps, held.tip_gaps, held.travel, held.speed;
        out.force.row(k) = row.report.force.transpose();
        out.stability[k] = row.report.stability;
        out.model_status[k] = int(row.report.status);
        ++k;
        return !r.device || r.device->record(out, k - 1);
      });
    out.status = to_string(status);
    for (auto* m : {&out.joints, &out.tip, &out.wanted, &out.shortfall, &out.force})
      m->conservativeResize(k, Eigen::NoChange);
    out.held.conservativeResize(k, Eigen::NoChange);
    out.time.conservativeResize(k);
    out.stability.conservativeResize(k);
    out.model_status.conservativeResize(k);
  };
  if (r.device) {
    OuterDevice<N> plant(*r.device);
    drive(plant);
  } else {
    SimulatedRobot<N, AllEffects> plant(real, home, load, TrackerNoise{r.noise_position, r.noise_rotation}, r.seed);
    drive(plant);
  }
  return out;
}

template <int N>
SensitivityResult sensitivity(const SensitivityRequest& r) {
  const auto system = [&](const Eigen::VectorXd& parameters) { return system_of<N>(parameters, 0, r.nominal.steps); };
  Variations<N> v{system(r.nominal.parameters), {}, r.low, r.high, r.most_force};
  for (Eigen::Index i = 0; i < r.varied.rows(); ++i) v.systems.push_back(system(r.varied.row(i).transpose()));
  const auto columns = v.systems.size() + 1;
  std::vector<std::vector<DistanceStatistics>> found(std::size_t(r.blocks), std::vector<DistanceStatistics>(columns));
  std::vector<std::int64_t> evaluations(std::size_t(r.blocks));
  ThreadPool pool(r.threads);
  pool.parallel_for(r.blocks, [&](int block, int) {
    const auto b = std::size_t(block);
    evaluations[b] = tip_sensitivity(v, r.seed, r.first_block + b, r.configurations, found[b]);
  });

  SensitivityResult out;
  const auto width = Eigen::Index(columns);
  for (auto* m : {&out.count, &out.unsolved}) m->setZero(r.blocks, width);
  for (auto* m : {&out.sum, &out.sum_of_squares, &out.maximum}) m->setZero(r.blocks, width);
  out.histogram.setZero(width, DistanceStatistics::bins);
  out.evaluations = 0;
  for (Eigen::Index b = 0; b < r.blocks; ++b) {
    out.evaluations += double(evaluations[std::size_t(b)]);
    for (Eigen::Index c = 0; c < width; ++c) {
      const DistanceStatistics& s = found[std::size_t(b)][std::size_t(c)];
      out.count(b, c) = int(s.count);
      out.unsolved(b, c) = int(s.unsolved);
      out.sum(b, c) = s.sum;
      out.sum_of_squares(b, c) = s.sum_of_squares;
      out.maximum(b, c) = s.maximum;
      for (int k = 0; k < DistanceStatistics::bins; ++k) out.histogram(c, k) += double(s.histogram[std::size_t(k)]);
    }
  }
  return out;
}

}  // namespace ctcr::python

#define CTCR_INSTANTIATE_CONTROL(N)                                                                 \
  template ctcr::python::LoopResult ctcr::python::closed_loop<N>(const ctcr::python::LoopRequest&); \
  template ctcr::python::SensitivityResult ctcr::python::sensitivity<N>(const ctcr::python::SensitivityRequest&);
