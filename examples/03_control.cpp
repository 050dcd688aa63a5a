// A real-time loop: the tip follows a path at 200 Hz. Here the robot is simulated; a real one goes behind the same two
// calls, measure() and move(). Run it as root, or with the right to SCHED_FIFO, to have the times of real time.
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <time.h>

#include <array>
#include <bit>
#include <cstdio>
#include <ctcr/control/controller.hpp>
#include <ctcr/control/polyline.hpp>
#include <ctcr/ctcr.hpp>
#include <ctcr/simulation/simulated_robot.hpp>
#include <numbers>
#include <vector>

namespace {

/// Counts durations by powers of two of a microsecond; never allocates.
struct Histogram {
  std::array<int, 16> count{};
  void add(long nanoseconds) noexcept {
    const auto microseconds = static_cast<unsigned long>(nanoseconds > 0 ? nanoseconds / 1000 : 0);
    ++count[std::min<std::size_t>(std::size_t(std::bit_width(microseconds)), count.size() - 1)];
  }
  void print(const char* what) const {
    std::printf("%s\n", what);
    for (std::size_t k = 0; k < count.size(); ++k)
      if (count[k]) std::printf("  below %6lu us %6d\n", 1ul << k, count[k]);
  }
};

long since(const timespec& from) noexcept {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (now.tv_sec - from.tv_sec) * 1'000'000'000 + (now.tv_nsec - from.tv_nsec);
}

}  // namespace

int main() {
  const auto tube = [](double inner_diameter, double outer_diameter, double length, double curvature) {
    return ctcr::Tube{.youngs_modulus = 58e9,
                      .poisson_ratio = 0.3,
                      .inner_diameter = inner_diameter,
                      .outer_diameter = outer_diameter,
                      .length = length,
                      .curved_length = 0.05,
                      .curvature = curvature};
  };
  ctcr::Robot<3> robot;
  robot.tubes = {tube(1.30e-3, 1.52e-3, 0.463, 10), tube(1.62e-3, 1.80e-3, 0.3305, 5),
                 tube(2.03e-3, 2.35e-3, 0.199, 7)};
  const ctcr::Transmission<3> transmission{2e-3 / (2 * std::numbers::pi), -1, {-0.298, -0.2205, -0.145}, {0, 0, 0}};
  const ctcr::System<3> system{transmission, ctcr::Model<3>(robot), {}};

  constexpr long period_ns = 5'000'000;
  constexpr double period = 1e-9 * period_ns;
  ctcr::Controller<3> controller(system, {.base_gap = 20e-3, .tip_gap = 2e-3}, period);
  const ctcr::MotorAngles<3> start = motor_angles(transmission, {{-0.298, -0.2205, -0.145}, {0.2, 0.9, -1.4}});
  if (controller.check_start(start) != ctcr::Status::ok) return 1;  // limits exclude it

  ctcr::SimulatedRobot<3> device(system, start, {}, {35e-6, 0});  // your robot: anything with measure() and move()
  const ctcr::Vec3 tip = device.tip().position;
  const std::vector<ctcr::Vec3> corners{tip, tip + ctcr::Vec3(2e-3, 0, 0), tip + ctcr::Vec3(2e-3, 2e-3, 0)};
  const ctcr::Polyline path(corners, 5e-3, 20e-3);  // at 5 mm/s, accelerating with 20 mm/s^2

  const sched_param priority{.sched_priority = 80};
  if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority) != 0) std::printf("without SCHED_FIFO\n");
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) std::printf("memory is not locked\n");

  // From here to the end of the loop nothing allocates, locks or prints.
  Histogram wake_up, step;
  ctcr::Measurement<3> measured;
  ctcr::MotorAngles<3> velocity;
  ctcr::Status status = ctcr::Status::ok;
  int late = 0;
  timespec next;
  clock_gettime(CLOCK_MONOTONIC, &next);
  for (double t = 0; t < path.duration() + 0.5 && status == ctcr::Status::ok; t += period) {
    next.tv_nsec += period_ns;
    if (next.tv_nsec >= 1'000'000'000) next.tv_nsec -= 1'000'000'000, ++next.tv_sec;
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, nullptr);
    wake_up.add(since(next));
    status = device.measure(measured);
    if (status != ctcr::Status::ok) break;
    timespec before;
    clock_gettime(CLOCK_MONOTONIC, &before);
    const auto report = controller.advance(measured, path.at(t), {}, velocity);
    step.add(since(before));
    status = report.status;             // unless ok, the velocity is 0
    if (report.gave_way() & 1) ++late;  // tracking, the first task, gave way
    if (status == ctcr::Status::ok) status = device.move(velocity, period);
  }

  wake_up.print("late by");
  step.print("a control step takes");
  const double error = (device.tip().position - corners.back()).norm();
  std::printf("%s; tracking gave way in %d periods; %.3f mm from the end of the path\n", to_string(status), late,
              1e3 * error);
  return status == ctcr::Status::ok && error < 0.5e-3 ? 0 : 1;
}
