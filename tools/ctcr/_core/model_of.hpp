#pragma once
// The model of N tubes behind AnyModel, without and with effects.
#include <ctcr/mechanics/all_equilibria.hpp>
#include <ctcr/mechanics/integrators.hpp>
#include <ctcr/mechanics/shape.hpp>
#include <ctcr/parallel/batch.hpp>
#include <limits>
#include <stdexcept>

#include "any_model.hpp"
#include "systems_of.hpp"

namespace ctcr::python {

template <int N>
Configuration<N> configuration(const Configurations& rows, Eigen::Index i) {
  Configuration<N> c{{rows.beta.row(i).transpose(), rows.alpha.row(i).transpose()}, {}};
  if (rows.force.size() > 0) c.load.force = rows.force.row(i).transpose();
  if (rows.moment.size() > 0) c.load.moment = rows.moment.row(i).transpose();
  return c;
}

/// Derivatives of one pose; columns of `by_parameters` are those asked for.
template <int N>
struct PoseDerivatives {
  Eigen::Matrix<double, 6, 2 * N> jacobian;
  Mat6 compliance;
  Eigen::Matrix<double, 6, Eigen::Dynamic> by_parameters;
};

/// The arrays of an answer, which several threads fill row by row.
template <int N>
class PoseWriter {
public:
  PoseWriter(Poses& out, Eigen::Index rows, const PredictOptions& options)
    : out_(out), tip_of_(std::size_t(options.tip_of)) {
    out.position.resize(rows, 3);
    out.quaternion.resize(rows, 4);
    out.status.resize(rows);
    out.stability.resize(rows);
    if (!options.derivatives) return;
    out.jacobian.resize(rows, 12 * N);
    out.compliance.resize(rows, 36);
    out.by_parameters.resize(rows, 6 * Eigen::Index(options.by_parameters.size()));
  }

  void put(Eigen::Index i, const Solution<N>& s, const PoseDerivatives<N>* by = nullptr) noexcept {
    const double scale = has_equilibrium(s.status) ? 1.0 : std::numeric_limits<double>::quiet_NaN();
    const Pose& tip = s.tube_tips[tip_of_];
    out_.position.row(i) = scale * tip.position.transpose();
    out_.quaternion.row(i) = scale * quaternion(tip.rotation);
    out_.status[i] = std::uint8_t(s.status);
    out_.stability[i] = scale * s.stability;
    if (!by) return;
    matrix(out_.jacobian, i) = scale * by->jacobian;
    matrix(out_.compliance, i) = scale * by->compliance;
    matrix(out_.by_parameters, i) = scale * by->by_parameters;
  }

private:
  static auto matrix(RowMajor& array, Eigen::Index i) noexcept {
    return Eigen::Map<RowMajor>(array.row(i).data(), 6, array.cols() / 6);
  }

