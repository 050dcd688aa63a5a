// B_u, the derivative of the shooting residual by its unknowns, against differences of the same discrete map.
//
// evaluate() returns Newton's step -B_u^-1 b rather than B_u. Around a solution the step from a guess that is off by d
// must be -d: so B_u equals the differences of b exactly if the step's own differences are minus the identity.
#include <gtest/gtest.h>

#include <Eigen/LU>

#include "support/laws.hpp"

namespace ctcr {
namespace newton_test {

using test::Random;

template <int N_, Loading L_, Derivatives D_>
struct Equations {
  static constexpr int N = N_;
  static constexpr Loading L = L_;
  static constexpr Derivatives D = D_;
};

template <class T>
struct Newton : testing::Test {};
using Kinds = testing::Types<
    Equations<2, Loading::none, Derivatives::none>, Equations<3, Loading::none, Derivatives::jacobian>,
    Equations<4, Loading::none, Derivatives::none>, Equations<1, Loading::force, Derivatives::none>,
    Equations<2, Loading::force, Derivatives::jacobian>, Equations<3, Loading::force, Derivatives::none>,
    Equations<3, Loading::force, Derivatives::compliance>, Equations<4, Loading::weight, Derivatives::none>,
    Equations<3, Loading::weight, Derivatives::jacobian>, Equations<2, Loading::weight, Derivatives::compliance>,
    Equations<1, Loading::weight, Derivatives::compliance>, Equations<3, Loading::weight, Derivatives::none>,
    Equations<4, Loading::weight, Derivatives::jacobian>, Equations<3, Loading::weight, Derivatives::compliance>>;
TYPED_TEST_SUITE(Newton, Kinds);

template <class K>
class Shots {
public:
  static constexpr int N = K::N;
  using Ev = Evaluation<N, K::L, K::D>;
  static constexpr int unknowns = Ev::Col::unknowns, turns = Ev::Col::turns;
  using Vector = Eigen::Matrix<double, unknowns, 1>;
  using Matrix = Eigen::Matrix<double, unknowns, unknowns>;

  explicit Shots(const test::Case<N>& c) : c_(c), coefficients_(make_coefficients(c.robot)) {
    Workspace<N> ws;
    Solution<N> solution;
    (void)solve<Derivatives::none>(Model<N>(c.robot), c.q, c.load, ws, solution,
                                   {.tolerance = 1e-13, .accuracy = test::as_told});
    EXPECT_LT(solution.residual, 1e-11);
    guess_ = ws.guess;
    detail::turn_axes<K::L>(c.load, axis_);
  }

  /// What one evaluation finds with the guess moved off the solution.
  struct Shot {
    Vector residual, step;
    double det;
  };
  Shot at(const Vector& off) const {
    TipGuess<N> guess = guess_;
    if constexpr (turns > 0) {
      Vec3 turn = Vec3::Zero();
      for (int j = 0; j < turns; ++j) turn += off[j] * axis_[j];
      guess.rotation = rotation_matrix(turn) * guess.rotation;
    }
    for (int i = 1; i < N; ++i) guess.psi[i] += off[turns + i - 1];
    Ev ev;
    evaluate<K::D, K::L, MagnusRk4>(coefficients_, c_.q, c_.load, guess, Steps<N>(1), ev);
    Shot shot;
    for (int j = 0; j < turns; ++j) shot.residual[j] = axis_[j].dot(ev.turn);
    for (int i = 1; i < N; ++i) shot.residual[turns + i - 1] = ev.angle_error[i];
    for (int j = 0; j < unknowns; ++j) shot.step[j] = ev.unknown(j, Ev::Col::newton);
    shot.det = ev.det;
    return shot;
  }
  /// Derivative of a member of Shot by the unknowns at the solution, by differences of fourth order.
  Matrix derivative(Vector Shot::* member) const {
    constexpr double h = 3e-4;
    Matrix A;
    for (int j = 0; j < unknowns; ++j) {
      const auto moved = [&](double t) { return Vector(at(t * Vector::Unit(j)).*member); };
      A.col(j) = (8.0 * (moved(h) - moved(-h)) - (moved(2 * h) - moved(-2 * h))) / (12 * h);
    }
    return A;
  }

private:
  test::Case<N> c_;
  Coefficients<N> coefficients_;
  TipGuess<N> guess_;
  Vec3 axis_[turns > 0 ? turns : 1];  ///< of the unknown turns
};

template <class K>
test::Case<K::N> random_case(Random& random) {
  const bool any_load = K::L == Loading::weight;
  return test::smooth_case<K::N>(random, K::L == Loading::none ? 0 : 0.3, any_load ? 0.01 : 0,
                                 any_load ? test::tilted_gravity : Vec3(0, 0, 0));
}

TYPED_TEST(Newton, BuEqualsDifferencesOfTheDiscreteMap) {
  Random random(31);
  for (int n = 0; n < test::cases(20); ++n) {
    const Shots<TypeParam> shots(random_case<TypeParam>(random));
    using Matrix = typename Shots<TypeParam>::Matrix;
    const Matrix steps = shots.derivative(&Shots<TypeParam>::Shot::step);
    EXPECT_LT((steps + Matrix::Identity()).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TYPED_TEST(Newton, StabilityIsTheDeterminantOfBu) {
  Random random(32);
  for (int n = 0; n < test::cases(20); ++n) {
    const Shots<TypeParam> shots(random_case<TypeParam>(random));
    const double sign = Shots<TypeParam>::turns % 2 == 0 ? 1 : -1;  // rows of turns carry minus the unknown turn
    const auto B_u = shots.derivative(&Shots<TypeParam>::Shot::residual);
    const double det = sign * Eigen::MatrixXd(B_u).determinant();
    EXPECT_NEAR(shots.at(Shots<TypeParam>::Vector::Zero()).det, det, 1e-8 * (1 + std::abs(det)));
  }
}

TYPED_TEST(Newton, ConvergesQuadratically) {
  using Vector = typename Shots<TypeParam>::Vector;
  Random random(33);
  std::srand(33);
  for (int n = 0; n < test::cases(20); ++n) {
    const Shots<TypeParam> shots(random_case<TypeParam>(random));
    const Vector direction = Vector::Random().normalized();
    const auto left_over = [&](double off) { return (shots.at(off * direction).step + off * direction).norm(); };
    const double far = left_over(1e-3), near = left_over(1e-4);
    EXPECT_LT(far, 0.2 * 1e-3) << "after one step";
    EXPECT_LT(near, 0.015 * far + 1e-11) << "a tenth of the way leaves a hundredth of the error";
  }
}

}  // namespace newton_test
}  // namespace ctcr
