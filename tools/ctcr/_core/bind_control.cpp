// Closed loops. Use ctcr.track, which reads scenarios and names what is wrong.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <ctcr/control/polyline.hpp>
#include <ctcr/control/spline_path.hpp>
#include <exception>
#include <stdexcept>
#include <tuple>

#include "any_control.hpp"
#include "with_tubes.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {

AnyPath path_through(const std::vector<Vec3>& points, bool spline, double speed, double acceleration) {
  const auto any = [](const auto& path) {
    if (path.check() != Status::ok)
      throw std::invalid_argument("no path leads through these points at this speed and acceleration");
    return AnyPath{[path](double t) { return path.at(t); }, path.duration()};
  };
  return spline ? any(SplinePath(points, speed, acceleration)) : any(Polyline(points, speed, acceleration));
}

namespace {

LoopResult any_closed_loop(const LoopRequest& r) {
  const Eigen::Index n = r.beta.size();
  const bool fits = r.alpha.size() == n && r.tasks.weights.rows() == 6 && r.tasks.weights.cols() == 2 &&
                    r.tasks.posture_beta.size() == n && r.tasks.posture_alpha.size() == n &&
                    r.limits.beta_low.size() == n && r.limits.beta_high.size() == n && r.points.cols() == 3 &&
                    r.points.rows() >= (r.spline ? 4 : 2);
  if (!fits) throw std::invalid_argument("the arrays of a closed loop do not fit together");
  const nb::gil_scoped_release released;
  return with_tubes(n, [&](auto tubes) { return closed_loop<tubes>(r); });
}

using Reading = std::tuple<Eigen::VectorXd, Eigen::Vector3d, Eigen::Matrix3d>;

/// Runs on a device in Python: measure() -> (motor angles (2N,) [rad], position (3,) [m], rotation (3, 3)),
/// move(velocity (2N,) [rad/s], period [s]), record(result so far, row). What one of them raises ends the loop.
LoopResult closed_loop_on(const nb::object& device, LoopRequest& r) {
  std::exception_ptr raised;
  const auto guarded = [&raised](const auto& call) noexcept {
    const nb::gil_scoped_acquire held;
    try {
      call();
      return true;
    } catch (...) {
      raised = std::current_exception();
      return false;
    }
  };
  const AnyDevice outer{
      [&](Eigen::VectorXd& theta, Eigen::Vector3d& position, Eigen::Matrix3d& rotation) {
        return guarded([&] {
          const auto tubes = theta.size();
          std::tie(theta, position, rotation) = nb::cast<Reading>(device.attr("measure")());
          if (theta.size() != tubes) throw std::invalid_argument("a device measures two motor angles a tube");
        });
      },
      [&](const Eigen::VectorXd& velocity, double period) {
        return guarded([&] { device.attr("move")(velocity, period); });
      },
      [&](const LoopResult& so_far, Eigen::Index row) {
        return guarded([&] { device.attr("record")(nb::cast(so_far, nb::rv_policy::reference), row); });
      }};
  r.device = &outer;
  LoopResult out = any_closed_loop(r);
  if (raised) std::rethrow_exception(raised);
  return out;
}

SensitivityResult any_sensitivity(Eigen::Index tubes, const SensitivityRequest& r) {
  const Eigen::Index parameters = r.nominal.parameters.size();
  const bool fits = r.varied.cols() == parameters && r.varied.rows() % 2 == 0 && r.low.size() == parameters &&
                    r.high.size() == parameters && r.blocks >= 1 && r.configurations >= 1;
  if (!fits) throw std::invalid_argument("the arrays of a sensitivity study do not fit together");
  const nb::gil_scoped_release released;
  return with_tubes(tubes, [&](auto n) { return sensitivity<n>(r); });
}

}  // namespace

