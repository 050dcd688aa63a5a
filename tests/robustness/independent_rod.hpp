#pragma once
// The model once more, as a judge of solve(): classical Runge-Kutta on the equations of the concentric tubes in the base
// frame, derivatives by differences. It shares no code with the library but the description of the robot.
// Ref: Rucker, Jones & Webster 2010, "A geometrically exact model for externally loaded concentric-tube continuum robots".
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "ctcr/robot/joints.hpp"
#include "ctcr/robot/robot.hpp"
#include "ctcr/robot/tip_load.hpp"
#include "robustness/independent_material.hpp"

namespace ctcr::test {

template <int N>
class IndependentRod {
public:
  static constexpr int unknowns = N + 2;
  using Vector = Eigen::Matrix<double, unknowns, 1>;
  using Matrix = Eigen::MatrixXd;  ///< (unknowns, unknowns); of any size: decompositions compile once for all
  using Materials = std::array<IndependentMaterial, N>;

  /// R_base_tip and angle of each tube at its tip, against tube 1 at the robot tip [rad].
  struct Tip {
    Mat3 rotation;
    VecN<N> psi;
  };

  /// One cross-section. Frame: without twist about its z axis, the tangent, and that of tube 1 at the robot tip. Moment and
  /// force are what the part beyond exerts, base frame.
  struct State {
    Vec3 position = Vec3::Zero();
    Mat3 frame = Mat3::Identity();
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    VecN<N> psi = VecN<N>::Zero(), twist = VecN<N>::Zero();  ///< angle in the frame [rad], twist rate [rad/m]

    State plus(const State& rate, double h) const {
      State y = *this;
      y.position += h * rate.position;
      y.frame += h * rate.frame;
      y.force += h * rate.force;
      y.moment += h * rate.moment;
      y.psi += h * rate.psi;
      y.twist += h * rate.twist;
      return y;
    }
  };

  struct Place {
    double s;  ///< [m], from the front plate
    State state;
  };

  IndependentRod(const Robot<N>& robot, const Joints<N>& q, const TipLoad& load, const Materials& materials = {})
    : robot_(robot), q_(q), load_(load), materials_(materials) {}

  /// Cross-sections from the tip to the plate.
  [[nodiscard]] std::vector<Place> integrate(const Tip& tip) const {
    std::vector<Place> places;
    State y;
    y.frame = tip.rotation;
    y.psi = tip.psi;
    y.force = load_.force;
    y.moment = load_.moment;
    y.twist[0] = tip.rotation.col(2).dot(load_.moment) / robot_.tubes[0].GJ();
    const std::vector<double> ends = breakpoints();
    for (std::size_t k = 0; k + 1 < ends.size(); ++k) {
      const double length = ends[k] - ends[k + 1], middle = 0.5 * (ends[k] + ends[k + 1]);
      const int steps = steps_for(length, middle);
      for (int i = 0; i < steps; ++i) {
        places.push_back({ends[k] - length * i / steps, y});
        y = runge_kutta(y, places.back().s, middle, -length / steps);
      }
    }
    places.push_back({0, y});
    return places;
  }

  /// Tip in the base frame [m], and by how much the tubes miss their grasps [rad]: turn of tube 1's base, base axes, and
  /// the angles of the others against it.
  struct Miss {
    Vec3 tip;
    Vector angles;
  };
  [[nodiscard]] Miss miss(const Tip& tip) const {
    const State plate = integrate(tip).back().state;
    Miss m{-plate.position, {}};
    const VecN<N> angle = angles(plate, q_.beta.minCoeff());
    const Eigen::AngleAxisd turn(orthonormal(plate.frame) * about_z(angle[0] - q_.alpha[0]));
    m.angles.template head<3>() = turn.angle() * turn.axis();
    for (int i = 1; i < N; ++i) m.angles[2 + i] = angle[i] - angle[0] - q_.alpha[i] + q_.alpha[0];
    return m;
  }