  Poses& out_;
  std::size_t tip_of_;
};

template <int N>
void check(const Configurations& rows, const PredictOptions& options, int parameters) {
  const Eigen::Index count = rows.beta.rows();
  const auto require = [](bool condition, const char* text) {
    if (!condition) throw std::invalid_argument(text);
  };
  const auto is_load = [&](const RowMajor& load) {
    return load.size() == 0 || (load.rows() == count && load.cols() == 3);
  };
  require(rows.beta.cols() == N && rows.alpha.cols() == N && rows.alpha.rows() == count,
          "beta and alpha need one row a configuration and one column a tube");
  require(is_load(rows.force) && is_load(rows.moment),
          "force and moment need one row a configuration and three columns");
  require(options.steps >= 1, "steps must be at least 1");
  require(options.tip_of >= 0 && options.tip_of < N, "tip_of is the number of a tube, from 0");
  require(!options.derivatives || options.integrator == Integrator::standard,
          "derivatives need the default integrator");
  for (const int p : options.by_parameters)
    require(p >= 0 && p < parameters && (p < ParameterVector<N>::robot_count || p >= ParameterVector<N>::count),
            "by_parameters holds the indices of parameters of tubes, gravity and effects");
}

/// The shape of a model at joints after actuation, under the whole load. @param ws  warm start
template <int N, class Fx>
ShapeArrays shape_of(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, int points, int steps,
                     Workspace<N> ws = {}) {
  std::vector<double> s(std::size_t(points + 2 * N));
  s.resize(shape_arc_lengths(model, q, std::size_t(points), std::span(s)));
  std::vector<ShapePoint<N>> shape_at(s.size());
  Solution<N> solution;
  const auto count = Eigen::Index(s.size());
  const Status status = shape<N>(model, q, load, s, shape_at, ws, solution, Settings{.steps = steps});
  ShapeArrays out{.status = status,
                  .stability = solution.stability,
                  .arc_length = Eigen::Map<const Eigen::VectorXd>(s.data(), count),
                  .position = RowMajor(count, 3),
                  .quaternion = RowMajor(count, 4),
                  .force = RowMajor(count, 3),
                  .moment = RowMajor(count, 3),
                  .tube_angle = RowMajor(N, count),
                  .tube_curvature = RowMajor(N, 3 * count),
                  .tube_moment = RowMajor(N, 3 * count)};
  for (Eigen::Index k = 0; k < count; ++k) {
    const ShapePoint<N>& point = shape_at[std::size_t(k)];
    out.position.row(k) = point.bishop.position.transpose();
    out.quaternion.row(k) = quaternion(point.bishop.rotation);
    out.force.row(k) = point.force.transpose();
    out.moment.row(k) = point.moment.transpose();
    for (Eigen::Index i = 0; i < N; ++i) {
      const TubeShape& tube = point.tube[std::size_t(i)];
      const double scale = tube.present ? 1.0 : std::numeric_limits<double>::quiet_NaN();
      out.tube_angle(i, k) = scale * tube.angle;
      out.tube_curvature.row(i).template segment<3>(3 * k) = scale * tube.curvature.transpose();
      out.tube_moment.row(i).template segment<3>(3 * k) = scale * tube.moment.transpose();
    }
  }
  return out;
}

/// That shape, or with `all` those of all stable equilibria.
template <int N, class Fx>
std::vector<ShapeArrays> shapes_of(const Model<N, Fx>& model, const Joints<N>& q, const TipLoad& load, int points,
                                   int steps, bool all) {
  if (!all) return {shape_of(model, q, load, points, steps)};
  std::vector<ShapeArrays> found;
  for (const Equilibrium<N>& one : all_equilibria(model, q, load, Settings{.steps = steps}))
    found.push_back(shape_of(model, q, load, points, steps, one.workspace));
  return found;
}

/// The standard model.
template <int N>
class ModelOf final : public AnyModel {
public:
  explicit ModelOf(const Model<N>& model) : model_(model) {}

  Poses predict(const Configurations& rows, const PredictOptions& options) const override {
    check<N>(rows, options, ParameterVector<N>::count);
    if (options.derivatives) return predict_by<Derivatives::compliance, MagnusRk4>(rows, options);
    switch (options.integrator) {
      case Integrator::standard: return predict_by<Derivatives::none, MagnusRk4>(rows, options);
      case Integrator::ssp_rk3: return predict_by<Derivatives::none, SspRk3>(rows, options);
      case Integrator::classical_rk4: return predict_by<Derivatives::none, ClassicalRk4>(rows, options);
      case Integrator::prince_dormand8: return predict_by<Derivatives::none, PrinceDormand8>(rows, options);
    }
    throw std::invalid_argument("no such integrator");
  }
  std::vector<ShapeArrays> shapes(const Configurations& row, int points, int steps, bool all) const override {
    check<N>(row, {.steps = steps}, 0);
    const Configuration<N> c = configuration<N>(row, 0);
    return shapes_of(model_, c.joints, c.load, points, steps, all);
  }

private:
  template <Derivatives D, class Stepper>
  Poses predict_by(const Configurations& rows, const PredictOptions& options) const {
    Poses out;
    PoseWriter<N> writer(out, rows.beta.rows(), options);
    const Settings settings{.steps = options.steps};
    const auto input = [&rows](std::ptrdiff_t i) { return configuration<N>(rows, i); };
    const auto output = [&](std::ptrdiff_t i, const Solution<N>& s, const Workspace<N>& ws) {
      if constexpr (D == Derivatives::compliance) {
        TipDerivatives<N> tip{s.jacobian};
        PoseDerivatives<N> by;
        by.compliance = s.compliance;
        if (options.tip_of > 0 || !options.by_parameters.empty())
          (void)differentiate_tip(model_, ws, options.tip_of, tip, by.compliance);
        by.jacobian = tip.by_joints;
        by.by_parameters = tip.by_parameters(Eigen::all, options.by_parameters);
        writer.put(i, s, &by);
      } else {
        writer.put(i, s);
      }
    };
    ThreadPool pool(rows.beta.rows() <= batch_chunk ? 1 : options.threads);
    solve_batch<D, Stepper>(model_, rows.beta.rows(), input, output, pool, settings);
    return out;
  }

