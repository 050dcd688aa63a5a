#pragma once
// Closed loops of robots whose number of tubes is known at run time.
#include <cstdint>
#include <ctcr/control/control_state.hpp>
#include <functional>
#include <vector>

#include "any_recording.hpp"

namespace ctcr::python {

/// A system as its parameters, in the order of SystemParameters<N, Catalogue>.
struct SystemValues {
  Eigen::VectorXd parameters;  ///< as Table::parameters
  Eigen::VectorXd effects;     ///< as Table::effects; empty: the standard model
  int steps = 1;               ///< as Settings::steps
};

/// Weights and settings of the tasks, in the order of the task list.
struct TaskValues {
  RowMajor weights;  ///< (tasks, 2) of translation and rotation
  double gain, correction, tracking_tolerance;
  double damping_translation, damping_rotation;
  double avoidance_rate, comfort;
  Eigen::Vector3d obstacle;
  double obstacle_radius, strength, range;
  double stability, stability_rate;
  Eigen::VectorXd posture_beta, posture_alpha;
  double posture_rate;
};

struct LimitValues {
  double base_gap, tip_gap, translation_speed, rotation_speed;
  Eigen::VectorXd beta_low, beta_high;
  bool redistribute;
};

struct LoopResult;

/// A robot outside of this module, with the calls of a Device; each says whether the loop may go on.
struct AnyDevice {
  /// Motor angles (2N,) [rad], and position and rotation of the reading.
  std::function<bool(Eigen::VectorXd&, Eigen::Vector3d&, Eigen::Matrix3d&)> measure;
  std::function<bool(const Eigen::VectorXd& velocity, double period)> move;  ///< velocity (2N,) of motors [rad/s]
  std::function<bool(const LoopResult& so_far, Eigen::Index row)> record;    ///< that row is complete
};

/// A path of a kind known at run time.
struct AnyPath {
  std::function<Reference(double)> at_time;
  double seconds;
  [[nodiscard]] double duration() const noexcept { return seconds; }
  [[nodiscard]] Reference at(double t) const noexcept { return at_time(t); }
};

/// From rest to rest through points [m], base frame, on a spline or straight from one to the next.
AnyPath path_through(const std::vector<Vec3>& points, bool spline, double speed, double acceleration);

/// One run of a scenario.
struct LoopRequest {
  SystemValues controller, plant;
  TaskValues tasks;
  LimitValues limits;
  RowMajor points;  ///< (points, 3) of the path [m], plant's base frame
  bool spline;
  double speed, acceleration, period, settle;
  Eigen::VectorXd beta, alpha;  ///< where the robot starts to settle
  Eigen::Vector3d force;        ///< at the plant's tip [N]
  std::string tip_force;        ///< what the controller makes of it: unknown, known, estimated
  double noise_position, noise_rotation;
  std::uint64_t seed;
  double reading_age;                 ///< [s], as Controller::reading_age
  const AnyDevice* device = nullptr;  ///< instead of the plant, of which only the frames count; neither load nor noise
};

/// What happened, one row a period. Positions [m] in the plant's base frame, where the path is given. On a device the tip
/// is that measured.
struct LoopResult {
  std::string status;  ///< of the plant at the end, in words; "start refused" and why
  bool started = false;
  double settled;  ///< distance to the path's start after settling [m]
  Eigen::VectorXd time;
  RowMajor joints;       ///< (rows, 2N) that the motors hold, as the controller believes
  RowMajor tip, wanted;  ///< (rows, 3) without noise
  RowMajor shortfall;    ///< (rows, tasks)
  Eigen::MatrixXi held;  ///< (rows, 4): bits of base gaps, of tip gaps, of travel; speed
  RowMajor force;        ///< (rows, 3) that the controller's model had [N]
  Eigen::VectorXd stability;
  Eigen::VectorXi model_status;
};

template <int N>
LoopResult closed_loop(const LoopRequest& request);

/// Blocks of random configurations under wrong parameters; see ctcr::tip_sensitivity.
struct SensitivityRequest {
  SystemValues nominal;
  RowMajor varied;            ///< (systems, parameters): two neighbours are the ends of one parameter's range
  Eigen::VectorXd low, high;  ///< of all together
  double most_force;          ///< [N]
  std::uint64_t seed, first_block;
  int blocks, configurations, threads;
};

/// Each array has a row a block and a column a system, the last one for all together.
struct SensitivityResult {
  Eigen::MatrixXi count, unsolved;
  RowMajor sum, sum_of_squares, maximum;  ///< of tip errors [m]
  RowMajor histogram;                     ///< (systems + 1, bins), of all blocks
  double evaluations;                     ///< of the model
};

template <int N>
SensitivityResult sensitivity(const SensitivityRequest& request);

}  // namespace ctcr::python
