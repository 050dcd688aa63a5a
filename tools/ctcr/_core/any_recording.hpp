#pragma once
// A recording of a robot with effects whose number of tubes is known at run time.
#include "any_readings.hpp"

namespace ctcr::python {

/// A table of readings with what effects need besides. `free` holds places in SystemParameters<N, Catalogue>.
struct RecordedTable : Table {
  Eigen::VectorXd effects;  ///< values of all parameters of the catalogue
  Eigen::VectorXd time;     ///< (rows) [s], NaN: unknown
  Eigen::VectorXi run;      ///< (rows)
  Eigen::Vector3d centre;   ///< of all measured positions, tracker frame [m]
  Eigen::VectorXd part;     ///< (rows) of the session's duration, 0 to 1
  RowMajor profiles;        ///< (nodes, 3 N) of each tube: curvature x, y added [1/m], relative change of EI; or empty
};

class AnyRecording : public AnyReadings {
public:
  /// T_tracker_sensor as predicted at the last call: (rows, 3) [m], (rows, 4) w first; NaN where not solved.
  virtual void predicted(RowMajor& position, RowMajor& quaternion) const = 0;
};

/// Values of a parameter of an effect.
struct CatalogueParameter {
  std::string effect, name, unit, meaning;
  double neutral, sigma, soft_low, soft_high, hard_low, hard_high;
  bool per_tube, shape;
  int first;  ///< place of its first value among those of the catalogue
};
/// An effect in words.
struct CatalogueEntry {
  std::string id, title, physics, signature, measure, look_alikes, reference;
  bool order, time, orientation, loads, gravity;
};

/// Defined for N = 1..4.
template <int N>
std::unique_ptr<AnyRecording> make_recording(const RecordedTable& table);
template <int N>
std::vector<CatalogueParameter> catalogue_parameters();
template <int N>
std::vector<std::string> system_parameter_names();

}  // namespace ctcr::python
