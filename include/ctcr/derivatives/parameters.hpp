#pragma once
// Derivatives of a tube tip's pose by all parameters of the mechanics, by the implicit function theorem:
// residual b(u, p) = 0 and pose x(u, p) are differentiated along the unknowns u and all p in one set of passes, and
// eliminating u leaves dx/dp.
#include <numbers>

#include "ctcr/derivatives/tip_pass.hpp"
#include "ctcr/robot/parameters.hpp"

namespace ctcr {

/// Derivatives of the pose of one tube's tip. Rows: position [m], rotation [rad], both in base axes, as J.
template <int N>
struct TipDerivatives {
  /// Columns beta_1..N [m], alpha_1..N [rad].
  Eigen::Matrix<double, 6, 2 * N> by_joints = Eigen::Matrix<double, 6, 2 * N>::Zero();
  /// Columns as ParameterVector<N>, up to gravity.
  Eigen::Matrix<double, 6, ParameterVector<N>::robot_count> by_parameters =
      Eigen::Matrix<double, 6, ParameterVector<N>::robot_count>::Zero();
};

namespace detail {

/// Derivatives of a tube's tip by the variables before `end`, the unknowns eliminated.
template <int N, bool Loaded, class Stepper>
class TipSystem {
public:
  using V = TipVariables<N, Loaded>;

  TipSystem(const Robot<N>& robot, const Workspace<N>& at, int tube, int end) noexcept {
    for (int pass = 0; pass < V::passes(end); ++pass)
      rotation_ = TipPass<N, Loaded, Stepper>(robot, at, tube, pass * V::pass_lanes).write(row_);
    constexpr auto lane = [](int j) constexpr { return j; };
    det_ = eliminate<V::unknowns>(row_, lane);
    if constexpr (Loaded) det_ = -det_;  // three rows carry the opposite sign
  }

