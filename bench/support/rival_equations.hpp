#pragma once
// Right-hand side of the rival's Eq. (1), in two writings of the same equations (Rucker, Jones, Webster 2010; sums of
// moments as state: Boyer et al., Section III-B-1). u: curvature of tube 1, whose frame carries everything; theta_i:
// angle of tube i relative to tube 1.
//   MatrixForm  as the literature prints them, 3x3 matrices and all: this is "the rival"
//   ScalarForm  the same by hand: products multiplied out, straight tubes left out. About 2.5 times faster; shows how
//               much of our lead is owed to the method and not to the writing
#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "ctcr/robot/robot.hpp"

namespace rival {

using ctcr::Mat3;
using ctcr::Vec3;
using ctcr::VecN;

template <int N>
struct Segment {
  double length = 0;  // [m]
  int present = 0;    // tubes 1 .. present
  std::array<bool, N> curved{};
};

/// State [r, R by columns, theta_1..N, u_1z..u_Nz, m_x, m_y]; the last two only when loaded. theta_1 = 0.
template <int N, bool Loaded>
struct Layout {
  static constexpr int rotation = 3, theta = 12, torsion = theta + N, moment = torsion + N;
  static constexpr int size = moment + (Loaded ? 2 : 0);
  using State = VecN<size>;
};

template <int N, bool Loaded>
class MatrixForm {
public:
  using At = Layout<N, Loaded>;
  using State = typename At::State;

  explicit MatrixForm(const ctcr::Robot<N>& robot) noexcept {
    for (std::size_t i = 0; i < N; ++i) {
      const ctcr::Tube& tube = robot.tubes[i];
      stiffness_[i] = Vec3(tube.EI(), tube.EI(), tube.GJ());
      curvature_[i] = tube.curvature;
    }
  }

  State derivative(const Segment<N>& segment, const Vec3& force, const State& y) const noexcept {
    const Mat3 R = Eigen::Map<const Mat3>(y.data() + At::rotation);
    const auto theta = y.template segment<N>(At::theta);
    const auto u_z = y.template segment<N>(At::torsion);
    const Vec3 e3 = Vec3::UnitZ();

    std::array<Mat3, N> R_theta;
    std::array<Vec3, N> precurvature;
    Vec3 total_stiffness = Vec3::Zero(), moment = Vec3::Zero(), precurvature_moment = Vec3::Zero();
    for (std::size_t i = 0; i < std::size_t(segment.present); ++i) {
      const double c = std::cos(theta[Eigen::Index(i)]), s = std::sin(theta[Eigen::Index(i)]);
      R_theta[i] << c, -s, 0, s, c, 0, 0, 0, 1;
      precurvature[i] = Vec3(segment.curved[i] ? curvature_[i] : 0.0, 0, 0);
      const Mat3 K = stiffness_[i].asDiagonal();
      total_stiffness += stiffness_[i];
      precurvature_moment += R_theta[i] * K * precurvature[i];
      moment.z() += stiffness_[i].z() * u_z[Eigen::Index(i)];
    }
    if constexpr (Loaded) moment.template head<2>() = y.template segment<2>(At::moment);
    Vec3 u = (moment + precurvature_moment).cwiseQuotient(total_stiffness);
    u.z() = u_z[0];

    State dy = State::Zero();
    dy.template head<3>() = R * e3;
    Eigen::Map<Mat3>(dy.data() + At::rotation) = R * hat(u);
    for (std::size_t i = 0; i < std::size_t(segment.present); ++i) {
      const double dtheta = u_z[Eigen::Index(i)] - u_z[0];
      const Vec3 u_i = R_theta[i].transpose() * u + dtheta * e3;
      dy[At::theta + int(i)] = dtheta;
      dy[At::torsion + int(i)] =
          stiffness_[i].x() / stiffness_[i].z() * (u_i.x() * precurvature[i].y() - u_i.y() * precurvature[i].x());
    }
    if constexpr (Loaded) {
      const Vec3 dm = -hat(u) * moment - hat(e3) * R.transpose() * force;
      dy.template segment<2>(At::moment) = dm.template head<2>();
    }
    return dy;
  }

private:
  static Mat3 hat(const Vec3& v) noexcept {
    return (Mat3() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished();
  }

  std::array<Vec3, N> stiffness_;
  std::array<double, N> curvature_;
};

template <int N, bool Loaded>
class ScalarForm {
public:
  using At = Layout<N, Loaded>;
  using State = typename At::State;

  explicit ScalarForm(const ctcr::Robot<N>& robot) noexcept {
    double stiffness = 0;
    for (int i = 0; i < N; ++i) {
      const ctcr::Tube& tube = robot.tubes[std::size_t(i)];
      flexibility_[i] = 1.0 / (stiffness += tube.EI());
      torsional_[i] = tube.GJ();
      precurvature_moment_[i] = tube.EI() * tube.curvature;
      coupling_[i] = precurvature_moment_[i] / torsional_[i];
    }
  }

  State derivative(const Segment<N>& segment, const Vec3& force, const State& y) const noexcept {
    const Eigen::Map<const Mat3> R(y.data() + At::rotation);
    double m_x = 0, m_y = 0, m_z = 0;
    if constexpr (Loaded) {
      m_x = y[At::moment];
      m_y = y[At::moment + 1];
    }
    VecN<N> s, c;
    double sum_x = m_x, sum_y = m_y;
    for (int i = 0; i < segment.present; ++i) {
      m_z += torsional_[i] * y[At::torsion + i];
      if (!segment.curved[std::size_t(i)]) continue;
      s[i] = std::sin(y[At::theta + i]);
      c[i] = std::cos(y[At::theta + i]);
      sum_x += precurvature_moment_[i] * c[i];
      sum_y += precurvature_moment_[i] * s[i];
    }
    const double flexibility = flexibility_[segment.present - 1];
    const Vec3 u(sum_x * flexibility, sum_y * flexibility, y[At::torsion]);

    State dy = State::Zero();
    dy.template head<3>() = R.col(2);
    Eigen::Map<Mat3> dR(dy.data() + At::rotation);
    dR.col(0) = u.z() * R.col(1) - u.y() * R.col(2);
    dR.col(1) = u.x() * R.col(2) - u.z() * R.col(0);
    dR.col(2) = u.y() * R.col(0) - u.x() * R.col(1);
    for (int i = 0; i < segment.present; ++i) {
      dy[At::theta + i] = y[At::torsion + i] - u.z();
      if (segment.curved[std::size_t(i)]) dy[At::torsion + i] = coupling_[i] * (s[i] * u.x() - c[i] * u.y());
    }
    if constexpr (Loaded) {
      dy[At::moment] = u.z() * m_y - u.y() * m_z + force.dot(R.col(1));
      dy[At::moment + 1] = u.x() * m_z - u.z() * m_x - force.dot(R.col(0));
    }
    return dy;
  }

private:
  VecN<N> flexibility_, torsional_, precurvature_moment_, coupling_;
};

}  // namespace rival
