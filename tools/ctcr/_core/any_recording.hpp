#pragma once
// A recording of a robot whose number of tubes is known at run time.
#include <Eigen/Core>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "any_model.hpp"

namespace ctcr::python {

/// What Recording<N, Fx> is made of; NaN where not measured.
struct Table {
  Eigen::VectorXd
      parameters;           ///< the nominal system, as ParameterVector<N>; tracker.rotation: rotation vector of T_ref
  Eigen::VectorXd effects;  ///< values of all parameters of the catalogue
  int sensor_tube;          ///< from 0
  RowMajor beta, alpha;     ///< (rows, N) as recorded [m], [rad]
  RowMajor force;           ///< (rows, 3) [N], base frame
  RowMajor position;        ///< (rows, 3) [m], tracker frame
  RowMajor quaternion;      ///< (rows, 4) w first, tracker frame
  Eigen::VectorXd time;     ///< (rows) [s], NaN: unknown
  Eigen::VectorXd part;     ///< (rows) of the session's duration, 0 to 1
  Eigen::VectorXi run;      ///< (rows)
  Eigen::Vector3d centre;   ///< of all measured positions, tracker frame [m]
  std::vector<int> free;    ///< indices in SystemParameters<N, Catalogue>
  int steps, threads;
  bool from_home;     ///< whether the robot came to the first row straight from home
  RowMajor profiles;  ///< (nodes, 3 N) of each tube: curvature x, y added [1/m], relative change of EI; or empty
};

/// Recording<N, Fx> for some N, with or without effects.
class AnyRecording {
public:
  virtual ~AnyRecording() = default;
  virtual bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) = 0;
  [[nodiscard]] virtual Eigen::VectorXd nominal() const = 0;
  [[nodiscard]] virtual const std::vector<int>& unsolved() const = 0;
  [[nodiscard]] virtual const std::vector<bool>& active() const = 0;
  virtual double solve_friction(const Eigen::VectorXd& x) = 0;
  [[nodiscard]] virtual bool friction_is_solved() const = 0;
  virtual void begin_at(const AnyRecording& other) = 0;
  virtual void activate(const std::vector<bool>& rows) = 0;
  /// T_tracker_sensor as predicted at the last call: (rows, 3) [m], (rows, 4) w first; NaN where not solved.
  virtual void predicted(RowMajor& position, RowMajor& quaternion) const = 0;
};

/// A parameter of ParameterVector<N>.
struct ParameterInfo {
  std::string name;        ///< such as "tubes.2.length"
  std::string kind;        ///< its name in parameter_kinds: '#' for the number of the tube, '*' for the axis
  std::string unit;        ///< SI
  int index;               ///< of its tube or axis, from 0
  double lowest, highest;  ///< possible values
};

/// Values of a parameter of an effect.
struct CatalogueParameter {
  std::string effect, name, unit, meaning;
  double neutral, sigma, soft_low, soft_high, hard_low, hard_high;
  bool per_tube;
  std::string kind;      ///< as Role
  std::string quantity;  ///< as Quantity
  int first;             ///< index of its first value among those of the catalogue
};
/// An effect as its EffectInfo and its hooks describe it.
struct CatalogueEntry {
  std::string id, title, physics, signature, measure, look_alikes, reference;
  bool order, time, orientation, loads, gravity;
  double form_error;
  std::vector<std::string> acts_on;                   ///< as ActsOn
  std::vector<std::vector<std::string>> variants;     ///< names of parameters; at least one
  std::vector<std::map<std::string, double>> starts;  ///< values of parameters; may be empty
};

/// Defined for modelled_tubes.
/// @throws std::invalid_argument unless the arrays fit together
template <int N>
std::unique_ptr<AnyRecording> make_recording(const Table& table);
template <int N>
std::vector<ParameterInfo> robot_parameters();
template <int N>
std::vector<CatalogueParameter> catalogue_parameters();

}  // namespace ctcr::python
