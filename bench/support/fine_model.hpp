#pragma once
// The model integrated with 64 steps per segment, J and C by central differences: what the default is measured against.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <ctcr/ctcr.hpp>

#include "configurations.hpp"

namespace bench {

/// Relative error of a J or C: Frobenius norm of the difference over that of the reference, lengths in deployed lengths.
inline double relative_error(const ctcr::Mat6& found, const ctcr::Mat6& reference, double deployed_length) {
  const auto scaled = [deployed_length](ctcr::Mat6 m) {
    m.topRows<3>() /= deployed_length;
    m.leftCols<3>() *= deployed_length;
    return m;
  };
  return scaled(found - reference).norm() / scaled(reference).norm();
}

struct FineModel {
  bool converged = false;
  bool differentiable = false;  ///< J and C below are valid
  ctcr::Vec3 position = ctcr::Vec3::Zero();
  ctcr::Mat6 jacobian, compliance;

  FineModel(const ctcr::Robot<3>& robot, const Configuration& c) : model_(robot) {
    ctcr::Workspace<3> workspace;
    ctcr::Solution<3> solution;
    converged = solve(c, workspace, solution);
    position = solution.position;
    differentiable = converged && smallest_gap(robot, c.joints) > 3 * d_beta;
    for (int column = 0; column < 12 && differentiable; ++column) difference(c, workspace, column);
  }

private:
  static constexpr double d_beta = 1e-5, d_alpha = 1e-4, d_force = 1e-4, d_moment = 1e-5;

  bool solve(const Configuration& c, ctcr::Workspace<3>& workspace, ctcr::Solution<3>& solution) const {
    ctcr::Settings settings;
    settings.steps = 64;
    return ctcr::solve<ctcr::Derivatives::none>(model_, c.joints, c.load, workspace, solution, settings) ==
           ctcr::Status::ok;
  }

  void difference(const Configuration& c, const ctcr::Workspace<3>& start, int column) {
    const std::array<double, 4> steps{d_beta, d_alpha, d_force, d_moment};
    const double step = steps[std::size_t(column / 3)];
    std::array<ctcr::Solution<3>, 2> ends;
    for (int side = 0; side < 2; ++side) {
      Configuration moved = c;
      const std::array<ctcr::Vec3*, 4> inputs{&moved.joints.beta, &moved.joints.alpha, &moved.load.force,
                                              &moved.load.moment};
      (*inputs[std::size_t(column / 3)])[column % 3] += side == 0 ? -step : step;
      ctcr::Workspace<3> workspace = start;
      differentiable = differentiable && solve(moved, workspace, ends[std::size_t(side)]);
    }
    const Eigen::AngleAxisd turn(ctcr::Mat3(ends[1].rotation * ends[0].rotation.transpose()));
    ctcr::Vec6 slope;
    slope << ends[1].position - ends[0].position, turn.angle() * turn.axis();
    (column < 6 ? jacobian : compliance).col(column % 6) = slope / (2 * step);
  }

  /// Smallest distance between two of: the plate, tube tips, curved starts [m]. J has a kink where it is zero.
  static double smallest_gap(const ctcr::Robot<3>& robot, const ctcr::Joints<3>& q) {
    std::array<double, 7> points{};
    for (std::size_t i = 0; i < 3; ++i) {
      points[2 * i] = robot.tubes[i].length + q.beta[Eigen::Index(i)];
      points[2 * i + 1] = points[2 * i] - robot.tubes[i].curved_length;
    }
    std::sort(points.begin(), points.end());
    double gap = points[1] - points[0];
    for (std::size_t i = 1; i < points.size(); ++i) gap = std::min(gap, points[i] - points[i - 1]);
    return gap;
  }

  ctcr::Model<3> model_;
};

}  // namespace bench
