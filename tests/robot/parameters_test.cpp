#include "ctcr/robot/parameters.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace parameters_test {

using namespace ctcr;

template <int N>
void expect_one_to_one() {
  using P = ParameterVector<N>;
  std::set<std::string> names;
  for (int p = 0; p < P::count; ++p) {
    const auto [kind, i] = P::entry(p);
    EXPECT_EQ(P::index(kind, i), p);
    EXPECT_LT(i, P::size(kind));
    EXPECT_EQ(p < P::robot_count, kind == Parameter::gravity || P::info(kind).field != nullptr);
    EXPECT_TRUE(names.emplace(std::string_view(P::name(p))).second);
  }
  EXPECT_EQ(P::robot_count, 9 * N + 3);
  EXPECT_EQ(P::count, P::robot_count + 2 + 2 * N + 12);
}

TEST(Parameters, HaveOnePlaceAndOneName) {
  expect_one_to_one<1>();
  expect_one_to_one<3>();
  expect_one_to_one<4>();
}

TEST(Parameters, NamesSayTubeOrAxis) {
  using P = ParameterVector<3>;
  const auto name = [](Parameter kind, int i) { return std::string(P::name(P::index(kind, i))); };
  EXPECT_EQ(name(Parameter::youngs_modulus, 0), "tubes.1.youngs_modulus");
  EXPECT_EQ(name(Parameter::bending_stiffness, 2), "tubes.3.bending_stiffness");
  EXPECT_EQ(name(Parameter::gravity, 2), "gravity.z");
  EXPECT_EQ(name(Parameter::rotation_ratio, 0), "actuation.rotation_ratio");
  EXPECT_EQ(name(Parameter::home_translation, 1), "actuation.home_translation.2");
  EXPECT_EQ(name(Parameter::tracker_rotation, 0), "tracker.rotation.x");
  EXPECT_EQ(name(Parameter::sensor_rotation, 2), "tracker.sensor_rotation.z");
}

TEST(Parameters, RangesAreRanges) {
  for (const ParameterKind& kind : parameter_kinds) EXPECT_LT(kind.low, kind.high) << kind.name;
}

}  // namespace parameters_test
