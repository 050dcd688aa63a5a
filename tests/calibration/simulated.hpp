#pragma once
// What tests of calibration share: noise of a tracker, and whether stated standard deviations are those of the errors.
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "ctcr/calibration/noise.hpp"
#include "ctcr/math/se3.hpp"
#include "support/random_robots.hpp"

namespace ctcr::test {

inline constexpr double degree = std::numbers::pi / 180, mm = 1e-3;

inline double normal(Random& random, double sd = 1) { return sd * std::normal_distribution<double>()(random); }
inline Vec3 normal_vector(Random& random, double sd) {
  return {normal(random, sd), normal(random, sd), normal(random, sd)};
}
inline Pose random_frame(Random& random) {
  return {rotation_matrix(random_vector(random, 3)), random_vector(random, 0.3)};
}

/// A smooth random error of place, of covariance field^2 exp(-d^2 / (2 length^2)) per axis: waves with random wave
/// vectors, which shares nothing with how the library describes it.
class Field {
public:
  Field(Random& random, double sd, double length) {
    constexpr int waves = 200;
    for (int k = 0; k < waves; ++k)
      waves_.push_back({normal_vector(random, 1 / length), uniform(random, 0, 2 * std::numbers::pi),
                        normal_vector(random, sd * std::sqrt(2.0 / waves))});
  }
  Vec3 operator()(const Vec3& place) const {
    Vec3 error = Vec3::Zero();
    for (const Wave& wave : waves_) error += wave.amplitude * std::cos(wave.vector.dot(place) + wave.phase);
    return error;
  }

private:
  struct Wave {
    Vec3 vector;
    double phase;
    Vec3 amplitude;
  };
  std::vector<Wave> waves_;
};

/// Mean square of errors over their stated sd; 1 where those are honest.
class NormalisedErrors {
public:
  void add(double error, double sd) {
    sum_ += error * error / (sd * sd);
    ++count_;
  }
  /// Bounds that an honest sd leaves once in some thousand tests.
  void expect_honest() const {
    const double margin = 3.5 * std::sqrt(2.0 / count_);
    EXPECT_GT(sum_ / count_, 1 - margin);
    EXPECT_LT(sum_ / count_, 1 + 1.15 * margin);
  }
  [[nodiscard]] double mean_square() const { return sum_ / count_; }

private:
  double sum_ = 0, count_ = 0;
};

template <class Result, class Kind>
bool tells(const Result& result, Kind kind) {
  for (const auto& notice : result.notices)
    if (notice.kind == kind) return true;
  return false;
}

/// The sentence with which input is refused; empty where it is not.
template <class F>
std::string refusal(const F& f) {
  try {
    f();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != text.npos; }

}  // namespace ctcr::test
