#include "ctcr/calibration/procedures/home.hpp"

#include <gtest/gtest.h>

#include "calibration/simulated.hpp"

namespace home_test {

using namespace ctcr;
using namespace ctcr::test;

constexpr double ratio = 2e-3 / (2 * std::numbers::pi);  // 2 mm a turn

/// What a person reads of a tube with this offset and length.
TubeHome measured(Random& random, double offset, double length, const HomeOptions& sd, bool has_length = false,
                  int times = 1, double home_angle = 40) {
  const double home_beta = ratio * home_angle + offset;
  TubeHome tube{.home_angle = home_angle};
  for (int k = 0; k < times; ++k) {
    tube.distances.push_back(-home_beta + normal(random, sd.distance_sd));
    tube.flush_angles.push_back((-length - offset + normal(random, sd.flush_sd)) / ratio);
    if (has_length) tube.lengths.push_back(length + normal(random, sd.length_sd));
  }
  return tube;
}

TEST(Home, FindsThePapersOffsetsAndLengths) {
  // Table II, all motors at 0 in the home position.
  const double offset[] = {-298.0e-3, -220.5e-3, -145.0e-3}, length[] = {463.0e-3, 330.5e-3, 199.0e-3};
  std::vector<TubeHome> tubes(3);
  for (std::size_t i = 0; i < 3; ++i) {
    tubes[i].distances = {-offset[i]};
    tubes[i].flush_angles = {-(offset[i] + length[i]) / ratio};
  }
  const Home home = home_offsets(tubes, {.translation_ratio = ratio});
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(home.tubes[i].offset, offset[i], 1e-15);
    EXPECT_NEAR(home.tubes[i].length, length[i], 1e-15);
    EXPECT_NEAR(home.tubes[i].deployed, length[i] + offset[i], 1e-15);
    EXPECT_NEAR(home.tubes[i].offset_sd, 1e-3, 1e-15);      // the ruler's
    EXPECT_NEAR(home.tubes[i].deployed_sd, 0.2e-3, 1e-15);  // that of the flush reading alone
    EXPECT_LT(home.tubes[i].correlation, -0.98);
  }
  EXPECT_TRUE(home.notices.empty());
}

TEST(Home, AnyTwoMeasurementsAreEnough) {
  HomeOptions options{.translation_ratio = -ratio};
  const double offset = -0.25, length = 0.3, theta = 12;
  const TubeHome all{.home_angle = theta,
                     .distances = {-(options.translation_ratio * theta + offset)},
                     .flush_angles = {-(length + offset) / options.translation_ratio},
                     .lengths = {length}};
  for (int left_out = 0; left_out < 4; ++left_out) {
    TubeHome tube = all;
    if (left_out == 0) tube.distances.clear();
    if (left_out == 1) tube.flush_angles.clear();
    if (left_out == 2) tube.lengths.clear();
    const HomeOffset found = home_offsets(std::vector{tube}, options).tubes[0];
    EXPECT_NEAR(found.offset, offset, 1e-14);
    EXPECT_NEAR(found.length, length, 1e-14);
  }
}

TEST(Home, SdIsHonest) {
  const HomeOptions options{.translation_ratio = ratio};
  for (const bool has_length : {false, true})
    for (const int times : {1, 4}) {
      Random random(1);
      NormalisedErrors offset, length, tip;
      for (int n = 0; n < 400; ++n) {
        const TubeHome tube = measured(random, -0.2, 0.35, options, has_length, times);
        const HomeOffset found = home_offsets(std::vector{tube}, options).tubes[0];
        offset.add(found.offset + 0.2, found.offset_sd);
        length.add(found.length - 0.35, found.length_sd);
        tip.add(found.deployed - (ratio * 40 + 0.15), found.deployed_sd);
      }
      // Repeated values may only widen the stated sd, so it is a little on the safe side.
      if (times == 1) offset.expect_honest(), length.expect_honest(), tip.expect_honest();
      for (const auto* errors : {&offset, &length, &tip}) {
        EXPECT_LT(errors->mean_square(), 1.3);
        EXPECT_GT(errors->mean_square(), 0.55);
      }
    }
}

TEST(Home, TellsContradictionsAndTubesOutOfOrder) {
  const HomeOptions options{.translation_ratio = ratio};
  Random random(2);
  int told = 0, told_shifted = 0;
  for (int n = 0; n < 300; ++n) {
    TubeHome tube = measured(random, -0.2, 0.35, options, true);
    told += !home_offsets(std::vector{tube}, options).notices.empty();
    tube.lengths[0] += 8 * mm;
    told_shifted += tells(home_offsets(std::vector{tube}, options), HomeNotice::inconsistent);
  }
  EXPECT_LE(told, 3);
  EXPECT_GE(told_shifted, 290);
  const TubeHome inner = measured(random, -0.2, 0.35, options), outer = measured(random, -0.25, 0.3, options);
  EXPECT_TRUE(tells(home_offsets(std::vector{inner, outer}, options), HomeNotice::out_of_order));
  EXPECT_TRUE(
      tells(home_offsets(std::vector{inner, measured(random, -0.1, 0.3, options)}, options), HomeNotice::out_of_order));
  EXPECT_FALSE(
      tells(home_offsets(std::vector{inner, measured(random, -0.1, 0.2, options)}, options), HomeNotice::out_of_order));
}

TEST(Home, RefusesWithWords) {
  const auto said = [](const TubeHome& tube, double rho = ratio) {
    return refusal([&] { (void)home_offsets(std::vector{tube}, {.translation_ratio = rho}); });
  };
  const TubeHome sound{.distances = {0.3}, .flush_angles = {-500}};
  EXPECT_EQ(said(sound), "");
  EXPECT_TRUE(contains(said({.distances = {0.3}}), "tube 1: two of"));
  EXPECT_TRUE(contains(said({.distances = {-0.3}, .flush_angles = {-500}}), "-0.3 m"));
  EXPECT_TRUE(contains(said({.distances = {298}, .flush_angles = {-500}}), "give metres"));
  EXPECT_TRUE(contains(said({.distances = {0.3}, .flush_angles = {std::nan("")}}), "finite"));
  EXPECT_TRUE(contains(said({.distances = {0.1}, .flush_angles = {500}}), "sign of the translation ratio"));
  EXPECT_TRUE(contains(said(sound, 0), "ratio"));
}

}  // namespace home_test