  [[nodiscard]] double det() const noexcept { return det_; }
  /// R_base_tip as integrated.
  [[nodiscard]] const Mat3& rotation() const noexcept { return rotation_; }
  [[nodiscard]] Vec6 by(int variable) const noexcept {
    Vec6 column;
    for (int k = 0; k < 6; ++k) column[k] = row_[V::unknowns + k][variable];
    return column;
  }

private:
  typename V::Row row_[V::rows] = {};
  Mat3 rotation_;
  double det_;
};

/// Chain rule from the coefficients of tube i to the parameters of its data sheet.
template <int N, class System>
void put_tube(const System& system, const Tube& t, int i, TipDerivatives<N>& out) noexcept {
  using V = typename System::V;
  constexpr double pi = std::numbers::pi;
  const auto column = [&](Parameter kind) { return out.by_parameters.col(ParameterVector<N>::index(kind, i)); };
  const double stretch = 1.0 / (1.0 + t.poisson_ratio), outer = t.outer_diameter, inner = t.inner_diameter;
  const Vec6 by_GJ = system.by(V::kz + i), by_EI = system.by(V::k + i) + by_GJ * stretch;
  column(Parameter::poisson_ratio) = by_GJ * (-t.GJ() * stretch);
  column(Parameter::length) = system.by(V::length + i);
  column(Parameter::curved_length) = system.by(V::curved_length + i);
  column(Parameter::curvature) = system.by(V::kappa + i);
  if (t.bending_stiffness > 0) {
    column(Parameter::bending_stiffness) = by_EI;
  } else {
    column(Parameter::youngs_modulus) = by_EI * t.second_moment();
    column(Parameter::outer_diameter) = by_EI * (t.youngs_modulus * pi / 16 * outer * outer * outer);
    column(Parameter::inner_diameter) = by_EI * (-t.youngs_modulus * pi / 16 * inner * inner * inner);
  }
  if constexpr (V::alpha > V::mass) {
    const Vec6 by_mass = system.by(V::mass + i);
    column(Parameter::density) = by_mass * (pi / 4 * (outer * outer - inner * inner));
    column(Parameter::outer_diameter) += by_mass * (t.density * pi / 2 * outer);
    column(Parameter::inner_diameter) -= by_mass * (t.density * pi / 2 * inner);
  }
}

/// By joints and tubes.
template <int N, class System>
void put_columns(const System& system, const Robot<N>& robot, TipDerivatives<N>& out) noexcept {
  using V = typename System::V;
  for (int i = 0; i < N; ++i) {
    out.by_joints.col(i) = system.by(V::beta + i);
    out.by_joints.col(N + i) = system.by(V::alpha + i);
    put_tube(system, robot.tubes[std::size_t(i)], i, out);
  }
}

template <int N, class Stepper>
void put_gravity(const TipSystem<N, true, Stepper>& system, TipDerivatives<N>& out) noexcept {
  constexpr int gravity = ParameterVector<N>::index(Parameter::gravity);
  for (int j = 0; j < 3; ++j) out.by_parameters.col(gravity + j) = system.by(TipVariables<N, true>::gravity + j);
}

/// The workspace with the actual tip frame as its guess: without a load a guess may leave turns open, on which only loads
/// depend.
template <class Stepper, int N>
Workspace<N> with_tip_frame(const Robot<N>& robot, const Workspace<N>& ws) noexcept {
  Workspace<N> found = ws;
  typename TipVariables<N, true>::Row unused[TipVariables<N, true>::rows];
  if (robot.gravity.isZero(0.0)) found.guess.rotation = TipPass<N, true, Stepper>(robot, ws, 0, 0).write(unused);
  return found;
}

inline Status status_of(double det) noexcept { return det < singular_det ? Status::singular : Status::ok; }

template <class Stepper, int N>
Status differentiate_unloaded(const Robot<N>& robot, const Workspace<N>& ws, int tube,
                              TipDerivatives<N>& out) noexcept {
  const TipSystem<N, false, Stepper> system(robot, ws, tube, TipVariables<N, false>::count);
  put_columns(system, robot, out);
  Workspace<N> found = ws;
  found.guess.rotation = system.rotation();
  put_gravity(TipSystem<N, true, Stepper>(robot, found, tube, TipVariables<N, true>::beta), out);
  return status_of(system.det());
}

template <class Stepper, int N>
Status differentiate_loaded(const Robot<N>& robot, const Workspace<N>& ws, int tube, TipDerivatives<N>& out,
                            Mat6* compliance) noexcept {
  using V = TipVariables<N, true>;
  const TipSystem<N, true, Stepper> system(robot, with_tip_frame<Stepper>(robot, ws), tube,
                                           compliance ? V::count : V::load);
  put_columns(system, robot, out);
  put_gravity(system, out);
  if (compliance)
    for (int j = 0; j < 6; ++j) compliance->col(j) = system.by(V::load + j);
  return status_of(system.det());
}

}  // namespace detail

/// Exact derivatives, of the discretised model, of the pose of a tube's tip by the joints and by all tube parameters
/// and gravity, at the configuration that `ws` was last solved for.
///
/// bending_stiffness replaces Young's modulus and the diameters where it is given: those of the two that have no effect
/// get zero columns. Where two breakpoints coincide the derivatives are one-sided. A tube of no curvature counts as
/// curved, for its derivatives by curvature: its curve then starts at a breakpoint that solve() does not have. Those by
/// gravity at zero gravity are of the model with weight, integrated in as many steps.
/// @param ws    as solve() or step() left it for this model   @param tube  whose tip, 0 is the innermost
/// @return ok; singular: near a bifurcation, large derivatives; not_converged: `ws` holds no solution; invalid_settings:
///         there is no such tube; not_finite. The last three leave zeros. Real time: yes, about N + 1 integrations with
///         eight columns each.
template <class Stepper = MagnusRk4, int N>
CTCR_NOINLINE Status differentiate_tip(const Model<N>& model, const Workspace<N>& ws, int tube,
                                       TipDerivatives<N>& out) noexcept {
  const bool exists = tube >= 0 && tube < N;
  Status status = exists ? Status::not_converged : Status::invalid_settings;
  const bool loaded = !model.robot().gravity.isZero(0.0) || !ws.load.force.isZero(0.0) || !ws.load.moment.isZero(0.0);
  if (!exists || !ws.warm)
    out = {};
  else if (loaded)
    status = detail::differentiate_loaded<Stepper>(model.robot(), ws, tube, out, nullptr);
  else
    status = detail::differentiate_unloaded<Stepper>(model.robot(), ws, tube, out);
  if (out.by_joints.allFinite() && out.by_parameters.allFinite()) return status;
  out = {};
  return Status::not_finite;
}

/// As above, and by force [N] and moment [N m] at the robot tip, base axes: the compliance of the tube's tip. By the
/// equations with load, which solve<Derivatives::compliance>() integrates too, whether or not there is one.
template <class Stepper = MagnusRk4, int N>
CTCR_NOINLINE Status differentiate_tip(const Model<N>& model, const Workspace<N>& ws, int tube, TipDerivatives<N>& out,
                                       Mat6& compliance) noexcept {
  const bool exists = tube >= 0 && tube < N;
  Status status = exists ? Status::not_converged : Status::invalid_settings;
  if (exists && ws.warm) {
    status = detail::differentiate_loaded<Stepper>(model.robot(), ws, tube, out, &compliance);
    if (out.by_joints.allFinite() && out.by_parameters.allFinite() && compliance.allFinite()) return status;
    status = Status::not_finite;
  }
  out = {};
  compliance.setZero();
  return status;
}

}  // namespace ctcr
