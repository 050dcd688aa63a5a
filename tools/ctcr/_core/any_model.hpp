#pragma once
// A model whose number of tubes is known at run time: the border between numpy arrays and the templates.
#include <cstddef>
#include <cstdint>
#include <ctcr/core/status.hpp>
#include <ctcr/core/types.hpp>
#include <ctcr/robot/tube.hpp>
#include <memory>
#include <span>
#include <utility>

namespace ctcr::python {

/// Rows of joints and loads, each array row-major.
struct Rows {
  std::ptrdiff_t count;
  const double* beta;    ///< (count, N) [m]
  const double* alpha;   ///< (count, N) [rad]
  const double* force;   ///< (count, 3) [N], base frame; null: none
  const double* moment;  ///< (count, 3) [N m], base frame; null: none
};

/// Where the answers go, each array row-major. NaN where there is no solution.
struct Answers {
  double* position;    ///< (count, 3) [m], base frame
  double* quaternion;  ///< (count, 4), w first and not negative
  std::uint8_t* status;
  double* stability;      ///< (count,)
  double* jacobian;       ///< (count, 6, 2N); null: no derivative
  double* compliance;     ///< (count, 6, 6)
  double* by_parameters;  ///< (count, 6, parameters of tubes and gravity); null: not those
};

enum class Integrator : std::uint8_t { standard, ssp_rk3, classical_rk4, prince_dormand8 };

/// What all rows share.
struct Options {
  Integrator integrator = Integrator::standard;  ///< derivatives need the standard one
  int steps = 1;                                 ///< integration steps per segment
  int tip_of = 0;                                ///< tube whose tip is asked for, from 0
  int threads = 0;                               ///< 0: all cores
};

/// Where a shape goes, each array row-major with `room` places. NaN where a tube is not present.
struct ShapeArrays {
  std::size_t room;        ///< at least points + 2N
  double* arc_length;      ///< (room,) [m]
  double* position;        ///< (room, 3) [m], base frame
  double* quaternion;      ///< (room, 4), frame that does not twist, w first and not negative
  double* force;           ///< (room, 3) [N], internal, base frame
  double* moment;          ///< (room, 3) [N m], internal, base frame
  double* tube_angle;      ///< (N, room) [rad]
  double* tube_curvature;  ///< (N, room, 3) [1/m], tube frame
  double* tube_moment;     ///< (N, room, 3) [N m], tube frame
};

class AnyModel {
public:
  virtual ~AnyModel() = default;
  virtual void predict(const Rows& rows, const Answers& answers, const Options& options) const = 0;
  /// Shape at the one row of `row`, at `points` places and the breakpoints. @return status and places written
  virtual std::pair<Status, std::size_t> shape(const Rows& row, std::size_t points, int steps,
                                               const ShapeArrays& arrays) const = 0;
};

/// Defined for N = 1..4, which is the size of `tubes`.
template <int N>
std::unique_ptr<AnyModel> make_model(std::span<const Tube> tubes, const Vec3& gravity);

}  // namespace ctcr::python
