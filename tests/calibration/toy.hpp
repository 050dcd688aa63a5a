#pragma once
// A table of readings that depend on its parameters in a known way, for tests of identification.
#include "ctcr/calibration/identification/identify.hpp"
#include "support/random_robots.hpp"

namespace ctcr::test {

inline constexpr Noise noise{
    .position_jitter = 3e-5, .rotation_jitter = 5e-4, .position_field = 3e-4, .rotation_field = 3e-3};
inline constexpr double infinity = std::numeric_limits<double>::infinity();

inline Eigen::VectorXd normals(Eigen::Index count, Random& random) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd v(count);
  for (double& x : v) x = normal(random);
  return v;
}

/// A table whose readings depend on few parameters in a known, mildly curved way, with noise of the given kind.
struct Toy {
  Eigen::MatrixX3d places;
  Eigen::MatrixXd slope;  ///< (6 rows, parameters)
  double bend = 0;        ///< how curved
  Eigen::VectorXd truth, y;

  Toy(Eigen::Index rows, Eigen::Index parameters, double curved, Random& random) : bend(curved) {
    places.resize(rows, 3);
    for (double& x : places.reshaped()) x = uniform(random, 0, 0.15);
    slope.resize(6 * rows, parameters);
    for (Eigen::Index k = 0; k < parameters; ++k) slope.col(k) = normals(6 * rows, random);
    for (Eigen::Index i = 0; i < 6 * rows; ++i) slope.row(i) *= i % 6 < 3 ? 1e-4 : 2e-3;
    truth = 0.7 * normals(parameters, random);
    y = model(truth);
  }

  Eigen::VectorXd model(const Eigen::VectorXd& x) const { return slope * (x + bend * x.cwiseAbs2()); }

  void add_noise(const Noise& n, Random& random) {
    const Eigen::MatrixXd factor = smooth_field(places, n.correlation_length, 1e-8).factor;
    for (int a = 0; a < 6; ++a)
      y(Eigen::seq(a, Eigen::last, 6)) +=
          (a < 3 ? n.position_field : n.rotation_field) * (factor * normals(factor.cols(), random)) +
          (a < 3 ? n.position_jitter : n.rotation_jitter) * normals(places.rows(), random);
  }

  Predictor predictor() const {
    return [this](const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
      residual = y - model(x);
      if (jacobian) *jacobian = -slope * (Eigen::VectorXd::Ones(x.size()) + 2 * bend * x).asDiagonal();
      return true;
    };
  }
  std::vector<FreeParameter> parameters(double sd = 1) const {
    std::vector<FreeParameter> p;
    for (Eigen::Index k = 0; k < slope.cols(); ++k) p.push_back({"p" + std::to_string(k + 1), 0, sd});
    return p;
  }
  /// Covariance of the noise, all of it.
  Eigen::MatrixXd covariance(const Noise& n) const {
    const SmoothField field = smooth_field(places, n.correlation_length, 1e-12);
    const Eigen::MatrixXd K = product(field.factor, field.factor.transpose());
    Eigen::MatrixXd S = Eigen::MatrixXd::Zero(y.size(), y.size());
    for (int a = 0; a < 6; ++a) {
      const double sd = a < 3 ? n.position_field : n.rotation_field,
                   jitter = a < 3 ? n.position_jitter : n.rotation_jitter;
      S(Eigen::seq(a, Eigen::last, 6), Eigen::seq(a, Eigen::last, 6)) = sd * sd * K;
      for (Eigen::Index i = a; i < S.rows(); i += 6) S(i, i) += jitter * jitter;
    }
    return S;
  }
};

}  // namespace ctcr::test
