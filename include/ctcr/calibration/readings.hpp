#pragma once
// A table of readings beside what a system with other parameters would have read.
#include <algorithm>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "ctcr/parallel/batch.hpp"
#include "ctcr/pipeline/parameters.hpp"
#include "ctcr/pipeline/predict.hpp"

namespace ctcr {

/// One row of a table. What was not measured is NaN.
template <int N>
struct Reading {
  Joints<N> q;  ///< as recorded: what the nominal transmission makes of the motor angles
  TipLoad load;
  Pose measured;  ///< T_tracker_sensor
};

/// Residuals of a table of readings, and their exact derivatives, as functions of chosen parameters of the system.
///
/// A vector of parameters x holds values in the units of ParameterVector<N>; tracker.rotation is the turn of T_ref from
/// the nominal one about the tracker's axes, as one rotation vector [rad].
/// Each row starts from its own last solution, so that a small change of x costs little more than one evaluation a row.
/// Answers do not depend on the number of threads. Not for several callers at once. Real time: no.
template <int N>
class Readings {
  using P = SystemParameters<N, Standard>;

public:
  /// @param parameters  places of x in ParameterVector<N>
  /// @param pool        must outlive this
  Readings(const System<N>& nominal, std::vector<Reading<N>> rows, std::vector<int> parameters, ThreadPool& pool)
    : nominal_(nominal),
      rows_(std::move(rows)),
      parameters_(std::move(parameters)),
      pool_(&pool),
      theta_(rows_.size()),
      memory_(rows_.size()),
      active_(rows_.size(), true),
      workers_(std::size_t(pool.size())) {
    for (std::size_t i = 0; i < rows_.size(); ++i) theta_[i] = motor_angles(nominal.transmission, rows_[i].q);
  }

  [[nodiscard]] Eigen::Index size() const { return Eigen::Index(rows_.size()); }

  /// Values of the nominal system.
  [[nodiscard]] Eigen::VectorXd nominal() const { return P::values(nominal_)(parameters_); }
  /// The system with other values.
  [[nodiscard]] System<N> system(const Eigen::VectorXd& x) const {
    Eigen::VectorXd all = P::values(nominal_);
    all(parameters_) = x;
    return P::with_values(nominal_, all);
  }

  /// Residuals at x, six a row: measured - predicted position [m], rotation vector [rad], tracker axes. NaN where not
  /// measured and in rows left out.
  /// @param residual  (6 rows)   @param jacobian  its derivatives (6 rows, parameters), or null; both are resized
  /// @return whether every row that is not left out could be solved; those that could not are in unsolved(), and NaN
  bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
    const System<N> system = this->system(x);
    const Mat3 turning = left_jacobian(turn_of(x));
    residual.resize(6 * size());
    if (jacobian) jacobian->resize(6 * size(), x.size());
    std::vector<std::uint8_t> failed(rows_.size(), 0);
    const auto chunks = (size() + batch_chunk - 1) / batch_chunk;
    pool_->parallel_for(int(chunks), [&](int chunk, int worker) noexcept {
      Worker& w = workers_[std::size_t(worker)];
      const auto first = std::size_t(chunk * batch_chunk),
                 end = std::min(first + std::size_t(batch_chunk), rows_.size());
      w.workspace.reset();
      for (std::size_t i = first; i < end; ++i) {
        const auto at = Eigen::Index(6 * i);
        bool solved = false;
        if (active_[i]) {
          solved = solve_row(system, i, w);
          failed[i] = !solved;
        }
        if (solved && jacobian)
          solved = !(failed[i] = !with_derivatives(system, i, turning, w, residual.segment<6>(at), *jacobian));
        else if (solved)
          residual.segment<6>(at) = ctcr::residual(rows_[i].measured, w.prediction.reading);
        if (!solved) {
          residual.segment<6>(at).setConstant(std::numeric_limits<double>::quiet_NaN());
          if (jacobian) jacobian->middleRows<6>(at).setZero();
        }
      }
    });
    unsolved_.clear();
    for (std::size_t i = 0; i < rows_.size(); ++i)
      if (failed[i]) unsolved_.push_back(int(i));
    return unsolved_.empty();
  }

  /// Rows that could not be solved at the last call.
  [[nodiscard]] const std::vector<int>& unsolved() const { return unsolved_; }
  /// Rows to solve from now on; the others are left out.
  void activate(const std::vector<bool>& rows) { active_ = rows; }
  [[nodiscard]] const std::vector<bool>& active() const { return active_; }

private:
  struct Memory {
    TipGuess<N> guess;
    bool known = false;
  };
  struct alignas(64) Worker {
    Workspace<N> workspace;
    Prediction<N> prediction;
    PredictionDerivatives<N> derivatives;
  };

  bool solve_row(const System<N>& system, std::size_t i, Worker& w) noexcept {
    const Reading<N>& row = rows_[i];
    Workspace<N>& ws = w.workspace;
    if (memory_[i].known) {
      ws.guess = memory_[i].guess;
      ws.q = joints(system.transmission, theta_[i]);
      ws.load = row.load;
      ws.knows_joints = ws.knows_load = false;
      ws.warm = true;
    } else if (ws.warm && !detail::nearby(ws, Configuration<N>{joints(system.transmission, theta_[i]), row.load})) {
      ws.reset();
    }
    const bool solved = predict(system, theta_[i], row.load, ws, w.prediction) == Status::ok;
    if (!solved) ws.reset();
    memory_[i] = {ws.guess, solved};
    return solved;
  }

  bool with_derivatives(const System<N>& system, std::size_t i, const Mat3& turning, Worker& w,
                        Eigen::Ref<Vec6> residual, Eigen::MatrixXd& jacobian) noexcept {
    if (differentiate(system, theta_[i], w.workspace, w.prediction, w.derivatives) != Status::ok) return false;
    auto& by = w.derivatives.by_parameters;
    auto turned = by.template middleCols<3>(ParameterVector<N>::index(Parameter::tracker_rotation));
    turned = (turned * turning).eval();
    residual = ctcr::residual(rows_[i].measured, w.prediction, w.derivatives);
    for (std::size_t k = 0; k < parameters_.size(); ++k)
      jacobian.col(Eigen::Index(k)).template segment<6>(Eigen::Index(6 * i)) = by.col(parameters_[k]);
    return true;
  }

  Vec3 turn_of(const Eigen::VectorXd& x) const {
    Vec3 turn = Vec3::Zero();
    for (std::size_t k = 0; k < parameters_.size(); ++k) {
      const auto [kind, i] = ParameterVector<N>::entry(parameters_[k]);
      if (kind == Parameter::tracker_rotation) turn[i] = x[Eigen::Index(k)];
    }
    return turn;
  }

  System<N> nominal_;
  std::vector<Reading<N>> rows_;
  std::vector<int> parameters_;
  ThreadPool* pool_;
  std::vector<MotorAngles<N>> theta_;
  std::vector<Memory> memory_;
  std::vector<bool> active_;
  std::vector<Worker> workers_;
  std::vector<int> unsolved_;
};

}  // namespace ctcr
