#include "ctcr/math/se3.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>
#include <unsupported/Eigen/MatrixFunctions>

#include "support/cases.hpp"

namespace ctcr {
namespace se3_test {

using Mat4 = Eigen::Matrix4d;

struct Uniform {
  std::mt19937_64 random;
  double operator()(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
  Vec3 vector(double size) { return Vec3(operator()(-1, 1), operator()(-1, 1), operator()(-1, 1)).normalized() * size; }
};

Mat4 twist_matrix(const Vec3& o, const Vec3& v) {
  Mat4 W = Mat4::Zero();
  W.topRows<3>() << 0, -o.z(), o.y(), v.x(), o.z(), 0, -o.x(), v.y(), -o.y(), o.x(), 0, v.z();
  return W;
}

/// Reference: the matrix exponential by Pade approximation.
Mat4 reference(const Vec3& o, const Vec3& v) { return twist_matrix(o, v).exp(); }

template <class F>
Mat4 matrix(const F& frame) {
  Mat4 T = Mat4::Identity();
  T.topLeftCorner<3, 3>() = frame.rotation();
  T.topRightCorner<3, 1>() = frame.position();
  return T;
}

/// A frame moved twice, so that its rotation is general.
Frame<double> moved(const Vec3& o1, const Vec3& v1, const Vec3& o2, const Vec3& v2) {
  Frame<double> frame;
  move_by_exponential(frame, {o1[0], o1[1], o1[2]}, v1[0], v1[1], v1[2]);
  move_by_exponential(frame, {o2[0], o2[1], o2[2]}, v2[0], v2[1], v2[2]);
  return frame;
}

TEST(ExpCoefficients, SeriesMeetsTheClosedFormAtItsThreshold) {
  const ExpCoefficients series = exp_coefficients(1.0), closed = exp_coefficients(std::nextafter(1.0, 2.0));
  EXPECT_NEAR(series.B, closed.B, 1e-13);
  EXPECT_NEAR(series.C, closed.C, 1e-13);
  EXPECT_NEAR(series.dB, closed.dB, 1e-13);
  EXPECT_NEAR(series.dC, closed.dC, 1e-13);
}

TEST(ExpCoefficients, EqualTheirDefinition) {
  for (double t = 0.05; t < 10; t += 0.05) {
    const long double x = t, z = x * x;
    const ExpCoefficients q = exp_coefficients(t * t);
    const long double B = (1 - std::cos(x)) / z, C = (x - std::sin(x)) / (z * x);
    EXPECT_NEAR(q.B, double(B), 1e-13);
    EXPECT_NEAR(q.C, double(C), 1e-13);
    EXPECT_NEAR(q.dB, double((std::sin(x) / x - 2 * B) / (2 * z)), 1e-13);
    EXPECT_NEAR(q.dC, double((B - 3 * C) / (2 * z)), 1e-13);
  }
}

TEST(Exponential, EqualsTheMatrixExponential) {
  Uniform uniform{std::mt19937_64(1)};
  for (int n = 0; n < test::cases(500); ++n) {
    const double size = n % 5 == 0 ? 1.0 + uniform(-1e-6, 1e-6) : n % 5 == 1 ? uniform(0, 1e-7) : uniform(0, 4);
    const Vec3 o1 = uniform.vector(size), v1 = uniform.vector(1), o2 = uniform.vector(uniform(0, 4)),
               v2 = uniform.vector(1);
    EXPECT_LT((matrix(moved(o1, v1, o2, v2)) - reference(o1, v1) * reference(o2, v2)).cwiseAbs().maxCoeff(), 2e-13);
  }
}

TEST(Exponential, TangentEqualsDifferences) {
  Uniform uniform{std::mt19937_64(2)};
  for (int n = 0; n < test::cases(200); ++n) {
    // Twelve arguments, each with its own direction of differentiation.
    const double size = n % 4 == 0 ? 1.0 + uniform(-1e-3, 1e-3) : uniform(0, 3);
    Eigen::Matrix<double, 12, 1> x;
    x << uniform.vector(size), uniform.vector(1), uniform.vector(uniform(0, 3)), uniform.vector(1);
    const auto at = [](const auto& a) {
      return moved(a.template segment<3>(0), a.template segment<3>(3), a.template segment<3>(6),
                   a.template segment<3>(9));
    };
    Dual<3> d[12];
    for (int i = 0; i < 12; ++i) {
      d[i] = x[i];
      d[i].d[i / 4][std::size_t(i % 4)] = 1;
    }
    Frame<Dual<3>> frame{};
    move_by_exponential(frame, {d[0], d[1], d[2]}, d[3], d[4], d[5]);
    move_by_exponential(frame, {d[6], d[7], d[8]}, d[9], d[10], d[11]);
    const Mat4 inverse = matrix(at(x)).inverse();
    EXPECT_LT((matrix(frame) - matrix(at(x))).cwiseAbs().maxCoeff(), 1e-15);
    for (int i = 0; i < 12; ++i) {
      const double h = 1e-3;
      const auto moved_by = [&](double t) {
        Eigen::Matrix<double, 12, 1> y = x;
        y[i] += t;
        return matrix(at(y));
      };
      const Mat4 slope = (8 * (moved_by(h) - moved_by(-h)) - (moved_by(2 * h) - moved_by(-2 * h))) / (12 * h);
      Vec3 o, v;
      for (int k = 0; k < 3; ++k) {
        o[k] = frame.rotation_twist[k][i / 4][std::size_t(i % 4)];
        v[k] = frame.translation_twist[k][i / 4][std::size_t(i % 4)];
      }
      EXPECT_LT((inverse * slope - twist_matrix(o, v)).cwiseAbs().maxCoeff(), 1e-10) << "argument " << i;
    }
  }
}

TEST(RotationVector, IsTheInverseOfRotationMatrix) {
  Uniform uniform{std::mt19937_64(3)};
  const double pi = std::numbers::pi;
  for (const double angle : {0.0, 1e-12, 1e-7, 1e-6, 1e-3, 0.5, 1.0, 2.0, 3.0, pi - 1e-3, pi - 1e-5}) {
    for (int n = 0; n < test::cases(50); ++n) {
      const Vec3 o = uniform.vector(angle);
      const Mat3 R = rotation_matrix(o);
      EXPECT_TRUE((R.transpose() * R).isIdentity(3e-13));
      EXPECT_LT((R - reference(o, Vec3::Zero()).topLeftCorner<3, 3>()).cwiseAbs().maxCoeff(), 1e-13);
      EXPECT_LT((rotation_vector(R) - o).norm(), 1e-10) << "angle " << angle;
    }
  }
}

TEST(RotationVector, StillTurnsByNearlyHalfATurn) {
  Uniform uniform{std::mt19937_64(4)};
  for (const double off : {0.0, 1e-15, 1e-9, 1e-7, 9e-7, 1.1e-6, 1e-5}) {
    for (int n = 0; n < test::cases(50); ++n) {
      const Mat3 R = rotation_matrix(uniform.vector(std::numbers::pi - off));
      const Vec3 o = rotation_vector(R);
      EXPECT_NEAR(o.norm(), std::numbers::pi - off, 1e-6);
      EXPECT_LT((rotation_matrix(o) - R).cwiseAbs().maxCoeff(), 2e-6) << "half a turn less " << off;
    }
  }
}

TEST(RotationZ, TurnsXToY) {
  EXPECT_LT((rotation_z(0.3) * Vec3::UnitX() - Vec3(std::cos(0.3), std::sin(0.3), 0)).norm(), 1e-15);
  EXPECT_LT((rotation_z(0.3) - rotation_matrix(Vec3(0, 0, 0.3))).cwiseAbs().maxCoeff(), 1e-15);
}

}  // namespace se3_test
}  // namespace ctcr
