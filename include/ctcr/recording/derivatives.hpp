#pragma once
// Derivatives of the reading in a recorded row, in the steps of predict.hpp: exact ones of the discretised model. (Where nothing loads the rod and no effect acts on it they are those of the unloaded equations, which differ
// by their discretisation error.)
#include "ctcr/recording/history_sensitivities.hpp"
#include "ctcr/recording/predict.hpp"

namespace ctcr {

namespace detail {

/// The derivatives of one reading. In the lanes stand first the unknowns of the equations, then the parameters that move
/// the tip, force and moment at the robot tip, and the parameters that change the reading alone, which need no integration.
template <int N, class Fx>
class RowDerivatives {
  using P = SystemParameters<N, Fx>;
  using V = ParameterVector<N>;
  using Window = detail::Window<4>;
  using Pass = EffectPass<N, Fx, Window::groups>;
  using S = Window::S;
  using On = typename Fx::template On<N>;
  static constexpr int unknowns = Pass::unknowns, loads = 6;
  static constexpr int groups = Window::groups_for(unknowns + P::count + loads);

public:
  RowDerivatives(const System<N, Fx>& system, const RecordedRow<N>& row, const Workspace<N>& ws,
                 const RecordedPrediction<N, Fx>& prediction, std::span<const int> variables,
                 const RowHistorySensitivities& history) noexcept
    : system_(system), row_(row), ws_(ws), prediction_(prediction), history_(history), asked_(variables) {
    equations_ = model().coefficients().on_rod;
    for (std::size_t j = 0; j < variables.size(); ++j) {
      const int v = variables[j];
      const Reach reach = reaches<N, Fx>[std::size_t(v)];
      equations_ = equations_ || reach == Reach::equations;
      if (reach != Reach::reading) variables_.put(force_++, int(j), v);
    }
    lanes_ = force_ + loads;
    for (std::size_t j = 0; j < variables.size(); ++j)
      if (variables_.lane(variables[j]) < 0) variables_.put(lanes_++, int(j), variables[j]);
    for (auto& r : rows_)
      for (auto& x : r.x) x = Lanes{};
  }

  /// @param out         6 x variables, zero
  /// @param compliance  of the tube's tip, base frame; or null
  Status write(Eigen::Ref<Eigen::Matrix<double, 6, Eigen::Dynamic>> out, Mat6* compliance) noexcept {
    const bool pushed = find_push();
    if (pushed || equations_)
      integrate(compliance ? loads : pushed ? 3 : 0);
    else if (const Status status = take_standard(compliance); !has_equilibrium(status))
      return status;
    if (pushed) add_push(compliance ? force_ + loads : force_);
    if (compliance && (pushed || equations_))
      for (int i = 0; i < 6; ++i)
        for (int j = 0; j < loads; ++j) (*compliance)(i, j) = rows_[unknowns + i][force_ + j];
    read(out);
    if (out.allFinite() && (!compliance || compliance->allFinite())) return prediction_.solution.status;
    out.setZero();
    if (compliance) compliance->setZero();
    return Status::not_finite;
  }

private:
  [[nodiscard]] const Model<N, Fx>& model() const noexcept { return prediction_.model; }

  /// The effects of the list Some.
  template <class Some>
  [[nodiscard]] auto effects(const Window& window) const noexcept {
    return variables_.template effects<Some>(model().effects(), window, [&](double x, int state) {
      S seeded = x;
      if (const double* derivative = history_(state))
        variables_.for_each_in(window, [&](int lane, int j) { window.add(seeded, lane, derivative[j]); });
      return seeded;
    });
  }
  [[nodiscard]] auto actuating(const Window& window) const noexcept {
    return [this, window](auto& beta, auto& alpha) {
      effects<typename Fx::OnJoints>(window).actuate(row_.at, beta, alpha);
    };
  }

  /// Force of the surroundings and its derivatives by the parameters, which may differ from 0 where the force does not.
  bool find_push() noexcept {
    bool pushed = false;
    if constexpr (On::has_environment) {
      const Vec3& p = prediction_.solution.position;
      for (Window window; window.first < force_; window.first += window.size) {
        auto& f = push_[std::size_t(window.first / window.size)] = {0.0, 0.0, 0.0};
        effects<typename Fx::OnTip>(window).environment({p[0], p[1], p[2]}, f);
        for (const S& x : f) pushed = pushed || !vanishes(x);
      }
    }
    return pushed;
  }