void bind_control(nb::module_& m) {
  nb::class_<SystemValues>(m, "SystemValues", "A robot as its parameters; see ctcr.recording.values.")
      .def(nb::init<const Eigen::VectorXd&, const Eigen::VectorXd&, int>(), nb::kw_only(), "parameters"_a, "effects"_a,
           "steps"_a = 1);
  nb::class_<TaskValues>(m, "TaskValues", "Weights (6, 2) and settings of the tasks; SI units.")
      .def(nb::init<const RowMajor&, double, double, double, double, double, double, double, const Eigen::Vector3d&,
                    double, double, double, double, double, const Eigen::VectorXd&, const Eigen::VectorXd&, double>(),
           nb::kw_only(), "weights"_a, "gain"_a, "correction"_a, "tracking_tolerance"_a, "damping_translation"_a,
           "damping_rotation"_a, "avoidance_rate"_a, "comfort"_a, "obstacle"_a, "obstacle_radius"_a, "strength"_a,
           "range"_a, "stability"_a, "stability_rate"_a, "posture_beta"_a, "posture_alpha"_a, "posture_rate"_a);
  nb::class_<LimitValues>(m, "LimitValues", "Hard limits; SI units.")
      .def(nb::init<double, double, double, double, const Eigen::VectorXd&, const Eigen::VectorXd&, bool>(),
           nb::kw_only(), "base_gap"_a, "tip_gap"_a, "translation_speed"_a, "rotation_speed"_a, "beta_low"_a,
           "beta_high"_a, "redistribute"_a);
  nb::class_<LoopResult>(m, "LoopResult", "What happened, one row a period; SI units, the plant's base frame.")
      .def_ro("status", &LoopResult::status)
      .def_ro("started", &LoopResult::started)
      .def_ro("settled", &LoopResult::settled)
      .def_ro("time", &LoopResult::time)
      .def_ro("joints", &LoopResult::joints)
      .def_ro("tip", &LoopResult::tip)
      .def_ro("wanted", &LoopResult::wanted)
      .def_ro("shortfall", &LoopResult::shortfall)
      .def_ro("held", &LoopResult::held)
      .def_ro("force", &LoopResult::force)
      .def_ro("stability", &LoopResult::stability)
      .def_ro("model_status", &LoopResult::model_status);
  m.def(
      "closed_loop",
      [](const SystemValues& controller, const SystemValues& plant, const TaskValues& tasks, const LimitValues& limits,
         const RowMajor& points, bool spline, double speed, double acceleration, double period, double settle,
         const Eigen::VectorXd& beta, const Eigen::VectorXd& alpha, const Eigen::Vector3d& force,
         const std::string& tip_force, double noise_position, double noise_rotation, std::uint64_t seed,
         double reading_age, const nb::object& device) {
        LoopRequest r{controller, plant,        tasks,          limits,         points, spline,
                      speed,      acceleration, period,         settle,         beta,   alpha,
                      force,      tip_force,    noise_position, noise_rotation, seed,   reading_age};
        return device.is_none() ? any_closed_loop(r) : closed_loop_on(device, r);
      },
      nb::kw_only(), "controller"_a, "plant"_a, "tasks"_a, "limits"_a, "points"_a, "spline"_a, "speed"_a,
      "acceleration"_a, "period"_a, "settle"_a, "beta"_a, "alpha"_a, "force"_a, "tip_force"_a, "noise_position"_a,
      "noise_rotation"_a, "seed"_a, "reading_age"_a = 0.0, "device"_a = nb::none(),
      "Runs one scenario once. Releases the GIL. With a device, of ctcr.track.device.Device, that is controlled "
      "instead of "
      "a simulated plant.");
  nb::class_<SensitivityResult>(m, "SensitivityResult",
                                "A row a block and a column a varied system, the last one for all together.")
      .def_ro("count", &SensitivityResult::count)
      .def_ro("unsolved", &SensitivityResult::unsolved)
      .def_ro("sum", &SensitivityResult::sum)
      .def_ro("sum_of_squares", &SensitivityResult::sum_of_squares)
      .def_ro("maximum", &SensitivityResult::maximum)
      .def_ro("histogram", &SensitivityResult::histogram)
      .def_ro("evaluations", &SensitivityResult::evaluations);
  m.def(
      "sensitivity",
      [](int tubes, const SystemValues& nominal, const RowMajor& varied, const Eigen::VectorXd& low,
         const Eigen::VectorXd& high, double most_force, std::uint64_t seed, std::uint64_t first_block, int blocks,
         int configurations, int threads) {
        return any_sensitivity(
            tubes, {nominal, varied, low, high, most_force, seed, first_block, blocks, configurations, threads});
      },
      "tubes"_a, nb::kw_only(), "nominal"_a, "varied"_a, "low"_a, "high"_a, "most_force"_a, "seed"_a, "first_block"_a,
      "blocks"_a, "configurations"_a, "threads"_a = 0,
      "Tip errors of wrong parameters over blocks of random configurations. Releases the GIL.");
}

}  // namespace ctcr::python
