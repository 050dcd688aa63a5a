// A robot in code, where its tip is, and what shape it takes.
#include <cstdio>
#include <ctcr/ctcr.hpp>
#include <ctcr/mechanics/shape.hpp>
#include <vector>

int main() {
  // Three nitinol tubes, innermost first. Lengths in m, curvature in 1/m. Ref: Boyer et al., Table II.
  const ctcr::Tube nitinol{.youngs_modulus = 58e9, .poisson_ratio = 0.3, .density = 6450, .curved_length = 0.05};
  ctcr::Robot<3> robot;
  robot.tubes = {nitinol, nitinol, nitinol};
  const double inner_diameter[] = {1.30e-3, 1.62e-3, 2.03e-3}, outer_diameter[] = {1.52e-3, 1.80e-3, 2.35e-3};
  const double length[] = {0.463, 0.3305, 0.199}, curvature[] = {10, 5, 7};
  for (std::size_t i = 0; i < 3; ++i) {
    robot.tubes[i].inner_diameter = inner_diameter[i];
    robot.tubes[i].outer_diameter = outer_diameter[i];
    robot.tubes[i].length = length[i];
    robot.tubes[i].curvature = curvature[i];
  }
  robot.gravity = {0, -9.80665, 0};  // the robot points horizontally, its y axis up
  const ctcr::Model<3> model(robot);

  // Where the tubes are grasped (behind the front plate) and how far they are turned; a weight of 10 g at the tip.
  const ctcr::Joints<3> q{{-0.30, -0.22, -0.13}, {0.0, 1.0, 2.0}};
  const ctcr::TipLoad load{.force = {0, -0.0981, 0}};

  ctcr::Workspace<3> workspace;  // remembers the last solution: the next, nearby one is found faster
  ctcr::Solution<3> solution;
  const ctcr::Status status = ctcr::solve(model, q, load, workspace, solution);
  const Eigen::Quaterniond rotation(solution.rotation);
  std::printf("%s after %d evaluations\n", to_string(status), solution.iterations);
  std::printf("tip position [mm]  %7.2f %7.2f %7.2f\n", 1e3 * solution.position.x(), 1e3 * solution.position.y(),
              1e3 * solution.position.z());
  std::printf("tip quaternion     %7.4f %7.4f %7.4f %7.4f\n", rotation.w(), rotation.x(), rotation.y(), rotation.z());

  // The centreline at any arc length, and how strongly it is bent there.
  const std::vector<double> s{0.04, 0.08, 0.12, 0.16};
  std::vector<ctcr::ShapePoint<3>> points(s.size());
  if (shape(model, q, load, std::span(s), std::span(points), workspace, solution) != ctcr::Status::ok) return 1;
  std::printf("\n s [mm]    x [mm]    y [mm]    z [mm]  curvature of tube 1 [1/m]\n");
  for (const auto& point : points) {
    const ctcr::Vec3 p = 1e3 * point.bishop.position;
    std::printf("%7.1f %9.2f %9.2f %9.2f %10.2f\n", 1e3 * point.s, p.x(), p.y(), p.z(),
                point.tube[0].curvature.head<2>().norm());
  }
  return status == ctcr::Status::ok ? 0 : 1;
}

// Prints:
//   ok after 8 evaluations
//   tip position [mm]    33.37   -9.98  155.80
//   tip quaternion      0.9526  0.2546  0.1592 -0.0483
//
//    s [mm]    x [mm]    y [mm]    z [mm]  curvature of tube 1 [1/m]
//      40.0      0.98      0.21     39.97       4.75
//      80.0      8.19      2.47     79.19       3.23
//     120.0     20.17      2.83    117.32      10.57
//     160.0     32.53     -8.52    153.32      10.04
