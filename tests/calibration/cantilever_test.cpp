#include "ctcr/calibration/procedures/cantilever.hpp"

#include <gtest/gtest.h>

#include "calibration/simulated.hpp"

namespace cantilever_test {

using namespace ctcr;
using namespace ctcr::test;
using enum CantileverNotice;

/// End angle and deflection of a clamped rod of length 1 that bends by y'' = load (cos): classical Runge-Kutta on
/// theta' = kappa, kappa' = -load cos theta from the load inwards, the angle there found by bisection.
Elastica integrated(double load) {
  const auto shot = [&](double angle) {
    constexpr int steps = 4000;
    constexpr double h = 1.0 / steps;
    Vec3 y(angle, 0, 0);  // theta, kappa and deflection, from the load to the clamp
    const auto rate = [&](const Vec3& v) { return Vec3(-v[1], load * std::cos(v[0]), std::sin(v[0])); };
    for (int i = 0; i < steps; ++i) {
      const Vec3 k1 = rate(y), k2 = rate(y + 0.5 * h * k1), k3 = rate(y + 0.5 * h * k2), k4 = rate(y + h * k3);
      y += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    return y;
  };
  double low = 0, high = std::numbers::pi / 2;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (shot(middle)[0] < 0 ? low : high) = middle;
  }
  return {load, low, shot(low)[2]};
}

const CantileverOptions tube{.inner_diameter = 1.30e-3, .outer_diameter = 1.52e-3};
double stiffness(double E) {
  return E * Tube{.inner_diameter = tube.inner_diameter, .outer_diameter = tube.outer_diameter}.second_moment();
}

/// A table of weights hung on a tube; `softening` lets the modulus fall with the load.
std::vector<Deflection> table(Random& random, double E, double noise, double softening = 0, double zero = 0) {
  std::vector<Deflection> rows;
  for (int i = 1; i <= 10; ++i) {
    Deflection row{.load = 0.02 * i, .deflection = 0, .free_length = 0.15, .load_distance = i % 2 ? 0.15 : 0.12};
    const double deflection = cantilever::end_of(row, stiffness(E) * (1 - softening * row.load / 0.2)).deflection;
    row.deflection = deflection + zero + normal(random, noise);
    rows.push_back(row);
  }
  return rows;
}

TEST(Elastica, IsTheSolutionOfItsEquation) {
  for (const double load : {1e-4, 0.1, 1.0, 3.0, 10.0, 40.0}) {
    const Elastica exact = elastica_under(load), fine = integrated(load);
    EXPECT_NEAR(exact.load, load, 1e-13 * load);
    EXPECT_NEAR(exact.angle, fine.angle, 1e-11);
    EXPECT_NEAR(exact.deflection, fine.deflection, 1e-11);
  }
}

TEST(Elastica, SmallDeflectionsAreThoseOfTheLinearBeam) {
  for (const double load : {1e-9, 1e-6, 1e-4}) {
    const Elastica rod = elastica_under(load);
    EXPECT_NEAR(rod.deflection / (load / 3), 1, load + 1e-12);
    EXPECT_NEAR(rod.angle / (load / 2), 1, load + 1e-12);
  }
}

TEST(Cantilever, RecoversTheModulusToRounding) {
  Random random(1);
  for (int n = 0; n < 50; ++n) {
    const double E = uniform(random, 20e9, 220e9);
    CantileverOptions options = tube;
    options.fit_zero = n % 2;
    const double zero = options.fit_zero ? uniform(random, -1, 1) * mm : 0;
    const Cantilever found = fit_cantilever(table(random, E, 0, 0, zero), options);
    EXPECT_NEAR(found.youngs_modulus / E, 1, 1e-11);
    EXPECT_NEAR(found.bending_stiffness / stiffness(E), 1, 1e-11);
    EXPECT_NEAR(found.zero, zero, 1e-13);
    for (const double alone : found.row_modulus) EXPECT_NEAR(alone / E, 1, 1e-9);
  }
}

TEST(Cantilever, TurnsWithTheDirectionOfTheLoad) {
  Random random(2);
  std::vector<Deflection> rows = table(random, 58e9, 0.1 * mm);
  const Cantilever down = fit_cantilever(rows, tube);
  for (Deflection& row : rows) row.load = -row.load, row.deflection = -row.deflection;
  const Cantilever up = fit_cantilever(rows, tube);
  EXPECT_NEAR(up.youngs_modulus / down.youngs_modulus, 1, 1e-12);
  EXPECT_NEAR(up.end_angle[3], -down.end_angle[3], 1e-12);
}

TEST(Cantilever, SdIsHonest) {
  for (const bool fits_zero : {false, true})
    for (const bool is_stated : {false, true}) {
      Random random(3);
      NormalisedErrors modulus, zero;
      for (int n = 0; n < 200; ++n) {
        CantileverOptions options = tube;
        options.fit_zero = fits_zero;
        if (is_stated) options.deflection_sd = 0.2 * mm;
        const Cantilever found = fit_cantilever(table(random, 58e9, 0.2 * mm), options);
        modulus.add(found.youngs_modulus - 58e9, found.youngs_modulus_sd);
        if (fits_zero) zero.add(found.zero, found.zero_sd);
      }
      // Where the sd is estimated from the residuals, t of 8 or 9 degrees of freedom: mean square up to 8/6.
      EXPECT_GT(modulus.mean_square(), 0.7);
      EXPECT_LT(modulus.mean_square(), is_stated ? 1.4 : 1.8);
      if (!fits_zero) continue;
      EXPECT_GT(zero.mean_square(), 0.7);
      EXPECT_LT(zero.mean_square(), is_stated ? 1.4 : 1.8);
    }
}

TEST(Cantilever, LengthAndDiametersCountAsTheyDoInTheFormula) {
  // Small deflections: E is proportional to L^3 / I.
  Random random(4);
  CantileverOptions options = tube;
  options.free_length_sd = 1 * mm;
  std::vector<Deflection> rows{{.load = 1e-3, .deflection = 0, .free_length = 0.1}};
  rows[0].deflection = cantilever::end_of(rows[0], stiffness(58e9)).deflection;
  options.deflection_sd = 1e-12;
  Cantilever found = fit_cantilever(rows, options);
  EXPECT_NEAR(found.youngs_modulus_sd / found.youngs_modulus, 0.03, 1e-4);
  EXPECT_NEAR(found.bending_stiffness_sd / found.bending_stiffness, 0.03, 1e-4);
  options.free_length_sd = 0;
  options.diameter_sd = 1e-5;
  found = fit_cantilever(rows, options);
  const double h = 1e-9;
  const auto I = [](double i, double o) { return Tube{.inner_diameter = i, .outer_diameter = o}.second_moment(); };
  const double di = tube.inner_diameter, d_o = tube.outer_diameter;
  const double by_inner = (I(di + h, d_o) - I(di - h, d_o)) / (2 * h),
               by_outer = (I(di, d_o + h) - I(di, d_o - h)) / (2 * h);
  EXPECT_NEAR(found.youngs_modulus_sd / found.youngs_modulus, std::hypot(by_inner, by_outer) / I(di, d_o) * 1e-5, 1e-6);
}

TEST(Cantilever, TellsSofteningScatterAndSmallDeflections) {
  Random random(5);
  int clean = 0, soft = 0, scattered = 0, small = 0;
  for (int n = 0; n < 200; ++n) {
    CantileverOptions stated = tube;
    stated.deflection_sd = 0.1 * mm;
    clean += !fit_cantilever(table(random, 58e9, 0.1 * mm), n % 2 ? stated : tube).notices.empty();
    soft += tells(fit_cantilever(table(random, 58e9, 0.1 * mm, 0.2), tube), load_dependent);
    scattered += tells(fit_cantilever(table(random, 58e9, 0.4 * mm), stated), residuals_large);
    std::vector<Deflection> rows = table(random, 58e9, 0);
    for (Deflection& row : rows) row.load *= 0.01, row.deflection *= 0.01;
    CantileverOptions coarse = tube;
    coarse.deflection_sd = 0.5 * mm;
    small += tells(fit_cantilever(rows, coarse), deflection_small);
  }
  EXPECT_LE(clean, 4);
  EXPECT_GE(soft, 195);
  EXPECT_GE(scattered, 195);
  EXPECT_EQ(small, 200);
}

TEST(Cantilever, RefusesWithWords) {
  Random random(6);
  const std::vector<Deflection> sound = table(random, 58e9, 0);
  const auto said = [&](const Deflection& row, const CantileverOptions& options = tube) {
    std::vector<Deflection> rows = sound;
    rows[2] = row;
    return refusal([&] { (void)fit_cantilever(rows, options); });
  };
  EXPECT_EQ(said(sound[2]), "");
  EXPECT_TRUE(contains(said({0, 0.01, 0.15}), "row 3: a load of 0 N"));
  EXPECT_TRUE(contains(said({0.1, -0.01, 0.15}), "row 3: the tube must deflect along"));
  EXPECT_TRUE(contains(said({0.1, 0.01, 0}), "row 3: the free length"));
  EXPECT_TRUE(contains(said({0.1, 0.01, 0.15, 0.2}), "row 3: the load must act"));
  EXPECT_TRUE(contains(said({0.1, 10, 0.15}), "is the unit m?"));
  EXPECT_TRUE(contains(said({std::nan(""), 0.01, 0.15}), "row 3: a value"));
  EXPECT_TRUE(contains(said(sound[2], {.inner_diameter = 2e-3, .outer_diameter = 1e-3}), "outer diameter"));
  EXPECT_TRUE(contains(refusal([&] { (void)fit_cantilever({}, tube); }), "no load"));
  const std::vector<Deflection> one{sound[0]};
  EXPECT_TRUE(contains(refusal([&] { (void)fit_cantilever(one, tube); }), "no scatter"));
}

}  // namespace cantilever_test
