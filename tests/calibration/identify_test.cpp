#include "ctcr/calibration/identification/identify.hpp"

#include <gtest/gtest.h>

#include "calibration/toy.hpp"
#include "ctcr/calibration/identification/row_report.hpp"

namespace identify_test {

using namespace ctcr;
using test::infinity;
using test::noise;
using test::normals;
using test::Toy;

TEST(Identify, IsTheExactPosteriorOfALinearModel) {
  test::Random random(1);
  Toy toy(15, 4, 0, random);
  toy.add_noise(noise, random);
  const Identification fit =
      identify(toy.predictor(), toy.parameters(), noise, toy.places, {.robust = false, .admit_model_error = false});
  ASSERT_TRUE(fit.converged) << fit.status;
  const Eigen::MatrixXd S = toy.covariance(noise);
  const Eigen::LLT<Eigen::MatrixXd> inverse(S);
  const Eigen::MatrixXd weighted = inverse.solve(toy.slope), I = Eigen::MatrixXd::Identity(4, 4);
  const Eigen::MatrixXd covariance = least_squares(transposed_product(toy.slope, weighted) + I, I);
  const Eigen::VectorXd x = covariance * (weighted.transpose() * toy.y);
  EXPECT_LE((fit.values - x).norm(), 1e-5);
  EXPECT_LE((fit.covariance - covariance).norm(), 1e-3 * covariance.norm());
  const Eigen::VectorXd r = toy.y - toy.slope * x;
  EXPECT_NEAR(fit.chi_square, r.dot(inverse.solve(r)), 1e-3 * fit.chi_square);
  EXPECT_NEAR(fit.effective_parameters, 4 - covariance.trace(), 1e-3);
  // The evidence is the density of the readings when the parameters are drawn from the prior.
  const Eigen::LLT<Eigen::MatrixXd> all(S + product(toy.slope, toy.slope.transpose()));
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
  // A fit that goes on from there is told whom to trust.
  const auto from_there = [&](std::optional<RowWeights> weights) {
    return identify(toy.predictor(), toy.parameters(), noise, toy.places,
                    {.start = robust.values, .first_weights = std::move(weights), .starts = 1});
  };
  const Identification on = from_there(robust.weights), anew = from_there({});
  EXPECT_LT((on.values - robust.values).cwiseQuotient(robust.sd).cwiseAbs().maxCoeff(), 1e-2);
  EXPECT_NEAR(on.log_evidence, robust.log_evidence, 0.1);
  EXPECT_LT(on.evaluations, anew.evaluations);
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
  EXPECT_TRUE(says("without effect on these readings and left as it was: p5"));
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
  ASSERT_FALSE(fit.warnings.empty());
  EXPECT_TRUE(fit.warnings[0].ends_with("leave it out: p1, p2")) << fit.warnings[0];
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

}  // namespace identify_test
