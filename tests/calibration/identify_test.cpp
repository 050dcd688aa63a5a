#include "ctcr/calibration/identify.hpp"

#include <gtest/gtest.h>

#include "ctcr/calibration/row_report.hpp"
#include "support/random_robots.hpp"

namespace {

using namespace ctcr;

constexpr Noise noise{.position_jitter = 3e-5, .rotation_jitter = 5e-4, .position_field = 3e-4, .rotation_field = 3e-3};
constexpr double infinity = std::numeric_limits<double>::infinity();

Eigen::VectorXd normals(Eigen::Index count, test::Random& random) {
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

  Toy(Eigen::Index rows, Eigen::Index parameters, double curved, test::Random& random) : bend(curved) {
    places.resize(rows, 3);
    for (double& x : places.reshaped()) x = test::uniform(random, 0, 0.15);
    slope.resize(6 * rows, parameters);
    for (Eigen::Index k = 0; k < parameters; ++k) slope.col(k) = normals(6 * rows, random);
    for (Eigen::Index i = 0; i < 6 * rows; ++i) slope.row(i) *= i % 6 < 3 ? 1e-4 : 2e-3;
    truth = 0.7 * normals(parameters, random);
    y = model(truth);
  }

  Eigen::VectorXd model(const Eigen::VectorXd& x) const { return slope * (x + bend * x.cwiseAbs2()); }

  void add_noise(const Noise& n, test::Random& random) {
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
    const Eigen::MatrixXd K = field.factor * field.factor.transpose();
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

TEST(Identify, IsTheExactPosteriorOfALinearModel) {
  test::Random random(1);
  Toy toy(15, 4, 0, random);
  toy.add_noise(noise, random);
  const Identification fit =
      identify(toy.predictor(), toy.parameters(), noise, toy.places, {.robust = false, .admit_model_error = false});
  ASSERT_TRUE(fit.converged) << fit.status;
  const Eigen::MatrixXd S = toy.covariance(noise);
  const Eigen::LLT<Eigen::MatrixXd> inverse(S);
  const Eigen::MatrixXd H = toy.slope.transpose() * inverse.solve(toy.slope) + Eigen::MatrixXd::Identity(4, 4);
  const Eigen::VectorXd x = H.llt().solve(toy.slope.transpose() * inverse.solve(toy.y));
  EXPECT_LE((fit.values - x).norm(), 1e-5);
  EXPECT_LE((fit.covariance - H.inverse()).norm(), 1e-3 * H.inverse().norm());
  const Eigen::VectorXd r = toy.y - toy.slope * x;
  EXPECT_NEAR(fit.chi_square, r.dot(inverse.solve(r)), 1e-3 * fit.chi_square);
  EXPECT_NEAR(fit.effective_parameters, 4 - H.inverse().trace(), 1e-3);
  // The evidence is the density of the readings when the parameters are drawn from the prior.
  const Eigen::LLT<Eigen::MatrixXd> all(S + toy.slope * toy.slope.transpose());
  const double log_density =
      -0.5 * (toy.y.dot(all.solve(toy.y)) + double(toy.y.size()) * std::log(2 * std::numbers::pi)) -
      all.matrixLLT().diagonal().array().log().sum();
  EXPECT_NEAR(fit.log_evidence, log_density, 0.05);
}

TEST(Identify, FindsTheTruthWithinItsDeviationsAndAnHonestChiSquare) {
  constexpr int seeds = 100, n = 6;
  double distance = 0, chi_square = 0, degrees = 0;
  int within = 0;
  for (int seed = 0; seed < seeds; ++seed) {
    test::Random random{std::uint64_t(100 + seed)};
    Toy toy(60, n, 0.05, random);
    toy.add_noise(noise, random);
    const Identification fit = identify(toy.predictor(), toy.parameters(), noise, toy.places, {.starts = 1});
    ASSERT_TRUE(fit.converged) << fit.status;
    const Eigen::VectorXd error = fit.values - toy.truth;
    distance += error.dot(fit.covariance.llt().solve(error));
    within += int((error.cwiseAbs().array() < 2 * fit.sd.array()).count());
    chi_square += fit.chi_square;
    degrees += double(fit.observations) - fit.effective_parameters;
  }
  // Chi-square of n (of `degrees`): its mean over the seeds has the sd sqrt(2 n / seeds).
  EXPECT_NEAR(distance / seeds, n, 4 * std::sqrt(2.0 * n / seeds));
  EXPECT_NEAR(within / double(seeds * n), 0.954, 0.03);
  EXPECT_NEAR(chi_square / degrees, 1, 0.03);
}

TEST(Identify, TakesTheFieldForParametersWhereItIsIgnored) {
  double with = 0, without = 0;
  for (int seed = 0; seed < 20; ++seed) {
    test::Random random{std::uint64_t(seed)};
    Toy toy(80, 3, 0, random);
    // A parameter that looks like a field: the same everywhere.
    for (Eigen::Index i = 0; i < toy.slope.rows(); ++i) toy.slope(i, 0) = i % 6 == 0 ? 1e-4 : 0;
    toy.y = toy.model(toy.truth);
    toy.add_noise(noise, random);
    Noise jitter = noise;
    jitter.position_field = jitter.rotation_field = 0;
    const auto off = [&](const Noise& assumed) {
      const Identification fit =
          identify(toy.predictor(), toy.parameters(), assumed, toy.places, {.robust = false, .starts = 1});
      return std::pow((fit.values[0] - toy.truth[0]) / fit.sd[0], 2) / 20;
    };
    with += off(noise);
    without += off(jitter);
  }
  EXPECT_LT(with, 2);
  EXPECT_GT(without, 10);
}

TEST(Identify, IsHardlyMovedByOutliers) {
  test::Random random(3);
  Toy toy(200, 5, 0.05, random);
  toy.add_noise(noise, random);
  const Identification clean = identify(toy.predictor(), toy.parameters(), noise, toy.places);
  for (Eigen::Index i = 0; i < 200; i += 10)
    toy.y.segment<6>(6 * i) +=
        normals(6, random).cwiseProduct((Vec6() << 2e-3, 2e-3, 2e-3, 0.05, 0.05, 0.05).finished());
  const Identification robust = identify(toy.predictor(), toy.parameters(), noise, toy.places);
  const Identification plain = identify(toy.predictor(), toy.parameters(), noise, toy.places, {.robust = false});
  const auto moved = [&](const Identification& fit) {
    return (fit.values - clean.values).cwiseQuotient(clean.sd).cwiseAbs().maxCoeff();
  };
  EXPECT_LT(moved(robust), 1);
  EXPECT_GT(moved(plain), 5);
  EXPECT_LT(robust.reduced_chi_square, 1.2);
  EXPECT_FALSE(robust.warnings.empty());
  EXPECT_GT(robust.reduced_chi_square, 0.8);
  EXPECT_GT(clean.weights.mean(), 0.97);
  // Frozen weights give the same answer, and the same evidence to compare models by.
  const Identification frozen = identify(toy.predictor(), toy.parameters(), noise, toy.places,
                                         {.weights = robust.weights, .inflation = robust.inflation});
  EXPECT_LT((frozen.values - robust.values).cwiseQuotient(robust.sd).cwiseAbs().maxCoeff(), 1e-2);
  EXPECT_NEAR(frozen.log_evidence, robust.log_evidence, 1e-2);
}

TEST(Identify, NamesWhatTheReadingsDoNotDetermine) {
  test::Random random(4);
  Toy toy(60, 5, 0, random);
  toy.slope.col(1) = toy.slope.col(0);  // p1 + p2 alone matters
  toy.slope.col(4).setZero();
  toy.y = toy.model(toy.truth);
  toy.add_noise(noise, random);
  IdentifyOptions options;
  options.known.push_back({"the first against the second", (Eigen::VectorXd(5) << 1, -1, 0, 0, 0).finished()});
  options.known.push_back({"the third alone", Eigen::VectorXd::Unit(5, 2)});
  const Identification fit = identify(toy.predictor(), toy.parameters(), noise, toy.places, options);
  ASSERT_EQ(fit.directions.size(), 2u);
  EXPECT_EQ(fit.directions[0].text, "the first against the second (p1 - p2)");
  EXPECT_NEAR(fit.directions[0].ratio, 1, 1e-6);
  EXPECT_EQ(fit.directions[1].text, "p5");
  EXPECT_NEAR(fit.ratio[4], 1, 1e-9);
  EXPECT_NEAR(fit.effective_parameters, 3, 0.1);
  ASSERT_EQ(fit.correlations.size(), 1u);
  EXPECT_NEAR(fit.correlations[0].coefficient, -1, 0.05);
  const auto says = [&](const char* part) {
    return std::any_of(fit.warnings.begin(), fit.warnings.end(), [&](auto& w) { return w.find(part) != w.npos; });
  };
  EXPECT_TRUE(says("p5 has no effect"));
}

TEST(Identify, WithoutPriorAnswersWhatIsDeterminedAndSaysWhatIsNot) {
  test::Random random(5);
  Toy toy(60, 3, 0, random);
  toy.slope.col(1) = 2 * toy.slope.col(0);
  toy.y = toy.model(toy.truth);
  toy.add_noise(noise, random);
  const Identification fit = identify(toy.predictor(), toy.parameters(infinity), noise, toy.places);
  EXPECT_TRUE(fit.converged) << fit.status;
  EXPECT_EQ(fit.sd[0], infinity);
  EXPECT_EQ(fit.sd[1], infinity);
  EXPECT_LT(std::abs(fit.values[2] - toy.truth[2]), 4 * fit.sd[2]);
  EXPECT_TRUE(std::isnan(fit.ratio[0]) && std::isnan(fit.log_evidence));
  EXPECT_GE(fit.warnings.size(), 2u);
}

TEST(Identify, ForeseesTheErrorOfFittedAndOfUnseenRows) {
  constexpr int seeds = 100;
  Eigen::Array2d found[2] = {Eigen::Array2d::Zero(), Eigen::Array2d::Zero()}, foreseen[2] = {found[0], found[0]};
  for (int seed = 0; seed < seeds; ++seed) {
    test::Random random{std::uint64_t(seed)};
    Toy toy(24, 12, 0, random);
    toy.add_noise(noise, random);
    RowWeights weights = RowWeights::Ones(24, 2);
    weights.bottomRows(12).setZero();
    const Identification fit =
        identify(toy.predictor(), toy.parameters(), noise, toy.places, {.weights = weights, .starts = 1});
    const RowReport rows = report_rows(fit, toy.predictor());
    for (Eigen::Index i = 0; i < 24; ++i) {
      const auto r = rows.residual.segment<6>(6 * i);
      const Eigen::Array2d square(r.head<3>().squaredNorm(), r.tail<3>().squaredNorm());
      found[i / 12] += square;
      foreseen[i / 12] += rows.expected_square.row(i).transpose().array();
    }
  }
  for (int unseen = 0; unseen < 2; ++unseen)
    for (int kind = 0; kind < 2; ++kind)
      EXPECT_NEAR((found[unseen] / foreseen[unseen])[kind], 1, 0.15) << unseen << kind;
}

TEST(Identify, ComparesStartsAndKeepsTheBest) {
  // Two valleys: x = 1 (deep) and x = -1 (shallow); the prior mean leads into the shallow one.
  const Predictor predict = [](const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
    residual = Eigen::VectorXd::Constant(6, std::nan(""));
    residual[0] = 10 * (x[0] * x[0] - 1);
    residual[1] = 3 * (x[0] - 1);
    residual[2] = 0;
    if (jacobian) {
      jacobian->setZero(6, 1);
      (*jacobian)(0, 0) = 20 * x[0];
      (*jacobian)(1, 0) = 3;
    }
    return true;
  };
  const Noise unit{.position_jitter = 1, .rotation_jitter = 1};
  const std::vector<FreeParameter> parameters{{"x", -0.5, 1}};
  const Eigen::MatrixX3d places = Eigen::MatrixX3d::Zero(1, 3);
  IdentifyOptions options{.robust = false, .admit_model_error = false, .starts = 1};
  const Identification one = identify(predict, parameters, unit, places, options);
  options.starts = 12;
  const Identification many = identify(predict, parameters, unit, places, options);
  EXPECT_NEAR(one.values[0], -1, 0.2);
  EXPECT_NEAR(many.values[0], 1, 0.2);
  EXPECT_EQ(many.observations, 3);
}

TEST(Identify, StaysWithinBoundsAndSaysSo) {
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
  EXPECT_NE(fit.warnings[0].find("stopped at its bound"), std::string::npos);
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
    const Eigen::VectorXd x = KKT.fullPivLu().solve(right).head(n);
    bool inside = true;
    for (const LinearBound& bound : within) inside = inside && bound.change.dot(x) >= bound.low - 1e-9;
    const double cost = 0.5 * x.dot(H * x) - g.dot(x);
    if (inside && cost < least) least = cost, best = x;
  }
  return best;
}

TEST(Identify, KeepsSumsOfParametersWithinBounds) {
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
    const Eigen::LLT<Eigen::MatrixXd> inverse(toy.covariance(noise));
    const Eigen::MatrixXd H = toy.slope.transpose() * inverse.solve(toy.slope) + Eigen::MatrixXd::Identity(5, 5);
    const Eigen::VectorXd x = minimum_within(H, toy.slope.transpose() * inverse.solve(toy.y), within);
    EXPECT_TRUE(fit.converged) << fit.status;
    EXPECT_LT(std::sqrt((fit.values - x).dot(H * (fit.values - x))), 0.02) << seed;
    stopped += int(!fit.warnings.empty());
  }
  EXPECT_GT(stopped, 20);
}

TEST(Identify, KeepsTheNearerOfBoundsThatDepend) {
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

TEST(Identify, FindsAMinimumOnAKinkAndTheWayAlongIt) {
  // One row bends up where a sum of parameters changes sign, the others pull there: the minimum is that of the others on
  // the plane of the kink.
  for (int seed = 0; seed < 40; ++seed) {
    test::Random random{std::uint64_t(seed)};
    Toy toy(20, 6, 0, random);
    toy.add_noise(noise, random);
    const Eigen::VectorXd across = normals(6, random).normalized();
    const double pull = 1e-3, bend = 1e-3;
    const Predictor inner = toy.predictor();
    const Predictor kinked = [&](const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
      (void)inner(x, residual, jacobian);
      const double beyond = across.dot(x - toy.truth) + 0.5;  // the truth is on the side that costs
      residual[0] = pull + (beyond > 0 ? bend * beyond : 0);
      if (jacobian) jacobian->row(0) = (beyond > 0 ? bend : 0) * across.transpose();
      return true;
    };
    const Noise jitter{.position_jitter = 2e-4, .rotation_jitter = 4e-3};
    IdentifyOptions options{.robust = false, .admit_model_error = false, .starts = 1};
    const Identification fit = identify(kinked, toy.parameters(), jitter, toy.places, options);
    EXPECT_TRUE(fit.converged) << seed << fit.status;

    const Predictor without = [&](const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
      (void)inner(x, residual, jacobian);
      residual[0] = 0;
      if (jacobian) jacobian->row(0).setZero();
      return true;
    };
    options.within = {{"the kink", -across, 0.5 - across.dot(toy.truth)}};
    if (!(options.within[0].low <= 0)) continue;
    const Identification on_it = identify(without, toy.parameters(), jitter, toy.places, options);
    const Eigen::VectorXd apart = fit.values - on_it.values;
    EXPECT_LT(std::sqrt(apart.dot(fit.covariance.llt().solve(apart))), 0.1) << seed;
  }
}

TEST(Identify, ShortensAStepThatCannotBePredicted) {
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

void expect_refusal(const std::string& part, const std::function<void()>& call) {
  try {
    call();
    ADD_FAILURE() << "not refused: " << part;
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
}

TEST(Identify, RefusesInWords) {
  test::Random random(8);
  const Toy toy(10, 2, 0, random);
  const Predictor predict = toy.predictor();
  const auto with = [&](auto&& change) {
    auto parameters = toy.parameters();
    change(parameters);
    return [=, &toy] { (void)identify(predict, parameters, noise, toy.places); };
  };
  expect_refusal("nothing is free", with([](auto& p) { p.clear(); }));
  expect_refusal("p2: its prior standard deviation is 0", with([](auto& p) { p[1].sd = 0; }));
  expect_refusal("p1: its prior mean is not finite", with([](auto& p) { p[0].mean = std::nan(""); }));
  expect_refusal("outside its bounds", with([](auto& p) { p[0].low = 1; }));
  expect_refusal("a bound of a sum of parameters (order)", [&] {
    IdentifyOptions options;
    options.within = {{"order", Eigen::VectorXd::Ones(2), 0.1}};
    (void)identify(predict, toy.parameters(), noise, toy.places, options);
  });
  expect_refusal("do not fit together",
                 [&] { (void)identify(predict, toy.parameters(), noise, toy.places.topRows(9)); });
  expect_refusal("jitter", [&] { (void)identify(predict, toy.parameters(), Noise{}, toy.places); });
  expect_refusal("no reading is left", [&] {
    (void)identify(predict, toy.parameters(), noise, toy.places, {.weights = RowWeights::Zero(10, 2)});
  });
  expect_refusal("cannot be predicted",
                 [&] { (void)identify([](auto&&...) { return false; }, toy.parameters(), noise, toy.places); });
}

}  // namespace
