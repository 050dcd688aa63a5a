#pragma once
// Registration of the base frame to the tracker: from fiducials, whose CAD positions are known, touched with a probe.

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "ctcr/calibration/procedures/notice.hpp"
#include "ctcr/calibration/procedures/propagation.hpp"
#include "ctcr/calibration/procedures/small_problem.hpp"
#include "ctcr/calibration/statistics.hpp"

namespace ctcr {

/// A point of the robot and the readings of a probe held there.
struct Fiducial {
  std::string name;
  Vec3 position = Vec3::Zero();  ///< from the CAD [m], base frame
  std::vector<Vec3> readings{};  ///< [m], tracker frame; none: the point is left out
};

/// Mean of a point's readings, of which there is at least one.
inline Vec3 mean_reading(const Fiducial& point) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& reading : point.readings) sum += reading;
  return sum / double(point.readings.size());
}

struct RegistrationOptions {
  Noise noise{};            ///< of a reading's position
  double placement_sd = 0;  ///< how far, per axis, the probe sits from the CAD's point however often it is read [m]; 0:
                            ///< from the residuals, for which 3 points are too few
  double loss_scale = 0;    ///< beyond which points count ever less (Cauchy) [m]; 0: least squares
};

enum class RegistrationNotice {
  outliers,         ///< figure: number of points left out
  few_points,       ///< figure: points used; three check nothing
  without_reading,  ///< figure: number of points never read
  large_residuals,  ///< figure: fiducial registration error [m]
  wrong_scale,      ///< figure: size of what the tracker sees over that in the CAD
};

/// The notice's name.
constexpr const char* to_string(RegistrationNotice kind) {
  return std::array{"outliers", "few_points", "without_reading", "large_residuals", "wrong_scale"}.at(
      std::size_t(kind));
}

/// T_ref and how well it is known. Changes of T_ref are those of moved_frame(): displacement of the base frame's origin
/// [m], then rotation about it [rad], tracker axes.
struct Registration {
  Pose T_tracker_base;      ///< T_ref
  Mat6 covariance;          ///< of such a change
  double fre;               ///< fiducial registration error (FRE): RMS residual of points used [m]
  double fle;               ///< fiducial localisation error (FLE): sd of a point per axis, placement and reading [m]
  int degrees_of_freedom;   ///< of the residuals
  double repeatability_sd;  ///< of readings of one point, per axis [m]; NaN without repeats
  std::vector<Vec3> residuals;        ///< mean reading - T_ref point [m], tracker axes; NaN: not read
  std::vector<std::string> outliers;  ///< names of the points left out
  Notices<RegistrationNotice> notices;

  /// Expected target registration error (TRE): RMS distance [m] between where T_ref takes `target` [m], base frame, and where
  /// it is. For equal points this is the formula of Fitzpatrick, West, Maurer, "Predicting error in rigid-body
  /// point-based registration", 1998.
  [[nodiscard]] double target_error(const Vec3& target) const {
    const Vec3 arm = T_tracker_base.rotation * target;
    Eigen::Matrix<double, 3, 6> D;
    D << Mat3::Identity(), Mat3::Zero();
    for (int j = 0; j < 3; ++j) D.col(3 + j) = Vec3::Unit(j).cross(arm);
    return std::sqrt((D * covariance * D.transpose()).trace());
  }
};

