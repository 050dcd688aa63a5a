#pragma once
// The rival: the model as the paper computes it, written plainly with fixed-size Eigen. Standard formulation in the
// frame of tube 1 (Rucker, Jones, Webster 2010) with the sums of moments m_x, m_y as state (Section III-B-1), forward
// shooting, one classical RK4 step per segment, finite differences of whole initial value problems (IVP) for B_u, J, C
// (Table I: 4 / 10 / 6 / 12 / 18 of them), Gauss-Newton (Eq. 3). Ref: Boyer et al., Section III.
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "ctcr/robot/joints.hpp"
#include "ctcr/robot/tip_load.hpp"
#include "rival_equations.hpp"

namespace rival {

using ctcr::Joints;
using ctcr::Mat6;
using ctcr::Robot;
using ctcr::TipLoad;

enum class Outputs { pose, jacobian, compliance };

/// Runs the indices of a loop one after another; a thread pool's parallel_for has the same form.
struct Serial {
  template <class F>
  void operator()(int n, F&& f) const noexcept {
    for (int index = 0; index < n; ++index) f(index);
  }
};

/// One Gauss-Newton step at a time. Loaded: tip force and moment; otherwise m_x, m_y leave the state and the unknowns.
template <int N, bool Loaded, template <int, bool> class Equations_ = MatrixForm>
class Rival {
  using Equations = Equations_<N, Loaded>;

public:
  static constexpr int n_unknowns = Loaded ? N + 2 : N;  // u_1z(0) .. u_Nz(0), and m_x(0), m_y(0)
  static constexpr int max_ivps = 1 + n_unknowns + 2 * N + (Loaded ? 6 : 0);
  using Unknowns = VecN<n_unknowns>;

  struct Solution {
    double residual = 0;  ///< ||b|| before the step
    Vec3 position = Vec3::Zero();
    Mat3 rotation = Mat3::Identity();
    Eigen::Matrix<double, 6, 2 * N> jacobian = Eigen::Matrix<double, 6, 2 * N>::Zero();
    Mat6 compliance = Mat6::Zero();
  };

  explicit Rival(const Robot<N>& robot) noexcept : equations_(robot) {
    for (int i = 0; i < N; ++i) {
      const ctcr::Tube& tube = robot.tubes[std::size_t(i)];
      length_[i] = tube.length;
      curved_length_[i] = tube.curved_length;
      torsional_[i] = tube.GJ();
    }
  }

  /// Number of IVPs of one step.
  static constexpr int ivps(Outputs outputs) noexcept {
    return 1 + n_unknowns + (outputs == Outputs::pose ? 0 : 2 * N) + (Loaded && outputs == Outputs::compliance ? 6 : 0);
  }

  /// Evaluates IVP, residual, B_u and the asked derivatives at `unknowns`, then moves `unknowns` by one step.
  template <Outputs outputs, class Loop = Serial>
  void step(const Joints<N>& joints, const TipLoad& load, Unknowns& unknowns, Solution& solution,
            const Loop& loop = {}) const noexcept {
    std::array<End, std::size_t(max_ivps)> ends;
    const Segments nominal = segments(joints);
    loop(ivps(outputs),
         [&](int column) noexcept { ends[std::size_t(column)] = perturbed(column, nominal, joints, load, unknowns); });

    using Columns = Eigen::Matrix<double, n_unknowns + 6, ivps(outputs) - 1>;  // [dB; dE]
    Columns d;
    const End& end = ends[0];
    for (int column = 1; column < ivps(outputs); ++column) {
      const End& other = ends[std::size_t(column)];
      const double scale = 1.0 / increment(column);
      const Mat3 turn = (other.rotation - end.rotation) * end.rotation.transpose();
      d.col(column - 1) << scale * (other.residual - end.residual), scale * (other.position - end.position),
          0.5 * scale * Vec3(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1));
    }
    using Square = Eigen::Matrix<double, n_unknowns, n_unknowns>;
    const Square B_u = d.template topLeftCorner<n_unknowns, n_unknowns>();
    const Square inverse = B_u.inverse();  // the pseudo-inverse of Eq. (3): B_u is square and regular
    if constexpr (outputs != Outputs::pose) {
      const Eigen::Matrix<double, 6, n_unknowns> gain = d.template bottomLeftCorner<6, n_unknowns>() * inverse;
      solution.jacobian = d.template block<6, 2 * N>(n_unknowns, n_unknowns) -
                          gain * d.template block<n_unknowns, 2 * N>(0, n_unknowns);
      if constexpr (Loaded && outputs == Outputs::compliance)
        solution.compliance = d.template bottomRightCorner<6, 6>() - gain * d.template topRightCorner<n_unknowns, 6>();
    }
    solution.residual = end.residual.norm();
    solution.position = end.position;
    solution.rotation = end.rotation;
    unknowns -= inverse * end.residual;
  }