  Model<N> model_;
};

/// With the effects of the catalogue, of which none has a past.
template <int N>
class EffectModelOf final : public AnyModel {
  using Fx = AllEffects;
  using P = SystemParameters<N, Fx>;

public:
  explicit EffectModelOf(const Model<N, Fx>& model) : model_(model) {}

  Poses predict(const Configurations& rows, const PredictOptions& options) const override {
    check<N>(rows, options, P::count);
    const System<N, Fx> system = system_at(options.tip_of, options.steps);
    std::vector<int> variables;
    for (const auto joint : {Parameter::home_translation, Parameter::home_rotation})
      for (int i = 0; i < N; ++i) variables.push_back(ParameterVector<N>::index(joint, i));
    variables.insert(variables.end(), options.by_parameters.begin(), options.by_parameters.end());
    const Eigen::Index count = rows.beta.rows();
    Poses out;
    PoseWriter<N> writer(out, count, options);
    struct alignas(64) Worker {
      Workspace<N> ws;
      RecordedPrediction<N, Fx> prediction;
      Eigen::Matrix<double, 6, Eigen::Dynamic> columns;
      PoseDerivatives<N> by;
    };
    ThreadPool pool(count <= batch_chunk ? 1 : options.threads);
    std::vector<Worker> workers(std::size_t(pool.size()));
    pool.parallel_for(int((count + batch_chunk - 1) / batch_chunk), [&](int chunk, int worker) {
      Worker& w = workers[std::size_t(worker)];
      w.columns.resize(6, Eigen::Index(variables.size()));
      w.ws.reset();
      const Eigen::Index first = chunk * batch_chunk;
      for (Eigen::Index i = first; i < std::min<Eigen::Index>(first + batch_chunk, count); ++i) {
        const Configuration<N> c = configuration<N>(rows, i);
        if (w.ws.warm && !detail::nearby(w.ws, c)) w.ws.reset();
        const RecordedRow<N> row = row_of(c);
        (void)ctcr::predict(system, row, {}, w.ws, w.prediction);
        if (options.derivatives) {
          (void)differentiate(system, row, w.ws, w.prediction, variables, w.columns, {}, &w.by.compliance);
          w.by.jacobian = w.columns.template leftCols<2 * N>();
          w.by.by_parameters = w.columns.rightCols(w.columns.cols() - 2 * N);
        }
        writer.put(i, w.prediction.solution, options.derivatives ? &w.by : nullptr);
      }
    });
    return out;
  }

  std::vector<ShapeArrays> shapes(const Configurations& row, int points, int steps, bool all) const override {
    check<N>(row, {.steps = steps}, 0);
    Workspace<N> ws;
    RecordedPrediction<N, Fx> prediction;
    const Configuration<N> c = configuration<N>(row, 0);
    (void)ctcr::predict(system_at(0, std::max(steps, shape_steps)), row_of(c), {}, ws, prediction);
    return shapes_of(model_, prediction.q, prediction.load, points, steps, all);
  }

private:
  /// Motor angles are the joints, and the reading is the pose of the tube's tip.
  [[nodiscard]] System<N, Fx> system_at(int tube, int steps) const {
    return {{}, model_, PoseSensor{{}, tube}, Settings{.steps = steps}};
  }
  static RecordedRow<N> row_of(const Configuration<N>& c) {
    RecordedRow<N> row{{c.joints.beta, c.joints.alpha}, c.load, {}};
    row.at.time = std::numeric_limits<double>::quiet_NaN();
    return row;
  }

  Model<N, Fx> model_;
};

template <int N>
std::unique_ptr<AnyModel> make_model(const Eigen::VectorXd& parameters, const Eigen::VectorXd& effects) {
  using P = ParameterVector<N>;
  if (parameters.size() != P::robot_count || (effects.size() != 0 && effects.size() != Catalogue::On<N>::count))
    throw std::invalid_argument("the values of a model do not fit together");
  Eigen::VectorXd all = Eigen::VectorXd::Zero(P::count);
  all.head<P::robot_count>() = parameters;
  const System<N> standard = system_of<N>(all);
  if (effects.size() == 0) return std::make_unique<ModelOf<N>>(standard.model);
  return std::make_unique<EffectModelOf<N>>(with_constant_effects<N>(standard, effects).model);
}

}  // namespace ctcr::python

#define CTCR_INSTANTIATE_MODEL(N)                                                                      \
  template std::unique_ptr<ctcr::python::AnyModel> ctcr::python::make_model<N>(const Eigen::VectorXd&, \
                                                                               const Eigen::VectorXd&);
