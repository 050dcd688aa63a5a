#pragma once
// A table of readings of a robot whose number of tubes is known at run time.
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ctcr::python {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// What Readings<N> is made of; NaN where not measured.
struct Table {
  Eigen::VectorXd
      parameters;         ///< the nominal system, as ParameterVector<N>; tracker.rotation: rotation vector of T_ref
  int sensor_tube;        ///< from 0
  RowMajor beta, alpha;   ///< (rows, N) as recorded [m], [rad]
  RowMajor force;         ///< (rows, 3) [N], base frame
  RowMajor position;      ///< (rows, 3) [m], tracker frame
  RowMajor quaternion;    ///< (rows, 4) w first, tracker frame
  std::vector<int> free;  ///< places in ParameterVector<N>
  int steps, threads;
};

/// Readings<N> for some N.
class AnyReadings {
public:
  virtual ~AnyReadings() = default;
  virtual bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) = 0;
  [[nodiscard]] virtual Eigen::VectorXd nominal() const = 0;
  [[nodiscard]] virtual const std::vector<int>& unsolved() const = 0;
  [[nodiscard]] virtual const std::vector<bool>& active() const = 0;
  virtual void activate(const std::vector<bool>& rows) = 0;
};

/// What Python holds.
class BoundReadings {
public:
  explicit BoundReadings(std::unique_ptr<AnyReadings> readings) : readings_(std::move(readings)) {}
  AnyReadings& operator*() const { return *readings_; }

private:
  std::unique_ptr<AnyReadings> readings_;
};

/// Names and units of ParameterVector<N>.
struct ParameterNames {
  std::vector<std::string> names, units;
};

/// Defined for N = 1..4.
template <int N>
std::unique_ptr<AnyReadings> make_readings(const Table& table);
template <int N>
ParameterNames parameter_names();

}  // namespace ctcr::python
