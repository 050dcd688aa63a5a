// A control loop at 1 kHz with the robot that `ctcr export` wrote to robot.hpp; tells how long its steps take.
#include <sched.h>
#include <sys/mman.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctcr/control/controller.hpp>
#include <numbers>

#include "robot.hpp"

namespace {

constexpr int N = robot::tube_count;
constexpr long period_ns = 1'000'000;
constexpr double period = 1e-9 * period_ns;
constexpr std::size_t cycles = 2000;

/// Durations of all cycles [us]; never allocates.
using Durations = std::array<double, cycles>;

double since(const timespec& from) noexcept {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return 1e6 * double(now.tv_sec - from.tv_sec) + 1e-3 * double(now.tv_nsec - from.tv_nsec);
}

void print(const char* what, Durations& durations) {
  std::sort(durations.begin(), durations.end());
  std::printf("%-9s min %7.1f, median %7.1f, p99 %7.1f, max %7.1f us\n", what, durations.front(), durations[cycles / 2],
              durations[cycles * 99 / 100], durations.back());
}

}  // namespace

int main() {
  const ctcr::System<N, robot::Effects> system = robot::system();
  ctcr::Controller<N, ctcr::PaperTasks, robot::Effects> controller(system, robot::limits(), period);

  // Your robot goes here: read its motors and its tracker, and give it velocities. This one does as the model says.
  ctcr::Measurement<N> measured;  // the motors stand at home
  ctcr::Workspace<N> workspace;
  ctcr::Solution<N> solution;
  if (controller.check_start(measured.theta) != ctcr::Status::ok ||
      ctcr::solve<ctcr::Derivatives::jacobian>(system.model, joints(system.transmission, measured.theta), {}, workspace,
                                               solution) != ctcr::Status::ok) {
    std::printf("the robot cannot start from home\n");
    return 1;
  }
  measured.reading = reading(system.sensor, solution.tube_tips);
  const ctcr::Vec3 start = solution.position;
  std::printf("tip at home %.17g %.17g %.17g m\n", start.x(), start.y(), start.z());

  const sched_param priority{.sched_priority = 80};
  if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) std::printf("without SCHED_FIFO: other programs disturb it\n");
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) std::printf("memory is not locked\n");

  // From here to the end of the loop nothing allocates, locks or prints.
  static Durations late, step;
  ctcr::MotorAngles<N> velocity;
  ctcr::Status status = ctcr::Status::ok;
  timespec next;
  clock_gettime(CLOCK_MONOTONIC, &next);
  for (std::size_t k = 0; k < cycles && status == ctcr::Status::ok; ++k) {
    next.tv_nsec += period_ns;
    if (next.tv_nsec >= 1'000'000'000) next.tv_nsec -= 1'000'000'000, ++next.tv_sec;
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, nullptr);
    late[k] = since(next);

    // The tip goes round a circle of 2 mm in 2 s.
    const double angle = std::numbers::pi * period * double(k), radius = 2e-3, rate = std::numbers::pi;
    ctcr::Reference wanted;
    wanted.pose.position = start + radius * ctcr::Vec3(std::cos(angle) - 1, std::sin(angle), 0);
    wanted.velocity.head<3>() = radius * rate * ctcr::Vec3(-std::sin(angle), std::cos(angle), 0);
    timespec before;
    clock_gettime(CLOCK_MONOTONIC, &before);
    status = controller.advance(measured, wanted, {}, velocity).status;  // unless ok, the velocity is 0
    step[k] = since(before);

    measured.theta.translation += period * velocity.translation;
    measured.theta.rotation += period * velocity.rotation;
    measured.reading = reading(system.sensor, controller.solution().tube_tips);
  }
  print("late by", late);
  print("a step", step);
  const double missed = 1e3 * (controller.solution().position - start).norm();
  std::printf("%s; after a turn the tip is %.3f mm from where it began\n", to_string(status), missed);
  return status == ctcr::Status::ok && missed < 0.1 ? 0 : 1;
}
