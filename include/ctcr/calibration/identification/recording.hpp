#pragma once
// A table of readings beside what a system with other parameters would have read.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "ctcr/friction/solve_friction.hpp"
#include "ctcr/parallel/batch.hpp"
#include "ctcr/recording/derivatives.hpp"

namespace ctcr {

/// The branch of a row's equilibria that came nearest to its reading.
template <int N>
struct NearestEquilibrium {
  WarmStart<N> start;  ///< the last solution on it
  /// Smallest |residual|^2 on it [m^2, rad^2]; infinite: none is known.
  double missed = std::numeric_limits<double>::infinity();

  void improve(const WarmStart<N>& other, double misses, bool same_branch = false) noexcept {
    if (same_branch || misses <= missed) *this = {other, std::min(misses, missed)};
  }
};

/// Residuals of a recording, and their exact derivatives, as functions of chosen parameters of the system.
///
/// A vector of parameters x holds values of SystemParameters<N, Fx>; those of a turn from the nominal frame are one
/// rotation vector [rad]. Rows stand in the order in which they were recorded. Where a robot may rest in several
/// equilibria, the reading tells which one it was in: each row stays on the branch of the solution that was nearest to its
/// reading. Answers do not depend on the number of threads. Not for several callers at once. Real time: no.
/// @tparam Fx  the effects of the system
template <int N, class Fx = Standard>
class Recording {
  using P = SystemParameters<N, Fx>;
  using HistoryOfRow = typename Fx::template On<N>::History;
  static constexpr std::array turns{Parameter::tracker_rotation, Parameter::sensor_rotation};

public:
  /// @param measured    T_tracker_sensor of each row, NaN where not measured
  /// @param parameters  indices of x in SystemParameters<N, Fx>
  /// @param pool        must outlive this
  Recording(const System<N, Fx>& nominal, std::vector<RecordedRow<N>> rows, std::vector<Pose> measured,
            std::vector<int> parameters, ThreadPool& pool)
    : nominal_(nominal),
      rows_(std::move(rows)),
      measured_(std::move(measured)),
      parameters_(std::move(parameters)),
      columns_(with_whole_turns(parameters_)),
      pool_(&pool),
      equilibria_(rows_.size()),
      predicted_(rows_.size()),
      active_(rows_.size(), true),
      workers_(std::size_t(pool.size())) {}

  [[nodiscard]] Eigen::Index size() const { return Eigen::Index(rows_.size()); }

  /// Values of the nominal system.
  [[nodiscard]] Eigen::VectorXd nominal() const { return P::values(nominal_)(parameters_); }
  /// The system with other values.
  [[nodiscard]] System<N, Fx> system(const Eigen::VectorXd& x) const {
    Eigen::VectorXd all = P::values(nominal_);
    all(parameters_) = x;
    return P::with_values(nominal_, all);
  }

