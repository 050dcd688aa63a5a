#pragma once
// Translational offsets and effective lengths, from a ruler, the motors and tips flush with the front plate.
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "ctcr/calibration/procedures/notice.hpp"
#include "ctcr/calibration/statistics.hpp"
#include "ctcr/core/types.hpp"

namespace ctcr {

/// Measurements of one tube; any two of the three lists are enough.
struct TubeHome {
  double home_angle = 0;               ///< of its translation motor in the home position [rad]
  std::vector<double> distances{};     ///< from the front plate back to where it is grasped, at home, by hand [m], > 0
  std::vector<double> flush_angles{};  ///< of the motor when the tip is flush with the front plate [rad]
  std::vector<double> lengths{};       ///< from the grasp to the tip, by hand or from the data sheet [m]
};

struct HomeOptions {
  double translation_ratio = 1;  ///< rho of beta = rho theta + Delta [m/rad]
  double distance_sd = 1e-3;     ///< of one such measurement [m]
  double flush_sd = 0.2e-3;      ///< of seeing a tip flush [m]
  double length_sd = 1e-3;       ///< [m]
};

enum class HomeNotice {
  inconsistent,  ///< figure: distance + travel to flush - length [m]
  out_of_order,  ///< figure: by how much a tube is grasped, or ends, beyond the one inside it [m]
};

/// The notice's name.
constexpr const char* to_string(HomeNotice kind) {
  return std::array{"inconsistent", "out_of_order"}.at(std::size_t(kind));
}

/// Of one tube. Offset and length share the error of the ruler: their sum, and so the tip, is known to that of the flush
/// reading alone, hence the correlation near -1.
struct HomeOffset {
  double offset, offset_sd;      ///< Delta of beta [m]
  double length, length_sd;      ///< effective length, from the grasp to the tip [m]
  double correlation;            ///< of the two
  double deployed, deployed_sd;  ///< how far the tip is out of the plate at home [m]
};

struct Home {
  std::vector<HomeOffset> tubes;  ///< innermost first
  Notices<HomeNotice> notices;
};

namespace home {

/// Mean of repeated measurements with its sd: that stated for one, or their scatter where it is larger.
struct Mean {
  double value, sd;
};

inline Mean mean_of(const std::vector<double>& values, double sd) {
  const Eigen::Map<const Eigen::ArrayXd> v(values.data(), Eigen::Index(values.size()));
  const double n = double(values.size()), mean = v.mean();
  const double scatter = values.size() > 1 ? std::sqrt((v - mean).square().sum() / (n - 1)) : 0;
  return {mean, std::max(sd, scatter) / std::sqrt(n)};
}

inline void check(const TubeHome& tube, std::size_t number) {
  const int kinds = !tube.distances.empty() + !tube.flush_angles.empty() + !tube.lengths.empty();
  require(kinds >= 2, "tube %zu: two of home distance, flush reading and length are needed, here is %s", number,
          kinds == 1 ? "one" : "none");
  bool is_finite = std::isfinite(tube.home_angle);
  for (const auto* list : {&tube.distances, &tube.flush_angles, &tube.lengths})
    for (const double value : *list) is_finite = is_finite && std::isfinite(value);
  require(is_finite, "tube %zu: a measurement is not a finite number", number);
  for (const auto* list : {&tube.distances, &tube.lengths})
    for (const double value : *list)
      require(value > 0 && value < 10,
              "tube %zu: %g m is no distance from plate to grasp and no tube length: give metres, positive", number,
              value);
}

}  // namespace home

/// Translational offsets and effective lengths by weighted least squares: distance = -(rho theta_home + Delta),
/// 0 = rho theta_flush + Delta + length, and the length where it was measured too.
/// @throws std::invalid_argument naming the tube and what is wrong. Real time: no.
/// Ref: Boyer et al., Section V.
[[nodiscard]] inline Home home_offsets(std::span<const TubeHome> tubes, const HomeOptions& options) {
  using namespace home;
  constexpr double mm = 1e-3;
  require(!tubes.empty(), "no tube is given");
  require(std::isfinite(options.translation_ratio) && options.translation_ratio != 0,
          "the translation ratio [m/rad] must be finite and not 0");
  require(options.distance_sd > 0 && options.flush_sd > 0 && options.length_sd > 0,
          "the standard deviations of distance, flush reading and length [m] must be positive");
  Home result;
  for (std::size_t i = 0; i < tubes.size(); ++i) {
    const TubeHome& tube = tubes[i];
    check(tube, i + 1);
    const double rho = options.translation_ratio;
    // Rows of A (Delta, length) = b, each divided by its sd.
    Eigen::Matrix<double, 3, 2> A = Eigen::Matrix<double, 3, 2>::Zero();
    Vec3 b = Vec3::Zero();
    const auto measured = [&](int row, double by_offset, double by_length, const Mean& mean) {
      A.row(row) << by_offset / mean.sd, by_length / mean.sd;
      b[row] = mean.value / mean.sd;
    };
    if (!tube.distances.empty()) {
      const Mean d = mean_of(tube.distances, options.distance_sd);
      measured(0, -1, 0, {d.value + rho * tube.home_angle, d.sd});
    }
    if (!tube.flush_angles.empty()) {
      const Mean theta = mean_of(tube.flush_angles, options.flush_sd / std::abs(rho));
      measured(1, 1, 1, {-rho * theta.value, std::abs(rho) * theta.sd});
    }
    if (!tube.lengths.empty()) measured(2, 0, 1, mean_of(tube.lengths, options.length_sd));

    const Eigen::Matrix2d covariance = (A.transpose() * A).inverse();
    const Eigen::Vector2d x = covariance * (A.transpose() * b), sd = covariance.diagonal().cwiseSqrt();
    const double tip_sd = std::sqrt(std::max(0.0, covariance.sum()));
    result.tubes.push_back({.offset = x[0],
                            .offset_sd = sd[0],
                            .length = x[1],
                            .length_sd = sd[1],
                            .correlation = covariance(0, 1) / (sd[0] * sd[1]),
                            .deployed = rho * tube.home_angle + x[0] + x[1],
                            .deployed_sd = tip_sd});
    require(x[1] > 0,
            "tube %zu: its length comes out as %.1f mm: the sign of the translation ratio or a flush "
            "reading is wrong",
            i + 1, x[1] / mm);
    const double misfit = (A * x - b).norm();
    if (!tube.distances.empty() && !tube.flush_angles.empty() && !tube.lengths.empty() && misfit > surprising) {
      const double gap = mean_of(tube.distances, 1).value +
                         rho * (tube.home_angle - mean_of(tube.flush_angles, 1).value) - mean_of(tube.lengths, 1).value;
      result.notices.add(HomeNotice::inconsistent, gap, gap * surprising / misfit,
                         "tube %zu: distance and travel make it %.2f mm longer than it was measured", i + 1, gap / mm);
    }
    if (i == 0) continue;
    const HomeOffset &inner = result.tubes[i - 1], &outer = result.tubes[i];
    const double grasp = rho * (tubes[i - 1].home_angle - tube.home_angle) + inner.offset - outer.offset;
    const double excess = std::max(grasp, outer.deployed - inner.deployed);
    const double limit = surprising * std::hypot(inner.offset_sd, outer.offset_sd);
    if (excess > limit)
      result.notices.add(HomeNotice::out_of_order, excess, limit, "at home tube %zu %s tube %zu by %.2f mm", i + 1,
                         excess == grasp ? "is grasped behind" : "reaches beyond", i, excess / mm);
  }
  return result;
}

}  // namespace ctcr