namespace registration {

inline constexpr double mm = 1e-3;

/// Matching points, one a column [m].
struct Pairs {
  Eigen::Matrix3Xd base, tracker;
  [[nodiscard]] Eigen::Index count() const { return base.cols(); }
  [[nodiscard]] Pairs without(Eigen::Index i) const {
    std::vector<Eigen::Index> kept;
    for (Eigen::Index j = 0; j < count(); ++j)
      if (j != i) kept.push_back(j);
    return {base(Eigen::all, kept), tracker(Eigen::all, kept)};
  }
};

/// Where points miss those they are mapped to [m].
inline Eigen::Matrix3Xd errors(const Pose& T, const Pairs& pairs) {
  Eigen::Matrix3Xd error = pairs.tracker;
  for (Eigen::Index i = 0; i < error.cols(); ++i) error.col(i) -= T.rotation * pairs.base.col(i) + T.position;
  return error;
}

/// The rigid transform of least squares, in closed form from a singular value decomposition.
/// Ref: Arun, Huang, Blostein, "Least-squares fitting of two 3-D point sets", 1987, with the determinant of Umeyama, 1991.
inline Pose closed_form(const Pairs& pairs) {
  const Vec3 base = pairs.base.rowwise().mean(), tracker = pairs.tracker.rowwise().mean();
  Mat3 moments = Mat3::Zero();
  for (Eigen::Index i = 0; i < pairs.count(); ++i)
    moments += (pairs.tracker.col(i) - tracker) * (pairs.base.col(i) - base).transpose();
  const Eigen::JacobiSVD<Mat3> svd(moments, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vec3 sign(1, 1, (svd.matrixU() * svd.matrixV()).determinant() < 0 ? -1 : 1);
  const Mat3 R = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  return {R, tracker - R * base};
}
inline double squares(const Pairs& pairs) { return errors(closed_form(pairs), pairs).squaredNorm(); }

/// Standard deviations of points along their principal axes, largest first [m].
inline Vec3 extents(const Eigen::Matrix3Xd& points) {
  const Vec3 mean = points.rowwise().mean();
  Mat3 moments = Mat3::Zero();
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Vec3 d = points.col(i) - mean;
    moments += d * d.transpose() / double(points.cols());
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(moments, Eigen::EigenvaluesOnly);
  return axes.eigenvalues().reverse().cwiseMax(0.0).cwiseSqrt();
}

inline Pairs check(std::span<const Fiducial> points, std::vector<int>& read) {
  Pairs pairs{Eigen::Matrix3Xd(3, points.size()), Eigen::Matrix3Xd(3, points.size())};
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Fiducial& point = points[i];
    for (std::size_t j = 0; j < i; ++j)
      require(points[j].name != point.name, "the point '%s' is given twice", point.name.c_str());
    require(point.position.allFinite(), "point '%s': its CAD position [m] is not a finite number", point.name.c_str());
    for (const Vec3& reading : point.readings)
      require(reading.allFinite(), "point '%s': a reading [m] is not a finite number", point.name.c_str());
    if (point.readings.empty()) continue;
    pairs.base.col(Eigen::Index(read.size())) = point.position;
    pairs.tracker.col(Eigen::Index(read.size())) = mean_reading(point);
    read.push_back(int(i));
  }
  pairs.base.conservativeResize(3, Eigen::Index(read.size()));
  pairs.tracker.conservativeResize(3, Eigen::Index(read.size()));
  require(read.size() >= 3, "a registration needs readings of at least 3 points, here are %zu", read.size());
  for (const auto* side : {&pairs.base, &pairs.tracker}) {
    const Vec3 extent = extents(*side);
    require(extent[1] > 3e-3 * extent[0],
            "the %s lie on one line, so that the rotation about it is unknown: add a point beside it",
            side == &pairs.base ? "points of the CAD" : "readings");
  }
  const double scale = extents(pairs.tracker).norm() / extents(pairs.base).norm();
  require(scale > 0.1 && scale < 10,
          "the readings span %.3g times what the points of the CAD do: one of them has another unit", scale);
  return pairs;
}

/// Refuses points that only fit when mirrored, or when the names of two are exchanged.
inline void check_correspondence(const Pairs& pairs, std::span<const Fiducial> points, const std::vector<int>& read) {
  const double straight = squares(pairs), degrees = double(3 * pairs.count() - 6);
  const auto is_far_better = [&](double other) {
    const double ratio = straight / std::max(other, 1e-20 * pairs.base.squaredNorm());
    return ratio > 10 && variance_ratio_score(ratio, degrees, degrees) > 3;
  };
  const double mirrored = squares({-pairs.base, pairs.tracker});
  const double count = double(pairs.count());
  require(!is_far_better(mirrored),
          "the readings are a mirror image of the CAD's points (residual %.2f mm, mirrored %.2f mm): an axis has "
          "the wrong sign, or left and right are exchanged",
          std::sqrt(straight / count) / mm, std::sqrt(mirrored / count) / mm);
  Pairs exchanged = pairs;
  for (Eigen::Index i = 0; i < pairs.count(); ++i)
    for (Eigen::Index j = 0; j < i; ++j) {
      exchanged.base.col(i).swap(exchanged.base.col(j));
      const double other = squares(exchanged);
      require(!is_far_better(other),
              "the readings of '%s' and '%s' look exchanged: so the residual is %.2f mm, otherwise %.2f mm",
              points[std::size_t(read[std::size_t(j)])].name.c_str(),
              points[std::size_t(read[std::size_t(i)])].name.c_str(), std::sqrt(straight / count) / mm,
              std::sqrt(other / count) / mm);
      exchanged.base.col(i).swap(exchanged.base.col(j));
    }
}

/// The point that all others agree to be wrong, -1 if there is none. With a stated sd [m] > 0 that is what it is held
/// against, else the residuals of the others.
inline Eigen::Index worst_outlier(const Pairs& pairs, double sd) {
  if (pairs.count() < 5) return -1;
  const double all = squares(pairs), degrees = double(3 * (pairs.count() - 1) - 6);
  // One of several points is found by looking at all: a higher score, about that of Bonferroni's rule.
  const double needed = surprising + 0.15 * std::log(double(pairs.count()));
  Eigen::Index worst = -1;
  double fewest = all;
  for (Eigen::Index i = 0; i < pairs.count(); ++i) {
    const double others = squares(pairs.without(i));
    if (others < fewest) {
      fewest = others;
      worst = i;
    }
  }
  const double saved = all - fewest;
  if (sd > 0) return chi_square_score(saved / (sd * sd), 3) > needed ? worst : -1;
  const double floor = 1e-20 * pairs.base.squaredNorm();
  return variance_ratio_score(saved / 3 / std::max(fewest / degrees, floor), 3, degrees) > needed ? worst : -1;
}

/// Residual of one point, T_ref base - tracker, in units of its sd. Parameters: the start turns by the quaternion that is
/// (1, w / 2) normalised, and moves by p.
struct PointResidual {
  static constexpr int size = 3, parameters = 6;
  Vec3 turned, tracker;  ///< by the start's rotation, and measured [m]
  double sd;             ///< [m]

