#pragma once
// Whether an equilibrium is stable.
//
// With its base at any arc length s, the robot is what lies beyond. B(s) is the Jacobian of that robot's shooting problem:
// the identity at the tip, B_u where the tubes are grasped. The equilibrium is stable if and only if B is regular all the
// way: where it is not there is a conjugate point. det B_u alone tells an odd number of them from none.
// Ref: Ha, Park & Dupont 2016, "Elastic stability of concentric tube robots subject to external loads"; Riojas,
// Hendrick & Webster 2018.
#include <algorithm>

#include "ctcr/mechanics/effect_evaluation.hpp"

namespace ctcr::detail {

/// Whether a polynomial, given in Bernstein form, is positive in all of [0, 1]. One that touches 0 is not.
template <std::size_t M>
inline bool is_positive(const std::array<double, M>& b, int halvings = 8) noexcept {
  if (std::ranges::all_of(b, [](double x) { return x > 0; })) return true;
  if (!(b.front() > 0 && b.back() > 0) || halvings == 0) return false;
  std::array<double, M> left, right = b;  // de Casteljau's algorithm
  for (std::size_t k = 0; k < M; ++k) {
    left[k] = right[0];
    for (std::size_t i = 0; i + 1 + k < M; ++i) right[i] = 0.5 * (right[i] + right[i + 1]);
  }
  return is_positive(left, halvings - 1) && is_positive(right, halvings - 1);
}

/// Whether (1 - t) I + t T is regular for all t in [0, 1]. Its determinant has the Bernstein coefficients
/// e_k(T) / binomial(n, k), where e_k is the elementary symmetric polynomial of T's eigenvalues (Faddeev-LeVerrier).
template <int n>
inline bool is_regular_to(const Eigen::Matrix<double, n, n>& T) noexcept {
  using Matrix = Eigen::Matrix<double, n, n>;
  const Matrix identity = Matrix::Identity();
  if ((T - identity).squaredNorm() < 1) return true;
  std::array<double, n + 1> bernstein{1};
  Matrix power = identity;  // T^k - e_1 T^(k-1) + ..., up to the sign
  double binomial = 1;
  for (int k = 1; k <= n; ++k) {
    const Matrix next = T * power;
    const double e = next.trace() / k;
    power = e * identity - next;
    binomial = binomial * (n - k + 1) / k;
    bernstein[std::size_t(k)] = e / binomial;
  }
  return is_positive(bernstein);
}

/// Follows B from the tip towards the base and looks for conjugate points, between the places as well: B is linear there,
/// behind the plate exactly.
template <int n>
class ConjugatePoints {
public:
  using Jacobian = Eigen::Matrix<double, n, n>;

  /// The base at the next place.
  void base_at(const Jacobian& B) noexcept {
    if (none_) none_ = is_regular_to<n>(in_terms_of_last(B));
    last_ = B;
  }
  [[nodiscard]] bool none() const noexcept { return none_; }

private:
  /// last^-1 B.
  [[nodiscard]] Jacobian in_terms_of_last(const Jacobian& B) const noexcept {
    LaneRow<lane_groups(2 * n)> row[n] = {};
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        row[i].add(j, last_(i, j));
        row[i].add(n + j, B(i, j));
      }
    constexpr auto lane = [](int j) constexpr { return j; };
    (void)eliminate<n>(row, lane);
    Jacobian T;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) T(i, j) = row[i][n + j];
    return T;
  }

  Jacobian last_ = Jacobian::Identity();
  bool none_ = true;
};

/// B with the base at a Bishop frame, by turns of the tip about the axes of the base frame and psi_2..N.
/// @param frame  as seen from the tip   @param R_base_tip  of the guess
/// @param angle  of each tube in that frame, or where it is grasped before   @param lane  lane(j) of unknown j
template <class S, std::size_t N, class Lane>
inline auto base_jacobian(const Frame<S>& frame, const Mat3& R_base_tip, const std::array<S, N>& angle,
                          const Lane& lane) noexcept {
  constexpr int n = int(N) + 2;
  Eigen::Matrix<double, n, n> B;
  const Mat3 R = R_base_tip * frame.rotation();
  for (int j = 0; j < n; ++j) {
    const auto part = [at = lane(j)](const Lanes* d) { return d[at / lane_count][at % lane_count]; };
    const double turn_of_tube_1 = part(angle[0].d);
    const auto& twist = frame.rotation_twist;
    const Vec3 turn = R * Vec3(part(twist[0]), part(twist[1]), part(twist[2]) + turn_of_tube_1);
    for (int i = 0; i < 3; ++i) B(i, j) = turn[i] + (i == j);
    for (std::size_t i = 1; i < N; ++i) B(int(i) + 2, j) = part(angle[i].d) - turn_of_tube_1;
  }
  return B;
}

