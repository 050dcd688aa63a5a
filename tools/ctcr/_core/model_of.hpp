#pragma once
// The model of N tubes behind AnyModel. Each N is compiled in a file of its own.
#include <algorithm>
#include <ctcr/ctcr.hpp>
#include <ctcr/mechanics/integrators.hpp>
#include <ctcr/mechanics/shape.hpp>
#include <ctcr/parallel/batch.hpp>
#include <limits>
#include <vector>

#include "any_model.hpp"
#include "solver_of.hpp"

namespace ctcr::python {

inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <int Size>
VecN<Size> row(const double* array, std::ptrdiff_t i) {
  return Eigen::Map<const VecN<Size>>(array + i * Size);
}

/// Writes a matrix or vector as element i of an array of such, row-major.
template <class Values>
void put(double* array, std::ptrdiff_t i, const Values& values) {
  constexpr int rows = Values::RowsAtCompileTime, columns = Values::ColsAtCompileTime;
  using RowMajor = Eigen::Matrix<double, rows, columns, columns == 1 ? Eigen::ColMajor : Eigen::RowMajor>;
  Eigen::Map<RowMajor>(array + i * rows * columns) = values;
}

/// (w, x, y, z) with w >= 0.
inline Eigen::Vector4d quaternion(const Mat3& rotation) {
  const Eigen::Quaterniond q(rotation);
  const Eigen::Vector4d wxyz(q.w(), q.x(), q.y(), q.z());
  return q.w() < 0 ? Eigen::Vector4d(-wxyz) : wxyz;
}

template <int N>
class ModelOf final : public AnyModel {
public:
  ModelOf(std::span<const Tube> tubes, const Vec3& gravity) : model_(make_robot(tubes, gravity)) {}

  void predict(const Rows& rows, const Answers& answers, const Options& options) const override {
    if (answers.jacobian != nullptr) return predict_by<Derivatives::compliance, MagnusRk4>(rows, answers, options);
    switch (options.integrator) {
      case Integrator::standard: return predict_by<Derivatives::none, MagnusRk4>(rows, answers, options);
      case Integrator::ssp_rk3: return predict_by<Derivatives::none, SspRk3>(rows, answers, options);
      case Integrator::classical_rk4: return predict_by<Derivatives::none, ClassicalRk4>(rows, answers, options);
      case Integrator::prince_dormand8: return predict_by<Derivatives::none, PrinceDormand8>(rows, answers, options);
    }
  }

  std::pair<Status, std::size_t> shape(const Rows& rows, std::size_t points, int steps,
                                       const ShapeArrays& arrays) const override {
    const Configuration<N> c = configuration(rows, 0);
    const std::span<double> room(arrays.arc_length, arrays.room);
    const std::span<const double> s = room.first(shape_places(model_, c.joints, points, room));
    std::vector<ShapePoint<N>> places(s.size());
    Workspace<N> ws;
    Solution<N> solution;
    const Status status = ctcr::shape<N>(model_, c.joints, c.load, s, places, ws, solution, Settings{.steps = steps});
    for (std::size_t k = 0; k < s.size(); ++k) {
      const ShapePoint<N>& place = places[k];
      const auto i = std::ptrdiff_t(k);
      put(arrays.position, i, place.bishop.position);
      put(arrays.quaternion, i, quaternion(place.bishop.rotation));
      put(arrays.force, i, place.force);
      put(arrays.moment, i, place.moment);
      for (std::size_t tube = 0; tube < N; ++tube) {
        const TubeShape& t = place.tube[tube];
        const double scale = t.present ? 1.0 : nan;
        const auto at = std::ptrdiff_t(tube * arrays.room + k);
        arrays.tube_angle[at] = t.angle * scale;
        put(arrays.tube_curvature, at, Vec3(t.curvature * scale));
        put(arrays.tube_moment, at, Vec3(t.moment * scale));
      }
    }
    return {status, s.size()};
  }

private:
  static Robot<N> make_robot(std::span<const Tube> tubes, const Vec3& gravity) {
    Robot<N> robot;
    std::copy_n(tubes.begin(), N, robot.tubes.begin());
    robot.gravity = gravity;
    return robot;
  }

  static Configuration<N> configuration(const Rows& rows, std::ptrdiff_t i) {
    Configuration<N> c{{row<N>(rows.beta, i), row<N>(rows.alpha, i)}, {}};
    if (rows.force != nullptr) c.load.force = row<3>(rows.force, i);
    if (rows.moment != nullptr) c.load.moment = row<3>(rows.moment, i);
    return c;
  }

  template <Derivatives D, class Stepper>
  void predict_by(const Rows& rows, const Answers& answers, const Options& options) const {
    const auto input = [&rows](std::ptrdiff_t i) { return configuration(rows, i); };
    const Settings settings{.steps = options.steps};
    const auto output = [&, tip_of = std::size_t(options.tip_of)](std::ptrdiff_t i, const Solution<N>& s,
                                                                  const Workspace<N>& ws) {
      const bool solved = has_equilibrium(s.status);
      const double scale = solved ? 1.0 : nan;
      put(answers.position, i, Vec3(s.tube_tips[tip_of].position * scale));
      put(answers.quaternion, i, Eigen::Vector4d(quaternion(s.tube_tips[tip_of].rotation) * scale));
      answers.status[i] = std::uint8_t(s.status);
      answers.stability[i] = s.stability * scale;
      if constexpr (D == Derivatives::compliance) {
        TipDerivatives<N> by{s.jacobian};
        Mat6 by_load = s.compliance;
        if (tip_of > 0 || answers.by_parameters != nullptr)
          (void)differentiate_tip(model_, ws, int(tip_of), by, by_load, settings);
        put(answers.jacobian, i, Eigen::Matrix<double, 6, 2 * N>(by.by_joints * scale));
        put(answers.compliance, i, Mat6(by_load * scale));
        if (answers.by_parameters != nullptr)
          put(answers.by_parameters, i,
              Eigen::Matrix<double, 6, ParameterVector<N>::robot_count>(by.by_parameters * scale));
      }
    };
    ThreadPool pool(rows.count <= batch_chunk ? 1 : options.threads);
    solve_batch<D, Stepper>(model_, rows.count, input, output, pool, settings);
  }

  Model<N> model_;
};

template <int N>
std::unique_ptr<AnyModel> make_model(std::span<const Tube> tubes, const Vec3& gravity) {
  return std::make_unique<ModelOf<N>>(tubes, gravity);
}

}  // namespace ctcr::python
