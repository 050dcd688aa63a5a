// Where identification goes: within bounds, and not where nothing can be predicted.
#include <gtest/gtest.h>

#include "calibration/toy.hpp"

namespace descent_test {

using namespace ctcr;
using test::infinity;
using test::noise;
using test::normals;
using test::Toy;

TEST(Descent, StaysWithinBoundsAndSaysSo) {
  test::Random random(6);
  Toy toy(30, 2, 0, random);
  toy.truth << 1, 0.5;
  toy.y = toy.model(toy.truth);
  toy.add_noise(noise, random);
  auto parameters = toy.parameters();
  parameters[0].high = 0.2;
  const Identification fit = identify(toy.predictor(), parameters, noise, toy.places);
  EXPECT_NEAR(fit.values[0], 0.2, 1e-9);
  ASSERT_FALSE(fit.warnings.empty());
  EXPECT_TRUE(fit.warnings[0].starts_with("stopped at a bound: p1 (0.2)")) << fit.warnings[0];
}

/// The minimum of |y - slope x|^2_W + |x|^2 where change . x >= low of every bound, by trying all sets of bounds that hold
/// it back.
Eigen::VectorXd minimum_within(const Eigen::MatrixXd& H, const Eigen::VectorXd& g,
                               const std::vector<LinearBound>& within) {
  const Eigen::Index n = g.size();
  Eigen::VectorXd best;
  double least = infinity;
  for (unsigned set = 0; set < 1u << within.size(); ++set) {
    Eigen::MatrixXd KKT = H;
    Eigen::VectorXd right = g;
    for (std::size_t k = 0; k < within.size(); ++k) {
      if (!(set >> k & 1u)) continue;
      const Eigen::Index m = KKT.rows();
      KKT.conservativeResizeLike(Eigen::MatrixXd::Zero(m + 1, m + 1));
      KKT.col(m).head(n) = within[k].change;
      KKT.row(m).head(n) = within[k].change.transpose();
      right.conservativeResize(m + 1);
      right[m] = within[k].low;
    }
    const Eigen::VectorXd x = least_squares(KKT, right).topRows(n);
    bool inside = true;
    for (const LinearBound& bound : within) inside = inside && bound.change.dot(x) >= bound.low - 1e-9;
    const double cost = 0.5 * x.dot(H * x) - g.dot(x);
    if (inside && cost < least) least = cost, best = x;
  }
  return best;
}

TEST(Descent, KeepsSumsOfParametersWithinBounds) {
  int stopped = 0;
  for (int seed = 0; seed < 60; ++seed) {
    test::Random random{std::uint64_t(seed)};
    Toy toy(20, 5, 0, random);
    toy.slope.col(1) = toy.slope.col(0) + 0.1 * toy.slope.col(1);  // a projected step would lead astray
    toy.y = toy.model(toy.truth);
    toy.add_noise(noise, random);
    std::vector<LinearBound> within;
    for (int k = 0; k < 3; ++k) within.push_back({"bound", normals(5, random), -test::uniform(random, 0, 0.5)});
    IdentifyOptions options{.robust = false, .admit_model_error = false, .starts = 1, .within = within};
    const Identification fit = identify(toy.predictor(), toy.parameters(), noise, toy.places, options);
    const Eigen::MatrixXd weighted = least_squares(toy.covariance(noise), toy.slope);
    const Eigen::MatrixXd H = transposed_product(toy.slope, weighted) + Eigen::MatrixXd::Identity(5, 5);
    const Eigen::VectorXd x = minimum_within(H, weighted.transpose() * toy.y, within);
    EXPECT_TRUE(fit.converged) << fit.status;
    EXPECT_LT(std::sqrt((fit.values - x).dot(H * (fit.values - x))), 0.02) << seed;
    stopped += int(!fit.warnings.empty());
  }
  EXPECT_GT(stopped, 20);
}

TEST(Descent, KeepsTheNearerOfBoundsThatDepend) {
  test::Random random(9);
  Toy toy(20, 1, 0, random);
  toy.truth << 2;
  toy.y = toy.model(toy.truth);
  IdentifyOptions options;
  options.within = {{"far", Eigen::VectorXd::Constant(1, -2), -3}, {"near", Eigen::VectorXd::Constant(1, -1), -1}};
  const Identification fit = identify(toy.predictor(), toy.parameters(), noise, toy.places, options);
  EXPECT_NEAR(fit.values[0], 1, 1e-9);
  EXPECT_NE(fit.warnings.front().find("stopped where near"), std::string::npos) << fit.warnings.front();
}

TEST(Descent, ShortensAStepThatCannotBePredicted) {
  test::Random random(7);
  Toy toy(30, 2, 0, random);
  toy.truth << 1, -1;
  toy.y = toy.model(toy.truth);
  const Predictor inner = toy.predictor();
  const Predictor walled = [&](const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
    return x[0] < 0.5 && inner(x, residual, jacobian);
  };
  const Identification fit = identify(walled, toy.parameters(), noise, toy.places);
  EXPECT_FALSE(fit.converged);
  EXPECT_LT(fit.values[0], 0.5);
  EXPECT_NE(fit.status.find("not converged"), std::string::npos);
}

// To the last bit, so that a prediction made there need not be made again. What lies outside comes to the nearest point,
// from which no point within lies in its direction; also where edges are nearly parallel, as those of a tube's length and
// of its home are.
TEST(Descent, KeepsAStartWithinItsBounds) {
  for (int seed = 0; seed < 40; ++seed) {
    test::Random random{std::uint64_t(seed)};
    constexpr Eigen::Index n = 5;
    std::vector<LinearBound> within;
    for (int k = 0; k < 3; ++k) {
      const Eigen::VectorXd change = k == 2 ? within[1].change + 0.01 * normals(n, random) : normals(n, random);
      within.push_back({"edge", change, -3});
    }
    const detail::Bounds bounds(std::vector<FreeParameter>(n, {"p", 0, 1}), within, Eigen::VectorXd::Ones(n));
    const Eigen::VectorXd outside = 5 * normals(n, random), nearest = bounds.clamped(outside);
    for (const LinearBound& bound : within) EXPECT_GE(bound.change.dot(nearest), bound.low - 1e-6) << seed;
    for (int other = 0; other < 100; ++other) {
      const Eigen::VectorXd inside = 0.2 * normals(n, random);
      if (std::ranges::any_of(within, [&](const LinearBound& b) { return b.change.dot(inside) < b.low; })) continue;
      EXPECT_TRUE(bounds.clamped(inside) == inside) << seed;
      EXPECT_LE((outside - nearest).dot(inside - nearest), 1e-6) << seed;
    }
  }
}

/// The cost of readings whose noise is 1, in parameters scaled by their prior sd.
struct UnitNoise {
  UnitNoise(const Predictor& predict, const std::vector<FreeParameter>& parameters, Eigen::Index rows)
    : scale(Eigen::Index(parameters.size())),
      whitening({.position_jitter = 1, .rotation_jitter = 1}, {Eigen::MatrixXd(rows, 0), Eigen::VectorXd::Zero(rows)},
                RowWeights::Ones(rows, 2)),
      objective(predict, parameters, scaled(parameters), prior_precision(parameters)),
      bounds(parameters, {}, scale) {
    objective.set_whitening(whitening);
  }
  detail::Descent descend(Eigen::VectorXd& z, double tolerance = 0.02) {
    return detail::descend(objective, bounds, 200, tolerance, z);
  }