  /// Residuals at x, six a row: measured - predicted position [m], rotation vector [rad], tracker axes. NaN where not
  /// measured and in rows left out.
  /// @param residual  (6 rows)   @param jacobian  its derivatives (6 rows, parameters), or null; both are resized
  /// @return whether every row that is not left out could be solved; those that could not are in unsolved(), and NaN
  bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
    const System<N, Fx> system = this->system(x);
    const RecordedPath<N> path = recorded_path<N, Fx>(system, rows_, *torsion_);
    const std::vector<HistoryOfRow> history = histories<N, Fx>(system, rows_, path);
    const auto sensitivities = jacobian ? std::optional(history_sensitivities(system, path)) : std::nullopt;
    std::array<Mat3, turns.size()> turning;
    for (std::size_t t = 0; t < turns.size(); ++t) turning[t] = left_jacobian(turn_of(x, turns[t]));
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
        bool solved = active_[i] && solve_row(system, history[i], i, w);
        if (solved && jacobian) solved = differentiate_row(system, i, sensitivities->at(i), turning, w, *jacobian);
        if (active_[i]) failed[i] = !solved;
        if (solved) {
          residual.segment<6>(at) = ctcr::residual(measured_[i], w.prediction.reading);
          predicted_[i] = w.prediction.reading;
          const auto misses = residual.segment<6>(at).array().square();
          equilibria_[i].improve(w.workspace, misses.isFinite().select(misses, 0).sum(),
                                 w.prediction.solution.kept_branch);
        } else {
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

  /// Solves friction along the recording at x (see ctcr::solve_friction). Until the next call the torsion is extrapolated
  /// from there. @return the largest change of the torsion [rad], at least 1e-4; 0 without friction
  double solve_friction(const Eigen::VectorXd& x) {
    if constexpr (Fx::template On<N>::depends_on_torsion && N > 1) {
      constexpr double settled = 1e-4;  // [rad], less than matters
      const System<N, Fx> system = this->system(x);
      if (!system.model.effects().act_by_torsion()) return 0;
      const Eigen::VectorXd at = P::values(system);
      auto torsion = std::make_shared<LinearisedTorsion<N>>();
      for (const int v : columns_)
        if (detail::reaches<N, Fx>[std::size_t(v)] != detail::Reach::reading) torsion->variables.push_back(v);
      const bool is_there = at.size() == solved_at_.size() && at == solved_at_;
      if (is_there && std::ranges::includes(sorted(torsion_->variables), sorted(torsion->variables))) return settled;
      torsion->equilibria = torsion_->equilibria;
      torsion_->extrapolate(at, rows_);
      solved_at_ = at;
      const double moved = ctcr::solve_friction<N, Fx>(system, rows_, *pool_, torsion.get());
      torsion_ = std::move(torsion);
      return std::max(settled, moved);
    }
    return 0;
  }

  /// Whether friction was solved.
  [[nodiscard]] bool friction_is_solved() const { return solved_at_.size() > 0; }

  /// Takes over the friction of another recording of the same table: with similar values little is left to solve.
  void begin_at(const Recording& other) {
    const auto like = [](const RecordedRow<N>& a, const RecordedRow<N>& b) { return a.samples() == b.samples(); };
    if (!other.friction_is_solved() || !std::ranges::equal(rows_, other.rows_, like)) return;
    for (std::size_t i = 0; i < rows_.size(); ++i) rows_[i].torsion = other.rows_[i].torsion;
    torsion_ = other.torsion_;
    solved_at_ = other.solved_at_;
  }

  /// Of each row the branch that came nearest to its reading.
  [[nodiscard]] const std::vector<NearestEquilibrium<N>>& equilibria() const { return equilibria_; }
  /// Takes over the equilibria of another recording of the same table, perhaps with other effects, where they are nearer.
  void begin_in(const std::vector<NearestEquilibrium<N>>& others) {
    if (others.size() != equilibria_.size()) return;
    for (std::size_t i = 0; i < others.size(); ++i) equilibria_[i].improve(others[i].start, others[i].missed);
  }

  /// T_tracker_sensor as predicted at the last call; meaningless in rows that were not solved.
  [[nodiscard]] const std::vector<Pose>& predicted() const { return predicted_; }
  /// Rows that could not be solved at the last call.
  [[nodiscard]] const std::vector<int>& unsolved() const { return unsolved_; }
  /// Rows to solve from now on; the others are left out.
  void activate(const std::vector<bool>& rows) { active_ = rows; }
  [[nodiscard]] const std::vector<bool>& active() const { return active_; }

private:
  struct alignas(64) Worker {
    Workspace<N> workspace;
    RecordedPrediction<N, Fx> prediction;
    Eigen::Matrix<double, 6, Eigen::Dynamic> derivatives;
  };

  bool solve_row(const System<N, Fx>& system, const HistoryOfRow& history, std::size_t i, Worker& w) noexcept {
    Workspace<N>& ws = w.workspace;
    if (std::isfinite(equilibria_[i].missed))
      ws.begin_at(equilibria_[i].start);
    else if (ws.warm &&
             !detail::nearby(ws, Configuration<N>{joints(system.transmission, rows_[i].theta), rows_[i].load}))
      ws.reset();
    const bool solved = predict(system, rows_[i], history, ws, w.prediction) == Status::ok;
    if (!solved) ws.reset();
    return solved;
  }

  HistorySensitivities<N, Fx> history_sensitivities(const System<N, Fx>& system, const RecordedPath<N>& path) {
    HistorySensitivities<N, Fx> sensitivities(system, rows_, path, *torsion_, columns_, active_);
    pool_->parallel_for(sensitivities.windows(), [&](int window, int) noexcept { sensitivities.fill(window); });
    return sensitivities;
  }

  bool differentiate_row(const System<N, Fx>& system, std::size_t i, const RowHistorySensitivities& history,
                         const std::array<Mat3, turns.size()>& turning, Worker& w, Eigen::MatrixXd& jacobian) noexcept {
    w.derivatives.resize(6, Eigen::Index(columns_.size()));
    if (differentiate(system, rows_[i], w.workspace, w.prediction, columns_, w.derivatives, history) != Status::ok)
      return false;
    const Mat6 by_reading = residual_by_prediction(ctcr::residual(measured_[i], w.prediction.reading));
    for (std::size_t t = 0; t < turns.size(); ++t) {
      const int first = ParameterVector<N>::index(turns[t]);
      Eigen::Matrix<double, 6, 3> turned = Eigen::Matrix<double, 6, 3>::Zero();
      for (std::size_t k = 0; k < columns_.size(); ++k)
        if (const int j = columns_[k] - first; j >= 0 && j < 3) turned.col(j) = w.derivatives.col(Eigen::Index(k));
      turned = (turned * turning[t]).eval();
      for (std::size_t k = 0; k < parameters_.size(); ++k)
        if (const int j = parameters_[k] - first; j >= 0 && j < 3) w.derivatives.col(Eigen::Index(k)) = turned.col(j);
    }
    for (std::size_t k = 0; k < parameters_.size(); ++k)
      jacobian.col(Eigen::Index(k)).template segment<6>(Eigen::Index(6 * i)) =
          by_reading * w.derivatives.col(Eigen::Index(k));
    return true;
  }

  static std::vector<int> sorted(std::vector<int> v) {
    std::ranges::sort(v);
    return v;
  }

  /// The parameters, and all three of a turn where one is among them: each changes what the others do.
  static std::vector<int> with_whole_turns(std::vector<int> columns) {
    const auto asked = [&](int place) { return std::find(columns.begin(), columns.end(), place) != columns.end(); };
    for (const Parameter kind : turns) {
      const int first = ParameterVector<N>::index(kind);
      if (asked(first) || asked(first + 1) || asked(first + 2))
        for (int place = first; place < first + 3; ++place)
          if (!asked(place)) columns.push_back(place);
    }
    return columns;
  }

  Vec3 turn_of(const Eigen::VectorXd& x, Parameter kind) const {
    const int first = ParameterVector<N>::index(kind);
    Vec3 turn = Vec3::Zero();
    for (std::size_t k = 0; k < parameters_.size(); ++k)
      if (const int j = parameters_[k] - first; j >= 0 && j < 3) turn[j] = x[Eigen::Index(k)];
    return turn;
  }

  System<N, Fx> nominal_;
  std::vector<RecordedRow<N>> rows_;
  std::shared_ptr<const LinearisedTorsion<N>> torsion_ = std::make_shared<const LinearisedTorsion<N>>();
  Eigen::VectorXd solved_at_;  ///< all parameters of the system with which friction was solved; or empty
  std::vector<Pose> measured_;
  std::vector<int> parameters_, columns_;
  ThreadPool* pool_;
  std::vector<NearestEquilibrium<N>> equilibria_;
  std::vector<Pose> predicted_;
  std::vector<bool> active_;
  std::vector<Worker> workers_;
  std::vector<int> unsolved_;
};

}  // namespace ctcr
