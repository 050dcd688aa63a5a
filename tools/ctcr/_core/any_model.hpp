#pragma once
// A model whose number of tubes is known at run time: the border between numpy arrays and the templates.
#include <Eigen/Core>
#include <cstdint>
#include <ctcr/core/status.hpp>
#include <memory>
#include <vector>

namespace ctcr::python {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Joints and loads of M configurations.
struct Configurations {
  RowMajor beta, alpha;    ///< (M, N) [m], [rad]
  RowMajor force, moment;  ///< (M, 3) at the robot tip [N], [N m], base frame; or empty: none
};

enum class Integrator : std::uint8_t { standard, ssp_rk3, classical_rk4, prince_dormand8 };

struct PredictOptions {
  Integrator integrator = Integrator::standard;  ///< derivatives and effects need the standard one
  int steps = 1;                                 ///< as Settings::steps
  int tip_of = 0;                                ///< tube whose tip is asked for, from 0
  int threads = 0;                               ///< 0: all cores
  bool derivatives = false;                      ///< by joints and load
  std::vector<int> by_parameters{};  ///< and by these: of tubes, gravity and effects, as SystemParameters<N, Catalogue>
};

/// Poses of M tips, base frame. NaN where there is no solution.
struct Poses {
  RowMajor position, quaternion;  ///< (M, 3) [m]; (M, 4), w first and not negative
  Eigen::VectorX<std::uint8_t> status;
  Eigen::VectorXd stability;
  RowMajor jacobian, compliance, by_parameters;  ///< (M, 6 x any): a row-major matrix of six rows each; or empty
};

/// A robot at K arc lengths. NaN where a tube is not present.
struct ShapeArrays {
  Status status;
  double stability;
  Eigen::VectorXd arc_length;            ///< (K) [m]
  RowMajor position, quaternion;         ///< (K, 3) [m]; (K, 4) of the Bishop frame, w first and not negative
  RowMajor force, moment;                ///< (K, 3) internal, of all tubes, base frame [N], [N m]
  RowMajor tube_angle;                   ///< (N, K) [rad]
  RowMajor tube_curvature, tube_moment;  ///< (N, 3 K) [1/m], [N m], tube frame
};

class AnyModel {
public:
  virtual ~AnyModel() = default;
  /// @throws std::invalid_argument unless the arrays and options fit together
  [[nodiscard]] virtual Poses predict(const Configurations& rows, const PredictOptions& options) const = 0;
  /// Shape at the one configuration of `row`, at `points` uniform arc lengths and the breakpoints; with `all` those of
  /// all stable equilibria there, that one first.
  [[nodiscard]] virtual std::vector<ShapeArrays> shapes(const Configurations& row, int points, int steps,
                                                        bool all) const = 0;
};

/// Defined for modelled_tubes.
/// @param parameters  of tubes and gravity, the first of ParameterVector<N>   @param effects  values of all of the catalogue; empty: the standard model
template <int N>
std::unique_ptr<AnyModel> make_model(const Eigen::VectorXd& parameters, const Eigen::VectorXd& effects);

}  // namespace ctcr::python
