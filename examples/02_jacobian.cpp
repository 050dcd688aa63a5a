// How the tip moves with the joints (J) and with a load (C), and how good it is to trust them for small changes.
#include <cstdio>
#include <ctcr/ctcr.hpp>

namespace {

void print(const char* what, const ctcr::Vec3& metres) {
  std::printf("%-34s %8.4f %8.4f %8.4f mm\n", what, 1e3 * metres.x(), 1e3 * metres.y(), 1e3 * metres.z());
}

}  // namespace

int main() {
  const auto tube = [](double inner_diameter, double outer_diameter, double length, double curvature) {
    return ctcr::Tube{.youngs_modulus = 58e9,
                      .poisson_ratio = 0.3,
                      .density = 6450,
                      .inner_diameter = inner_diameter,
                      .outer_diameter = outer_diameter,
                      .length = length,
                      .curved_length = 0.05,
                      .curvature = curvature};
  };
  ctcr::Robot<3> robot;
  robot.tubes = {tube(1.30e-3, 1.52e-3, 0.463, 10), tube(1.62e-3, 1.80e-3, 0.3305, 5),
                 tube(2.03e-3, 2.35e-3, 0.199, 7)};
  robot.gravity = {0, -9.80665, 0};  // the robot points horizontally, its y axis up
  const ctcr::Model<3> model(robot);
  const ctcr::Joints<3> q{{-0.30, -0.22, -0.13}, {0.0, 1.0, 2.0}};

  // J: 6 x 6, columns beta_1..3 [m], alpha_1..3 [rad]. C: 6 x 6, columns force [N], moment [N m].
  // Rows of both: the tip's translation [m] and rotation [rad], base frame. Exact, and computed with the pose.
  ctcr::Workspace<3> workspace;
  ctcr::Solution<3> here, moved, loaded;
  if (ctcr::solve<ctcr::Derivatives::compliance>(model, q, {}, workspace, here) != ctcr::Status::ok) return 1;

  // Push tube 1 by 0.5 mm and turn tube 2 by 1 degree.
  ctcr::Joints<3> target = q;
  target.beta[0] += 0.5e-3;
  target.alpha[1] += 0.0175;
  Eigen::Vector<double, 6> change;
  change << target.beta - q.beta, target.alpha - q.alpha;
  if (ctcr::solve(model, target, {}, workspace, moved) != ctcr::Status::ok) return 1;
  print("small move: predicted by J", (here.jacobian * change).head<3>());
  print("small move: solved", moved.position - here.position);

  // Hang 10 g on the tip.
  const ctcr::TipLoad weight{.force = {0, -0.010 * 9.81, 0}};
  if (ctcr::solve(model, q, weight, workspace, loaded) != ctcr::Status::ok) return 1;
  print("10 g at the tip: predicted by C", here.compliance.topLeftCorner<3, 3>() * weight.force);
  print("10 g at the tip: solved", loaded.position - here.position);
  return 0;
}

// Prints:
//   small move: predicted by J           0.2429   0.1557   0.4648 mm
//   small move: solved                   0.2423   0.1573   0.4649 mm
//   10 g at the tip: predicted by C     -0.0689  -4.3366  -0.4647 mm
//   10 g at the tip: solved             -0.1013  -4.2872  -0.5354 mm