  /// Derivatives of the tip by everything, and by the first components of force and moment, from the equations with their
  /// effects.
  void integrate(int components) noexcept {
    const Events<N> events = sort_events(with_all_curves(model().robot()), prediction_.q.beta);
    const int count = force_ + components;
    for (Window window; window.first < count; window.first += window.size) {
      auto in = rod_inputs<S>(system_, row_, prediction_.load, variables_.seeding(window), actuating(window));
      in.effects = effects<typename Fx::OnRod>(window);
      for (int i = 0; i < components; ++i) {
        const auto k = std::size_t(i % 3);
        window.add(i < 3 ? in.force[k] : in.moment[k], force_ + i, 1);
      }
      Pass(in, events, ws_.guess, system_.sensor.tube, ws_.steps, window).write(rows_, window.first / lane_count);
    }
    constexpr auto lane = [](int j) constexpr { return j; };
    (void)eliminate<unknowns>(rows_, lane);
  }

  /// Derivatives of the tip by the joints that the tubes have and by the tubes, by the faster path of the standard model.
  Status take_standard(Mat6* compliance) noexcept {
    TipDerivatives<N> tip;
    const Model<N> standard(model().robot());
    const Status status = compliance ? differentiate_tip(standard, ws_, system_.sensor.tube, tip, *compliance)
                                     : differentiate_tip(standard, ws_, system_.sensor.tube, tip);
    for (const int v : asked_)
      if (v < V::robot_count)
        for (int k = 0; k < 6; ++k) rows_[unknowns + k].add(variables_.lane(v), tip.by_parameters(k, v));
    for (Window window; window.first < force_; window.first += window.size) {
      std::array<S, N> beta, alpha;
      joints_of<N, S>(system_.transmission, row_.theta, variables_.seeding(window), beta, alpha);
      actuating(window)(beta, alpha);
      for (int g = 0; g < Window::groups; ++g)
        for (int k = 0; k < 6; ++k)
          for (int i = 0; i < N; ++i)
            rows_[unknowns + k].x[window.first / lane_count + g] +=
                tip.by_joints(k, i) * beta[std::size_t(i)].d[g] + tip.by_joints(k, N + i) * alpha[std::size_t(i)].d[g];
    }
    return status;
  }

  /// Adds that the force of the surroundings f changes with the robot tip p, which it moves: df = f_v dv + f_p dp and
  /// dp = A dv + C df, v a variable.
  void add_push(int end) noexcept {
    if constexpr (On::has_environment) {
      const Mat3 by_position =
          surrounding_force(model().effects().template seeded<Dual<1>, typename Fx::OnTip>(Constant<Dual<1>>{}),
                            prediction_.solution.position)
              .by_position;
      Mat3 C;
      Eigen::Matrix<double, 6, 3> by_force;
      for (int j = 0; j < 3; ++j) {
        for (int i = 0; i < 6; ++i) by_force(i, j) = rows_[unknowns + i][force_ + j];
        for (int i = 0; i < 3; ++i) C(i, j) = rows_[Pass::rows + i][force_ + j];
      }
      const Eigen::Matrix<double, 6, 3> by_push =
          by_force * solved<3>(Mat3::Identity() - by_position * C, Mat3(Mat3::Identity()));
      for (int j = unknowns; j < end; ++j) {
        Vec3 A, direct = Vec3::Zero();
        for (int i = 0; i < 3; ++i) {
          A[i] = rows_[Pass::rows + i][j];
          if (j >= force_) continue;
          const int l = j % Window::size;
          direct[i] = push_[std::size_t(j / Window::size)][std::size_t(i)].d[l / lane_count][l % lane_count];
        }
        const Vec6 change = by_push * (direct + by_position * A);
        for (int i = 0; i < 6; ++i) rows_[unknowns + i].add(j, change[i]);
      }
    }
  }