  template <class T>
  void operator()(const T* w, T* residual) const {
    using V = Eigen::Matrix<T, 3, 1>;
    const V p = Eigen::Map<const V>(w + 3);
    Eigen::Map<V>{residual} = (rotation(w) * turned.cast<T>() + p - tracker.cast<T>()) / T(sd);
  }
  template <class T>
  static Eigen::Quaternion<T> rotation(const T* w) {
    return Eigen::Quaternion<T>(T(1), 0.5 * w[0], 0.5 * w[1], 0.5 * w[2]).normalized();
  }
};

/// Least squares on SE(3) from `start`.
inline Pose refined(const Pairs& pairs, const Eigen::VectorXd& sd, double loss_scale, const Pose& start) {
  Vec6 x;
  x << Vec3::Zero(), start.position;
  SmallProblem<PointResidual, PointResidual::parameters> problem(x, {0, 1, 2, 3, 4, 5});
  for (Eigen::Index i = 0; i < pairs.count(); ++i)
    problem.add({start.rotation * pairs.base.col(i), pairs.tracker.col(i), sd[i]}, loss_scale / sd[i]);
  problem.minimise(sd.minCoeff(), 1e-14);
  x = problem.parameters();
  return {PointResidual::rotation(x.data()).toRotationMatrix() * start.rotation, x.tail<3>()};
}

}  // namespace registration