/// Angles of the tubes with the base at s: where they are grasped, if that is before s.
/// @param twist_rate  twist_rate(i) behind the plate
template <int N, class S, class Psi, class TwistRate>
inline std::array<S, N> angles_at(double s, const Joints<N>& q, const Psi& psi, const TwistRate& twist_rate) noexcept {
  std::array<S, N> angle;
  for (int i = 0; i < N; ++i) {
    angle[std::size_t(i)] = psi(i);
    if (s < 0) angle[std::size_t(i)] = psi(i) + std::max(q.beta[i], s) * twist_rate(i);
  }
  return angle;
}

/// Whether the equilibrium that a guess describes is stable. One integration of the equations with every load, whatever
/// loads the robot: this is asked once a branch. Real time: yes.
template <class Stepper, int N>
CTCR_NOINLINE bool is_stable(const Coefficients<N>& c, const Joints<N>& q, const TipLoad& load,
                             const TipGuess<N>& guess, const Steps<N>& steps) noexcept {
  using Col = Columns<N, Loading::weight, Derivatives::none>;
  using S = Dual<Col::groups>;
  const Vec3 axis[3] = {Vec3::Unit(0), Vec3::Unit(1), Vec3::Unit(2)};
  RobotState<S, N> state = tip_state<Col, S>(c, load, guess, axis);
  Frame<S> frame;
  TubeTips<N> tips;
  ConjugatePoints<Col::unknowns> points;
  constexpr auto lane = [](int j) constexpr { return Col::unknown(j); };
  const auto base_at = [&](double s, const SegmentTubes<N>&, const RobotState<S, N>& y, const Frame<S>& f) noexcept {
    const auto psi = [&](int i) { return y.psi[std::size_t(i)]; };
    const auto twist_rate = [&](int i) { return y.w[std::size_t(i)]; };
    points.base_at(base_jacobian(f, guess.rotation, angles_at<N, S>(s, q, psi, twist_rate), lane));
  };
  integrate<Stepper, Col>(c, q, steps, state, frame, tips, base_at);
  for (int i = N; i-- > 0;) base_at(q.beta[i], {}, state, frame);
  return points.none();
}

/// The same for a robot with effects.
template <class Stepper, int N, class Fx>
CTCR_NOINLINE bool is_stable(const EffectCoefficients<N, Fx>& c, const Joints<N>& q, const TipLoad& load,
                             const TipGuess<N>& guess, const Steps<N>& steps) noexcept {
  if (!c.on_rod) return is_stable<Stepper>(c.plain, q, load, guess, steps);
  using Window = detail::Window<lane_groups(N + 2)>;
  using Pass = EffectPass<N, Fx, Window::groups>;
  using S = typename Window::S;
  const RodInputs<N, S, Fx> in = constant_inputs<S>(c, q, load);
  ConjugatePoints<Pass::unknowns> points;
  const auto lane = [](int j) { return j; };
  const auto base_at = [&](const Frame<S>& f, const std::array<S, N>& angle) noexcept {
    points.base_at(base_jacobian(f, guess.rotation, angle, lane));
  };
  const auto node = [&](const S&, const auto&, const auto& y, const Frame<S>& f, const auto&) noexcept {
    base_at(f, angles_at<N, S>(0, q, [&](int i) { return y.psi(i); }, [](int) { return S(0.0); }));
  };
  const auto behind = [&](double s, const auto& y, const Frame<S>& f) noexcept {
    base_at(f, angles_at<N, S>(
                   s, q, [&](int i) { return y.psi(i); },
                   [&](int i) { return y.torque(i) * inverse(in.tubes[std::size_t(i)].kz); }));
  };
  const Pass pass(in, sort_events(c.plain, q.beta), guess, 0, steps, Window{}, Ignored{}, node);
  for (int i = N; i-- > 0;) behind(q.beta[i], pass.plate(), pass.frame());
  base_at(pass.frame(), pass.angles());
  return points.none();
}

}  // namespace ctcr::detail
