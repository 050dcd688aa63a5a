// One unloaded tube, a straight line and then an arc, solved through the installed headers.
#include <cmath>
#include <cstdio>
#include <ctcr/ctcr.hpp>

int main() {
  ctcr::Robot<1> robot{};
  robot.tubes[0] = {.youngs_modulus = 60e9,
                    .inner_diameter = 1.0e-3,
                    .outer_diameter = 1.4e-3,
                    .length = 0.10,
                    .curved_length = 0.04,
                    .curvature = 10.0};
  ctcr::Joints<1> joints{};
  joints.beta[0] = -0.02;

  const ctcr::Model<1> model{robot};
  ctcr::Workspace<1> workspace{};
  ctcr::Solution<1> solution{};
  const ctcr::Status status = ctcr::solve<ctcr::Derivatives::jacobian>(model, joints, {}, workspace, solution, {});

  const double angle = 0.04 * 10.0, straight = 0.04;
  const double z = straight + std::sin(angle) / 10.0, lateral = (1.0 - std::cos(angle)) / 10.0;
  const double error = std::hypot(solution.position.z() - z, solution.position.head<2>().norm() - lateral);
  std::printf("%s, tip %.1e m from the arc\n", ctcr::to_string(status), error);
  return status == ctcr::Status::ok && error < 1e-6 ? 0 : 1;
}