/// Registers the base frame to the tracker: closed form, then least squares on SE(3). Points that the others contradict
/// are left out, as long as four remain.
/// @throws std::invalid_argument for fewer than 3 points with readings, points on a line, a mirror image, two exchanged
///         names, other units, and numbers that are not finite. Real time: no.
/// Ref: Boyer et al., Section V.
[[nodiscard]] inline Registration register_points(std::span<const Fiducial> points,
                                                  const RegistrationOptions& options = {}) {
  using namespace registration;
  std::vector<int> read;
  Pairs pairs = check(points, read);
  check_correspondence(pairs, points, read);

  Registration result{};
  using enum RegistrationNotice;

  // Scatter of repeated readings.
  double scatter = 0, repeats = 0;
  for (const int i : read) {
    const auto& readings = points[std::size_t(i)].readings;
    const Vec3 mean = mean_reading(points[std::size_t(i)]);
    for (const Vec3& reading : readings) scatter += (reading - mean).squaredNorm();
    repeats += 3 * double(readings.size() - 1);
  }
  result.repeatability_sd = repeats > 0 ? std::sqrt(scatter / repeats) : std::numeric_limits<double>::quiet_NaN();
  const double jitter = options.noise.position_jitter > 0 ? options.noise.position_jitter
                        : repeats > 0                     ? result.repeatability_sd
                                                          : 0;

  // Outliers, the worst one first.
  const double stated =
      options.placement_sd > 0 ? std::hypot(options.placement_sd, jitter, options.noise.position_field) : 0;
  for (Eigen::Index worst; (worst = worst_outlier(pairs, stated)) >= 0;) {
    result.outliers.push_back(points[std::size_t(read[std::size_t(worst)])].name);
    pairs = pairs.without(worst);
    read.erase(read.begin() + worst);
  }

  // Points with a stated placement weigh by what their readings add to it; else all weigh the same.
  const Eigen::Index n = pairs.count();
  Eigen::VectorXd sd = Eigen::VectorXd::Constant(n, mm);
  for (Eigen::Index i = 0; i < n && options.placement_sd > 0; ++i)
    sd[i] = std::hypot(options.placement_sd,
                       jitter / std::sqrt(double(points[std::size_t(read[std::size_t(i)])].readings.size())));
  const Pose T = refined(pairs, sd, options.loss_scale, closed_form(pairs));
  result.T_tracker_base = T;

  // Whitened Jacobian by displacement and rotation, and the weights that the loss left.
  Eigen::MatrixXd J(3 * n, 6);
  Eigen::VectorXd weight(n);
  const Eigen::Matrix3Xd error = errors(T, pairs);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double far = options.loss_scale > 0 ? error.col(i).norm() / options.loss_scale : 0;
    weight[i] = 1 / (std::sqrt(1 + far * far) * sd[i]);
    const Vec3 arm = T.rotation * pairs.base.col(i);
    auto rows = J.middleRows<3>(3 * i);
    rows.leftCols<3>() = weight[i] * Mat3::Identity();
    for (int j = 0; j < 3; ++j) rows.col(3 + j) = weight[i] * Vec3::Unit(j).cross(arm);
  }
  const Eigen::MatrixXd G = gain(J);
  require(G.size() > 0, "the points do not determine the frame: they lie on one line");
  const Eigen::MatrixXd field = weight.asDiagonal() * field_factor(pairs.tracker.transpose(), options.noise);
  const double sum = (error * weight.asDiagonal()).squaredNorm();
  result.degrees_of_freedom = int(3 * n - 6);
  const double left = (sum - expected_field_squares(J, G, field)) / result.degrees_of_freedom;
  // A stated jitter bounds the variance from below; with the placement all of a point's error is stated.
  double readings_inverse = 0;
  for (const int i : read) readings_inverse += 1 / double(points[std::size_t(i)].readings.size());
  const double least = options.placement_sd > 0 ? 1 : jitter * jitter / (mm * mm) * readings_inverse / double(n);
  const double variance = std::max(least, left);
  result.covariance = propagated(G, variance, field);
  result.fre = std::sqrt(error.squaredNorm() / double(n));
  result.fle = std::sqrt(variance) * std::sqrt(sd.cwiseAbs2().mean());

  const Vec3 nan = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
  std::size_t unread = 0;
  for (const Fiducial& point : points) {
    result.residuals.push_back(
        point.readings.empty() ? nan : Vec3(mean_reading(point) - T.rotation * point.position - T.position));
    unread += point.readings.empty();
  }
  if (!result.outliers.empty()) {
    std::string names;
    for (const std::string& name : result.outliers) names += (names.empty() ? "'" : "', '") + name;
    result.notices.add(outliers, double(result.outliers.size()), 0, "left out, as the other points contradict: %s'",
                       names.c_str());
  }
  if (n == 3) result.notices.add(few_points, 3, 4, "three points are registered whatever they are: read at least four");
  if (unread > 0) result.notices.add(without_reading, double(unread), 0, "%zu points have no reading", unread);
  const double size = extents(pairs.base).norm();
  const double limit = std::max(0.02 * size, stated > 0 ? 2 * std::sqrt(3.0) * stated : 0);
  if (result.fre > limit)
    result.notices.add(large_residuals, result.fre, limit,
                       "points lie %.2f mm from where they should: exchanged names, a wrong unit, or the robot moved",
                       result.fre / mm);
  const double scale = extents(pairs.tracker).norm() / size;
  const double scale_sd = result.fle / (size * std::sqrt(double(n)));
  if (std::abs(scale - 1) > std::max(0.01, surprising * scale_sd))
    result.notices.add(wrong_scale, scale, 0.01, "the tracker sees the points %.1f %% farther apart than the CAD says",
                       100 * (scale - 1));
  return result;
}

}  // namespace ctcr