  Eigen::VectorXd scale;
  Whitening whitening;
  detail::Objective objective;
  detail::Bounds bounds;

private:
  const Eigen::VectorXd& scaled(const std::vector<FreeParameter>& parameters) {
    for (Eigen::Index k = 0; k < scale.size(); ++k) scale[k] = parameters[std::size_t(k)].sd;
    return scale;
  }
};

// Rows 2 + |w . x - c| make convex costs whose minimum mostly lies where some of them have their kinks.
TEST(Descent, FindsAMinimumWhereSlopesJump) {
  int at_kink = 0;
  for (int seed = 0; seed < 40; ++seed) {
    test::Random random{std::uint64_t(seed)};
    constexpr Eigen::Index n = 5, rows = 4;
    Eigen::MatrixXd A(6 * rows, n);
    for (Eigen::Index k = 0; k < n; ++k) A.col(k) = 5 * normals(6 * rows, random);
    const Eigen::VectorXd b = A * normals(n, random) + normals(6 * rows, random);
    const int kinks = 1 + seed % 3;
    const Predictor predict = [&](const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
      residual = A * x - b;
      if (jacobian) *jacobian = A;
      for (Eigen::Index i = 0; i < kinks; ++i) {
        if (jacobian) jacobian->row(i) = residual[i] < 0 ? Eigen::RowVectorXd(-A.row(i)) : Eigen::RowVectorXd(A.row(i));
        residual[i] = 2 + std::abs(residual[i]);
      }
      return true;
    };
    UnitNoise cost(predict, std::vector<FreeParameter>(n, {"p", 0, 1}), rows);
    detail::Objective& objective = cost.objective;
    Eigen::VectorXd z = Eigen::VectorXd::Zero(n);
    const detail::Descent found = cost.descend(z);
    EXPECT_TRUE(found.converged) << seed;
    const int predicted = objective.evaluations();
    EXPECT_LT(predicted, 60) << seed;
    EXPECT_NEAR(found.cost, objective.cost(z), 1e-12);
    EXPECT_EQ(objective.evaluations(), predicted) << seed;  // what was predicted there is kept
    for (int probe = 0; probe < 400; ++probe)
      EXPECT_GT(objective.cost(z + std::pow(10, test::uniform(random, -3, 0)) * normals(n, random)), found.cost - 0.03);
    at_kink += found.at_kink;
  }
  EXPECT_GT(at_kink, 10);
}

// Rows k max(t - c, 0), as of a wall that some tips touch: each has a kink, and the cost is not convex.
// In a narrow valley that bends, full steps fail on smooth costs too, and short ones gain little: both look like a kink.
// What is left in the end is about the tolerance nevertheless, and not many times as much.
TEST(Descent, FollowsAValleyThatBends) {
  for (int seed = 0; seed < 60; ++seed) {
    test::Random random{std::uint64_t(seed)};
    const double along = test::uniform(random, 1, 10), across = std::exp(test::uniform(random, 1, 4));
    const double bend = test::uniform(random, 0.3, 1.5), tolerance = seed % 2 == 0 ? 0.02 : 0.5;
    const Predictor predict = [&](const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
      residual = Eigen::VectorXd::Zero(6);
      residual.head<2>() << along * (1 - x[0]), across * (x[1] - bend * x[0] * x[0]);
      if (!jacobian) return true;
      *jacobian = Eigen::MatrixXd::Zero(6, 2);
      jacobian->topRows<2>() << -along, 0, -2 * across * bend * x[0], across;
      return true;
    };
    UnitNoise cost(predict, {{"along", 0, 1e3}, {"across", 0, 1e3}}, 1);
    const double begin = test::uniform(random, -1, 0.7);
    Eigen::VectorXd z = cost.objective.z(Eigen::Vector2d(begin, bend * begin * begin));
    const detail::Descent found = cost.descend(z, tolerance);
    EXPECT_TRUE(found.converged) << seed;
    EXPECT_LT(found.cost, 2 * tolerance) << seed << ": " << along << ' ' << across << ' ' << begin;
  }
}

TEST(Descent, DoesNotTakeACostThatIsNotConvexForAKink) {
  for (int seed = 0; seed < 40; ++seed) {
    test::Random random{std::uint64_t(seed)};
    constexpr Eigen::Index rows = 10;
    const Eigen::ArrayXd t = Eigen::ArrayXd::LinSpaced(6 * rows, 0, 1);
    const Eigen::Vector2d truth(test::uniform(random, 50, 300), test::uniform(random, 0.3, 0.8));
    const auto reading = [&](const Eigen::VectorXd& x) -> Eigen::VectorXd { return x[0] * (t - x[1]).max(0); };
    const Eigen::VectorXd y = reading(truth) + normals(6 * rows, random);
    const Predictor predict = [&](const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
      residual = reading(x) - y;
      if (!jacobian) return true;
      jacobian->resize(6 * rows, 2);
      jacobian->col(0) = (t - x[1]).max(0);
      jacobian->col(1) = (t > x[1]).select(Eigen::ArrayXd::Constant(t.size(), -x[0]), 0.0);
      return true;
    };
    UnitNoise cost(predict, {{"k", 0, 1000}, {"c", 0.5, 1}}, rows);
    detail::Objective& objective = cost.objective;
    Eigen::VectorXd z = objective.z(Eigen::Vector2d(test::uniform(random, 20, 600), test::uniform(random, 0.1, 0.9)));
    const detail::Descent found = cost.descend(z);
    EXPECT_TRUE(found.converged) << seed;
    EXPECT_LT(found.cost, objective.cost(objective.z(truth))) << seed;
  }
}

}  // namespace descent_test