  /// Gauss-Newton from `unknowns`, as the paper runs it: no safeguards.
  /// @return true when ||b|| < 1e-10 within 30 steps
  bool solve(const Joints<N>& joints, const TipLoad& load, Unknowns& unknowns, Solution& solution) const noexcept {
    for (int iteration = 0; iteration < 30; ++iteration) {
      step<Outputs::pose>(joints, load, unknowns, solution);
      if (solution.residual < 1e-10) return true;
    }
    return false;
  }

private:
  using At = Layout<N, Loaded>;
  using State = typename At::State;

  struct Segments {
    std::array<Segment<N>, 2 * N> list;
    int count = 0;
  };
  struct End {  // what an IVP yields at the tip
    Unknowns residual;
    Vec3 position;
    Mat3 rotation;
  };

  // Forward-difference increments: u_z [1/m], m [N m], beta [m], alpha [rad], f [N], l [N m].
  static constexpr double increment(int column) noexcept {
    if (column <= N) return 1e-5;
    if (column <= n_unknowns) return 1e-8;
    if (column <= n_unknowns + 2 * N) return 1e-7;
    return column <= n_unknowns + 2 * N + 3 ? 1e-6 : 1e-8;
  }

  // Column 0 is the nominal IVP; only the beta columns move the segments.
  End perturbed(int column, const Segments& nominal, Joints<N> joints, TipLoad load, Unknowns unknowns) const noexcept {
    const double step = increment(column);
    int k = column - 1;
    if (k < 0) return ivp(nominal, joints, load, unknowns);
    if (k < n_unknowns) {
      unknowns[k] += step;
      return ivp(nominal, joints, load, unknowns);
    }
    if ((k -= n_unknowns) < N) {
      joints.beta[k] += step;
      return ivp(segments(joints), joints, load, unknowns);
    }
    if ((k -= N) < N) {
      joints.alpha[k] += step;
    } else if ((k -= N) < 3) {
      load.force[k] += step;
    } else {
      load.moment[k - 3] += step;
    }
    return ivp(nominal, joints, load, unknowns);
  }

  Segments segments(const Joints<N>& joints) const noexcept {
    const VecN<N> tips = length_ + joints.beta;
    const VecN<N> bends = tips - curved_length_;
    std::array<double, 2 * N + 1> points;
    for (int i = 0; i < N; ++i) {
      points[std::size_t(2 * i)] = tips[i];
      points[std::size_t(2 * i + 1)] = std::max(bends[i], 0.0);
    }
    points[2 * N] = 0.0;
    std::sort(points.begin(), points.end());
    Segments result;
    for (std::size_t j = 0; j + 1 < points.size(); ++j) {
      const double middle = 0.5 * (points[j] + points[j + 1]);
      if (points[j + 1] <= points[j]) continue;
      Segment<N>& segment = result.list[std::size_t(result.count++)];
      segment.length = points[j + 1] - points[j];
      for (int i = 0; i < N && middle < tips[i]; ++i) {
        segment.present = i + 1;
        segment.curved[std::size_t(i)] = middle > bends[i];
      }
    }
    return result;
  }

  End ivp(const Segments& segments, const Joints<N>& joints, const TipLoad& load,
          const Unknowns& unknowns) const noexcept {
    State y;
    const VecN<N> angles = joints.alpha - joints.beta.cwiseProduct(unknowns.template head<N>());
    y.template head<3>().setZero();
    Eigen::Map<Mat3>(y.data() + At::rotation) = Eigen::AngleAxisd(angles[0], Vec3::UnitZ()).toRotationMatrix();
    y.template segment<N>(At::theta) = angles.array() - angles[0];
    y.template tail<State::RowsAtCompileTime - At::torsion>() = unknowns;
    for (int j = 0; j < segments.count; ++j) rk4(segments.list[std::size_t(j)], load.force, y);

    End end;
    end.position = y.template head<3>();
    end.rotation = Eigen::Map<const Mat3>(y.data() + At::rotation);
    end.residual = y.template tail<n_unknowns>();
    if constexpr (Loaded) {
      const Vec3 moment_tip = end.rotation.transpose() * load.moment;
      end.residual[0] -= moment_tip.z() / torsional_[0];
      end.residual.template tail<2>() -= moment_tip.template head<2>();
    }
    return end;
  }

  void rk4(const Segment<N>& segment, const Vec3& force, State& y) const noexcept {
    const double h = segment.length;
    const State k1 = equations_.derivative(segment, force, y);
    const State k2 = equations_.derivative(segment, force, y + 0.5 * h * k1);
    const State k3 = equations_.derivative(segment, force, y + 0.5 * h * k2);
    const State k4 = equations_.derivative(segment, force, y + h * k3);
    y += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  }

  Equations equations_;
  VecN<N> length_, curved_length_, torsional_;
};

}  // namespace rival