  /// From the tip to the reading.
  void read(Eigen::Ref<Eigen::Matrix<double, 6, Eigen::Dynamic>> out) const noexcept {
    const Pose& T_base_tip = prediction_.solution.tube_tips[std::size_t(system_.sensor.tube)];
    const Pose& T_tracker_base = system_.sensor.T_tracker_base;
    const Mat3 R_tip_base = T_base_tip.rotation.transpose(), R_base_tracker = T_tracker_base.rotation.transpose();
    for (Window window; window.first < lanes_; window.first += window.size) {
      const auto seed = variables_.seeding(window);
      Frame<S> tip = frame_of<S>(T_base_tip), T_ref = frame_of<S>(T_tracker_base);
      Frame<S> mount = frame_of<S>({Mat3::Identity(), system_.sensor.T_tip_sensor.position});
      for (int g = 0; g < Window::groups; ++g) {
        const auto twist = [&](int first) {
          const int at = window.first / lane_count + g;
          return Lanes3{rows_[first].x[at], rows_[first + 1].x[at], rows_[first + 2].x[at]};
        };
        const auto seeds = [&](Parameter kind) {
          const auto of = [&](int i) { return seed(0, V::index(kind, i)).d[g]; };
          return Lanes3{of(0), of(1), of(2)};
        };
        const Lanes3 v = R_tip_base * twist(unknowns), w = R_tip_base * twist(unknowns + 3);
        const Lanes3 shift = R_base_tracker * seeds(Parameter::tracker_position),
                     turn = R_base_tracker * seeds(Parameter::tracker_rotation),
                     offset = seeds(Parameter::sensor_position);
        for (std::size_t i = 0; i < 3; ++i) {
          tip.translation_twist[i][g] = v[i];
          tip.rotation_twist[i][g] = w[i];
          T_ref.translation_twist[i][g] = shift[i];
          T_ref.rotation_twist[i][g] = turn[i];
          mount.translation_twist[i][g] = offset[i];
        }
      }
      Frame<S> reading = composed(composed(T_ref, tip), mount);
      effects<typename Fx::OnReading>(window).sense(row_.at, reading);
      for (int g = 0; g < Window::groups; ++g)  // the turn from these axes to those of the sensor comes last
        for (int i = 0; i < 3; ++i)
          reading.rotation_twist[i][g] += seed(0, V::index(Parameter::sensor_rotation, i)).d[g];
      const Mat3 R = reading.rotation();
      variables_.for_each_in(window, [&](int lane, int j) {
        const int g = (lane - window.first) / lane_count, i = (lane - window.first) % lane_count;
        Vec3 v, w;
        for (int k = 0; k < 3; ++k) v[k] = reading.translation_twist[k][g][i], w[k] = reading.rotation_twist[k][g][i];
        out.template block<3, 1>(0, j) = R * v;
        out.template block<3, 1>(3, j) = R * w;
      });
    }
  }

  const System<N, Fx>& system_;
  const RecordedRow<N>& row_;
  const Workspace<N>& ws_;
  const RecordedPrediction<N, Fx>& prediction_;
  RowHistorySensitivities history_;
  std::span<const int> asked_;
  Variables<N, Fx> variables_;
  int force_ = unknowns, lanes_ = 0;  ///< lane of force and moment; end of all
  bool equations_ = false;            ///< whether effects change the equations
  LaneRow<groups> rows_[Pass::rows + (On::has_environment ? 3 : 0)];
  std::array<std::array<S, 3>, groups / Window::groups> push_;
};

}  // namespace detail

/// Derivatives of the reading that predict() just left in `ws` and `prediction`, by some of the system's parameters.
/// Rows: position [m], rotation [rad], tracker axes.
/// @param variables  indices in SystemParameters<N, Fx>, each once
/// @param out        6 x variables.size()
/// @param history    derivatives of the history of this row, by the variables; none: it is held
/// @param compliance derivatives of the tube's tip by force [N] and moment [N m] at the robot tip, base frame; or null
/// @return as predict(); where that failed the derivatives are zero. Real time: yes, one integration for sixteen variables.
template <int N, class Fx>
  requires(!Fx::none)
CTCR_NOINLINE Status differentiate(const System<N, Fx>& system, const RecordedRow<N>& row, const Workspace<N>& ws,
                                   const RecordedPrediction<N, Fx>& prediction, std::span<const int> variables,
                                   Eigen::Ref<Eigen::Matrix<double, 6, Eigen::Dynamic>> out,
                                   const RowHistorySensitivities& history = {}, Mat6* compliance = nullptr) noexcept {
  out.setZero();
  if (compliance) compliance->setZero();
  const Status status = prediction.solution.status;
  if (!has_equilibrium(status)) return status;
  return detail::RowDerivatives<N, Fx>(system, row, ws, prediction, variables, history).write(out, compliance);
}

/// As above without effects, by the faster path of system/predict.hpp.
template <int N, class Fx>
  requires(Fx::none)
Status differentiate(const System<N, Fx>& system, const RecordedRow<N>& row, const Workspace<N>& ws,
                     const RecordedPrediction<N, Fx>& prediction, std::span<const int> variables,
                     Eigen::Ref<Eigen::Matrix<double, 6, Eigen::Dynamic>> out,
                     const RowHistorySensitivities& = {}) noexcept {
  PredictionDerivatives<N> all;
  const Status status = differentiate(system, row.theta, ws, prediction, all);
  for (std::size_t j = 0; j < variables.size(); ++j) out.col(Eigen::Index(j)) = all.by_parameters.col(variables[j]);
  return status;
}

}  // namespace ctcr
