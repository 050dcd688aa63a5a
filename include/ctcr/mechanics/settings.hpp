#pragma once

namespace ctcr {

struct Settings {
  int max_iterations = 300;  ///< evaluations after which a solve is given up; it takes up to 4 in any case
  double tolerance = 1e-10;  ///< on ||b|| [rad], and on the force of contacts at the tip [N]
  int steps = 1;             ///< factor on the integration steps of every segment to begin with, >= 1
  /// Largest error of integration at the tip, as a part of the robot's length: solve() takes more steps until its
  /// estimate is below. Infinity: each segment takes `steps`, as it always does in the schemes of integrators.hpp.
  double accuracy = 1e-4;
  int max_steps = 64;   ///< steps per segment at which solve() stops refining, >= steps
  int evaluations = 2;  ///< that one step() may use, >= 1
};

}  // namespace ctcr