  /// Newton's method with a Jacobian by differences.
  /// @return largest miss that is left [rad]
  double solve(Tip& tip, Miss& found, int iterations = 6) const {
    for (int k = 0;; ++k) {
      found = miss(tip);
      if (found.angles.norm() < 1e-9 || k == iterations || !found.angles.allFinite()) return found.angles.norm();
      Matrix J(unknowns, unknowns);
      for (int j = 0; j < unknowns; ++j)
        J.col(j) =
            (miss(moved(tip, j, difference)).angles - miss(moved(tip, j, -difference)).angles) / (2 * difference);
      const Vector step = -J.fullPivLu().solve(found.angles);
      for (int j = 0; j < unknowns; ++j) tip = moved(tip, j, step[j]);
    }
  }

  /// The smallest determinant of the shooting Jacobian with the base anywhere from the tip (there it is 1) to the grasps.
  /// Where it is negative the equilibrium is unstable. Ref: Ha, Park & Dupont 2016, "Elastic stability of concentric tube
  /// robots subject to external loads".
  [[nodiscard]] double smallest_determinant(const Tip& tip) const {
    std::vector<std::vector<Place>> up, down;
    for (int j = 0; j < unknowns; ++j) {
      up.push_back(integrate(moved(tip, j, difference)));
      down.push_back(integrate(moved(tip, j, -difference)));
    }
    double smallest = 1;
    const auto base_at = [&](std::size_t place, double s) {
      Matrix B(unknowns, unknowns);
      for (std::size_t j = 0; j < unknowns; ++j) {
        const State &a = up[j][place].state, &b = down[j][place].state;
        const VecN<N> angle = (angles(a, s) - angles(b, s)) / (2 * difference);
        // For a small turn w the matrix R_a R_b^T is 1 + [w]x.
        const Mat3 turn = a.frame * b.frame.transpose();
        const Vec3 w =
            Vec3(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1)) / (4 * difference);
        B.col(Eigen::Index(j)).head<3>() = w + angle[0] * 0.5 * (a.frame + b.frame).col(2);
        for (int i = 1; i < N; ++i) B(2 + i, Eigen::Index(j)) = angle[i] - angle[0];
      }
      smallest = std::min(smallest, B.determinant());
    };
    const std::size_t last = up[0].size() - 1;
    for (std::size_t k = 0; k <= last; ++k) base_at(k, up[0][k].s);
    constexpr int samples = 10;
    for (int k = 1; k <= samples; ++k) base_at(last, q_.beta.minCoeff() * k / samples);
    return smallest;
  }

private:
  static constexpr double difference = 1e-6;

  static Mat3 about_z(double angle) { return Eigen::AngleAxisd(angle, Vec3::UnitZ()).toRotationMatrix(); }
  static Mat3 orthonormal(const Mat3& R) { return Eigen::Quaterniond(R).normalized().toRotationMatrix(); }

  static Tip moved(const Tip& tip, int unknown, double by) {
    Tip t = tip;
    if (unknown < 3)
      t.rotation = Eigen::AngleAxisd(by, Vec3::Unit(unknown)).toRotationMatrix() * tip.rotation;
    else
      t.psi[unknown - 2] += by;
    return t;
  }

  /// Angles of the tubes with the base at s: behind the plate they only twist, each up to where it is grasped.
  VecN<N> angles(const State& y, double s) const {
    if (s >= 0) return y.psi;
    return y.psi + q_.beta.cwiseMax(s).cwiseProduct(y.twist);
  }

  [[nodiscard]] double end(std::size_t tube) const { return robot_.tubes[tube].length + q_.beta[Eigen::Index(tube)]; }

  /// Where tubes end or begin to curve, the tip first and the plate last [m].
  [[nodiscard]] std::vector<double> breakpoints() const {
    std::vector<double> all{0.0};
    for (std::size_t i = 0; i < N; ++i)
      for (const double s : {end(i), end(i) - robot_.tubes[i].curved_length})
        if (s > 0) all.push_back(s);
    std::sort(all.begin(), all.end(), std::greater<>());
    // Two that differ by rounding are one: no tube lies between.
    const auto same = [](double a, double b) { return a - b < 1e-12; };
    all.erase(std::unique(all.begin(), all.end(), same), all.end());
    return all;
  }

