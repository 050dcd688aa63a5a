#include "ctcr/calibration/identification/whitening.hpp"

#include <gtest/gtest.h>

#include "ctcr/calibration/identification/outliers.hpp"
#include "support/random_robots.hpp"

namespace whitening_test {

using namespace ctcr;

constexpr Noise noise{.position_jitter = 3e-5, .rotation_jitter = 5e-4, .position_field = 3e-4, .rotation_field = 3e-3};

Eigen::MatrixX3d random_places(Eigen::Index rows, double extent, test::Random& random) {
  Eigen::MatrixX3d places(rows, 3);
  for (Eigen::Index i = 0; i < places.size(); ++i) places.data()[i] = test::uniform(random, 0, extent);
  return places;
}

double kernel(const Eigen::MatrixX3d& places, Eigen::Index i, Eigen::Index j, double length) {
  return std::exp(-(places.row(i) - places.row(j)).squaredNorm() / (2 * length * length));
}

/// The whole covariance (6 rows, 6 rows) where all weights are above 0.
Eigen::MatrixXd covariance(const Noise& n, const Eigen::MatrixX3d& places, const RowWeights& weights) {
  const Eigen::Index rows = places.rows();
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(6 * rows, 6 * rows);
  for (Eigen::Index i = 0; i < rows; ++i)
    for (Eigen::Index j = 0; j < rows; ++j)
      for (int a = 0; a < 6; ++a) {
        const double jitter = a < 3 ? n.position_jitter : n.rotation_jitter;
        const double field = a < 3 ? n.position_field : n.rotation_field;
        S(6 * i + a, 6 * j + a) = field * field * kernel(places, i, j, n.correlation_length) +
                                  (i == j ? jitter * jitter / weights(i, a / 3) : 0.0);
      }
  return S;
}

TEST(SmoothField, ReproducesTheCovarianceWithinTheTolerance) {
  test::Random random(1);
  const Eigen::MatrixX3d places = random_places(150, 0.2, random);
  const double tolerance = 1e-5;
  const SmoothField field = smooth_field(places, 0.1, tolerance);
  EXPECT_LT(field.factor.cols(), 100);
  for (Eigen::Index i = 0; i < places.rows(); ++i)
    for (Eigen::Index j = 0; j <= i; ++j) {
      const double left = kernel(places, i, j, 0.1) - field.factor.row(i).dot(field.factor.row(j));
      EXPECT_LE(std::abs(left), tolerance);
      if (i == j) {
        EXPECT_NEAR(left, field.rest[i], 1e-12);
      }
    }
}

TEST(SmoothField, HasARankThatDependsOnTheVolumeNotOnTheRows) {
  test::Random random(2);
  const auto few = smooth_field(random_places(500, 0.15, random), 0.1, 1e-4).factor.cols();
  const auto many = smooth_field(random_places(5000, 0.15, random), 0.1, 1e-4).factor.cols();
  EXPECT_LE(many, few + few / 4);
  Eigen::MatrixX3d twice(100, 3);
  twice << random_places(50, 0.15, random), Eigen::MatrixX3d::Zero(50, 3);
  twice.bottomRows(50) = twice.topRows(50);
  EXPECT_LE(smooth_field(twice, 0.01, 0.0).factor.cols(), 50);
}

TEST(SmoothField, GivesARowWithoutPlaceAnErrorOfItsOwn) {
  test::Random random(3);
  Eigen::MatrixX3d places = random_places(10, 0.1, random);
  places(4, 1) = std::nan("");
  const SmoothField field = smooth_field(places, 0.1, 1e-6);
  EXPECT_TRUE(field.factor.row(4).isZero(0));
  EXPECT_EQ(field.rest[4], 1);
  EXPECT_TRUE(field.factor.allFinite());
}

TEST(Whitening, InvertsTheCovarianceAndKnowsItsDeterminant) {
  test::Random random(4);
  for (const double extent : {0.02, 0.3}) {
    const Eigen::MatrixX3d places = random_places(25, extent, random);
    RowWeights weights(25, 2);
    for (Eigen::Index i = 0; i < weights.size(); ++i) weights.data()[i] = test::uniform(random, 0.01, 1);
    const Whitening whitening(noise, smooth_field(places, noise.correlation_length, 1e-12), weights);
    Eigen::MatrixXd L = Eigen::MatrixXd::Identity(150, 150);
    whitening.apply(L);
    const Eigen::MatrixXd S = covariance(noise, places, weights);
    EXPECT_LE((product(product(L, S), L.transpose()) - Eigen::MatrixXd::Identity(150, 150)).cwiseAbs().maxCoeff(),
              1e-6);
    const Eigen::LLT<Eigen::MatrixXd> cholesky(S);
    const double log_determinant = 2 * cholesky.matrixLLT().diagonal().array().log().sum();
    EXPECT_NEAR(whitening.log_determinant(), log_determinant, 1e-6 * std::abs(log_determinant));
    EXPECT_EQ(whitening.observations(), 150);
  }
}

TEST(Whitening, WithoutFieldIsDivisionByTheJitter) {
  const Noise plain{.position_jitter = 2, .rotation_jitter = 4};
  const Whitening whitening(plain, {Eigen::MatrixXd(2, 0), Eigen::VectorXd::Zero(2)}, RowWeights::Ones(2, 2));
  Eigen::MatrixXd x = Eigen::MatrixXd::Ones(12, 1);
  whitening.apply(x);
  for (int a = 0; a < 12; ++a) EXPECT_DOUBLE_EQ(x(a, 0), a % 6 < 3 ? 0.5 : 0.25);
}

TEST(Whitening, OfLeftOutRowsIsThatOfTheTableWithoutThem) {
  test::Random random(5);
  const Eigen::MatrixX3d places = random_places(12, 0.1, random), kept = places.topRows(9);
  RowWeights weights = RowWeights::Ones(12, 2);
  weights.bottomRows(3).setZero();
  Eigen::VectorXd r = Eigen::VectorXd::Random(72), part = r.head(54);
  r.tail(18).setConstant(std::nan(""));
  const Whitening all(noise, smooth_field(places, 0.1, 1e-12), weights);
  const Whitening some(noise, smooth_field(kept, 0.1, 1e-12), RowWeights::Ones(9, 2));
  all.apply(r);
  some.apply(part);
  EXPECT_TRUE(r.tail(18).isZero(0));
  EXPECT_NEAR(r.squaredNorm(), part.squaredNorm(), 1e-6 * part.squaredNorm());
  EXPECT_NEAR(all.log_determinant(), some.log_determinant(), 1e-6);
  EXPECT_EQ(all.observations(), 54);
}

TEST(Whitening, PredictsTheFieldEverywhereFromTheRowsThatCount) {
  test::Random random(6);
  const Eigen::MatrixX3d places = random_places(20, 0.1, random);
  RowWeights weights = RowWeights::Ones(20, 2);
  weights.bottomRows(5).setZero();
  const Whitening whitening(noise, smooth_field(places, 0.1, 1e-13), weights);
  const Eigen::VectorXd r = 1e-3 * Eigen::VectorXd::Random(120);
  const Eigen::VectorXd field = whitening.field(r);
  for (int a = 0; a < 6; ++a) {
    const double jitter = a < 3 ? noise.position_jitter : noise.rotation_jitter;
    const double sd = a < 3 ? noise.position_field : noise.rotation_field;
    Eigen::MatrixXd K(20, 20);
    for (int i = 0; i < 20; ++i)
      for (int j = 0; j < 20; ++j) K(i, j) = sd * sd * kernel(places, i, j, 0.1);
    const Eigen::MatrixXd S =
        Eigen::MatrixXd(K.topLeftCorner(15, 15)) + jitter * jitter * Eigen::MatrixXd::Identity(15, 15);
    const Eigen::VectorXd axis = r(Eigen::seq(a, Eigen::last, 6));
    const Eigen::MatrixXd gain = least_squares(S, K.topRows(15)).transpose();
    const Eigen::VectorXd expected = gain * axis.head(15);
    EXPECT_LE((field(Eigen::seq(a, Eigen::last, 6)) - expected).norm(), 1e-4 * expected.norm());
    const Eigen::VectorXd variance = (K - product(gain, K.topRows(15))).diagonal();
    EXPECT_LE((whitening.axes(a / 3).field_variance() - variance).norm(), 1e-4 * variance.norm());
  }
}

TEST(Accuracy, IsTheLengthThat95PercentStayBelow) {
  test::Random random(7);
  std::normal_distribution<double> normal;
  int below = 0;
  for (int i = 0; i < 100000; ++i) below += Vec3(normal(random), normal(random), normal(random)).norm() < norm_95;
  EXPECT_NEAR(below, 95000, 300);
  EXPECT_NEAR(field_of_accuracy(norm_95 * 5, 3), 4, 1e-12);
  EXPECT_EQ(field_of_accuracy(1, 3), 0);
}

TEST(OutlierWeights, KeepNormalRowsAndFindTheOthersBelowTheField) {
  test::Random random(8);
  std::normal_distribution<double> normal;
  const Eigen::Index rows = 400;
  const Eigen::MatrixX3d places = random_places(rows, 0.15, random);
  const SmoothField field = smooth_field(places, 0.1, 1e-6);
  Eigen::VectorXd r(6 * rows);
  for (int a = 0; a < 6; ++a) {
    Eigen::VectorXd cause(field.factor.cols());
    for (double& c : cause) c = normal(random);
    const Eigen::VectorXd smooth = field.factor * cause;
    for (Eigen::Index i = 0; i < rows; ++i)
      r[6 * i + a] = (a < 3 ? noise.position_field : noise.rotation_field) * smooth[i] +
                     (a < 3 ? noise.position_jitter : noise.rotation_jitter) * normal(random);
  }
  for (Eigen::Index i = 0; i < rows; i += 10)
    r.segment<3>(6 * i) += test::random_vector(random, 1e-9) + Vec3(1e-3, 0, 0);
  RowWeights use = RowWeights::Ones(rows, 2), weights = use;
  use(1, 0) = weights(1, 0) = 0;
  for (int round = 0; round < 4; ++round)
    weights = outlier_weights(noise, {1, 1}, Whitening(noise, field, weights), r, use);
  double positions = 0, rotations = 0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    if (i % 10 == 0) {
      EXPECT_LT(weights(i, 0), 0.05) << i;
    } else if (i != 1) {
      positions += weights(i, 0) / 359;
    }
    rotations += weights(i, 1) / double(rows);
  }
  EXPECT_GT(positions, 0.97);
  EXPECT_GT(rotations, 0.98);
  EXPECT_EQ(weights(1, 0), 0);
}

}  // namespace whitening_test
