// Calibration from your own program: where the tracker sees the robot, and at which angle a motor holds its tube.
#include <cmath>
#include <cstdio>
#include <ctcr/calibration/procedures/registration.hpp>
#include <ctcr/calibration/procedures/rotation_offset.hpp>
#include <ctcr/ctcr.hpp>
#include <numbers>
#include <random>
#include <vector>

int main() {
  // What a tracker would read; put your own readings here. All in SI units.
  const ctcr::Pose truth{Eigen::AngleAxisd(2.1, ctcr::Vec3(0.96, 0.28, 0)).toRotationMatrix(), {-0.048, -0.007, 0.006}};
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 1);
  const auto read = [&](const ctcr::Vec3& place, double sd) -> ctcr::Vec3 {
    return truth.rotation * place + truth.position + sd * ctcr::Vec3(noise(random), noise(random), noise(random));
  };

  // T_ref: touch points of the base plate, whose places in the base frame the CAD gives.
  std::vector<ctcr::Fiducial> points{{"front left", {-0.05, 0.03, -0.01}},   {"front right", {0.05, 0.03, -0.01}},
                                     {"rear left", {-0.05, 0.03, -0.21}},    {"rear right", {0.05, 0.03, -0.21}},
                                     {"bottom left", {-0.05, -0.04, -0.11}}, {"bottom right", {0.05, -0.04, -0.11}}};
  for (ctcr::Fiducial& point : points) point.readings = {read(point.position, 0.2e-3), read(point.position, 0.2e-3)};
  const ctcr::Registration frame = ctcr::register_points(points);
  const ctcr::Vec3 tip(0, 0, 0.15);
  std::printf("T_ref: residual %.2f mm, expected error at the tip %.2f mm, there it is %.2f mm\n", 1e3 * frame.fre,
              1e3 * frame.target_error(tip),
              1e3 * (frame.T_tracker_base.rotation * tip + frame.T_tracker_base.position - read(tip, 0)).norm());

  // Rotation offset: one tube alone, turned once forward and once back.
  ctcr::Robot<1> robot;
  robot.tubes[0] = {.youngs_modulus = 58e9,
                    .inner_diameter = 1.30e-3,
                    .outer_diameter = 1.52e-3,
                    .length = 0.40,
                    .curved_length = 0.05,
                    .curvature = 10};
  const ctcr::Model<1> model(robot);
  ctcr::Workspace<1> workspace;
  ctcr::Solution<1> solution;
  const double ratio = -1, offset = 0.062, backlash = 0.004;  // backlash: the tube lags behind, both ways
  std::vector<ctcr::TurnReading> readings;
  for (int i = -36; i <= 36; ++i) {
    const double theta = 0.17 * (36 - std::abs(i)), lag = i < 0 ? backlash : -backlash;
    const ctcr::Joints<1> q{ctcr::VecN<1>(-0.34), ctcr::VecN<1>(ratio * theta + offset + lag)};
    if (solve<ctcr::Derivatives::none>(model, q, {}, workspace, solution) != ctcr::Status::ok) return 1;
    readings.push_back({.motor_angle = theta, .position = read(solution.position, 0.035e-3)});
  }
  const ctcr::RotationOffset found =
      ctcr::fit_rotation_offset(readings, {.ratio = ratio, .T_tracker_base = frame.T_tracker_base});
  constexpr double degrees = 180 / std::numbers::pi;
  std::printf("offset %.2f deg, sd %.2f deg; it is %.2f deg\n", degrees * found.offset, degrees * found.offset_sd,
              degrees * offset);
  for (const auto& notice : found.notices) std::printf("%s: %s\n", to_string(notice.kind), notice.text.c_str());
  return std::abs(found.offset - offset) * degrees < 0.3 ? 0 : 1;
}