  /// Steps whose error is far below what is judged: thirty over the length in which the state of the rod changes.
  [[nodiscard]] int steps_for(double length, double s) const {
    double stiffness = 0, bending = 0, force = load_.force.norm(), twist = load_.moment.norm() / robot_.tubes[0].GJ();
    for (std::size_t i = 0; i < N; ++i) {
      force += robot_.gravity.norm() * robot_.tubes[i].mass_per_length() * std::max(0.0, end(i));
      if (s > end(i)) continue;
      const double least = robot_.tubes[i].EI() * materials_[i].least_stiffness();
      stiffness += least;
      bending += least * materials_[i].most_curvature(robot_.tubes[i], is_curved(i, s));
      twist += std::abs(materials_[i].twist);
    }
    const double u = (bending + load_.moment.norm()) / stiffness;
    return int(std::min(4 + 30 * length * (std::sqrt(force / stiffness) + u + twist), 2000.0));
  }

  /// @param inside  any place inside the segment of s, which says the tubes
  [[nodiscard]] State rate(const State& y, double s, double inside) const {
    State d;
    const Vec3 tangent = y.frame.col(2);
    const Eigen::Vector2d moment = (y.frame.transpose() * y.moment).template head<2>();
    std::array<Eigen::Vector2d, N> free;
    std::size_t present = 0;
    for (; present < N && inside < end(present); ++present) {
      d.force -= robot_.tubes[present].mass_per_length() * robot_.gravity;
      free[present] = turned(y.psi[Eigen::Index(present)]) *
                      materials_[present].free_curvature(robot_.tubes[present], s - q_.beta[Eigen::Index(present)],
                                                         is_curved(present, inside));
    }
    // The curvature that all share, by stiffnesses at the last one until it no longer changes.
    std::array<Eigen::Matrix2d, N> stiffness;
    Eigen::Vector2d u = Eigen::Vector2d::Zero(), last;
    int iterations = 0;
    do {
      last = u;
      Eigen::Matrix2d together = Eigen::Matrix2d::Zero();
      Eigen::Vector2d sum = moment;
      for (std::size_t i = 0; i < present; ++i) {
        const Eigen::Matrix2d R = turned(y.psi[Eigen::Index(i)]);
        stiffness[i] =
            robot_.tubes[i].EI() * R * materials_[i].stiffness(R.transpose() * (u - free[i])) * R.transpose();
        together += stiffness[i];
        sum += stiffness[i] * free[i];
      }
      u = together.inverse() * sum;
    } while ((u - last).norm() > 1e-12 * (1 + u.norm()) && ++iterations < 200);
    Mat3 turning = Mat3::Zero();
    turning(0, 2) = u[1], turning(1, 2) = -u[0], turning(2, 0) = -u[1], turning(2, 1) = u[0];
    d.position = tangent;
    d.frame = y.frame * turning;
    d.moment = -tangent.cross(y.force);
    for (std::size_t i = 0; i < present; ++i) {
      const Eigen::Vector2d own = stiffness[i] * (u - free[i]);
      d.psi[Eigen::Index(i)] = y.twist[Eigen::Index(i)];
      d.twist[Eigen::Index(i)] = (u[1] * own[0] - u[0] * own[1]) / robot_.tubes[i].GJ();
    }
    return d;
  }

  [[nodiscard]] bool is_curved(std::size_t i, double s) const { return s > end(i) - robot_.tubes[i].curved_length; }
  static Eigen::Matrix2d turned(double angle) { return Eigen::Rotation2Dd(angle).toRotationMatrix(); }

  /// One step from s inside a segment, of which `middle` says the tubes.
  [[nodiscard]] State runge_kutta(const State& y, double s, double middle, double h) const {
    const State k1 = rate(y, s, middle), k2 = rate(y.plus(k1, h / 2), s + h / 2, middle),
                k3 = rate(y.plus(k2, h / 2), s + h / 2, middle), k4 = rate(y.plus(k3, h), s + h, middle);
    State next = y.plus(k1, h / 6).plus(k2, h / 3).plus(k3, h / 3).plus(k4, h / 6);
    next.frame = orthonormal(next.frame);
    return next;
  }

  const Robot<N>& robot_;
  const Joints<N>& q_;
  const TipLoad& load_;
  const Materials materials_;
};

}  // namespace ctcr::test
