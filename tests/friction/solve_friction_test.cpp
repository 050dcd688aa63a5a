// Friction along recordings.
#include "ctcr/friction/solve_friction.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "ctcr/calibration/identification/recording.hpp"
#include "ctcr/friction/frictionless_torsion.hpp"
#include "support/walk.hpp"

namespace ctcr {
namespace solve_friction_test {

using test::at, test::effect, test::Random, test::two_tubes, test::Walk, test::with_friction;

constexpr double elastic = 1;  // the second constitutive law of friction

ThreadPool pool(2);

Robot<2> straight() {
  Robot<2> robot = two_tubes();
  for (Tube& tube : robot.tubes) tube.curvature = 0;
  return robot;
}
Catalogue::On<2> distributed(double torque_per_length, double slip_angle) {
  Catalogue::On<2> effects;
  effect<Friction, 2>(effects).values = {0, 0, torque_per_length, slip_angle, 0, elastic};
  return effects;
}
/// Closed form: tubes that are bound to each other elastically along their overlap, the inner one turned at its base.
struct Bound {
  double rate;       ///< of the decay of their relative rotation from the plate on [1/m]
  double overlap;    ///< in front of the plate [m]
  double amplitude;  ///< of the relative rotation where the outer tube ends [rad]

  Bound(const Robot<2>& robot, const Joints<2>& q, double turn, double torque_per_length, double slip_angle)
    : overlap(robot.tubes[1].length + q.beta[1]) {
    double in_front = 0, behind = 0;  // softness of both per length, and of what is behind the plate
    for (int i = 0; i < 2; ++i) {
      const double soft = 1 / robot.tubes[std::size_t(i)].GJ();
      in_front += soft;
      behind -= q.beta[i] * soft;
    }
    rate = std::sqrt(in_front * torque_per_length / slip_angle);
    amplitude = turn / (std::cosh(rate * overlap) + behind / in_front * rate * std::sinh(rate * overlap));
  }
  [[nodiscard]] double rotation(double s) const { return amplitude * std::cosh(rate * (overlap - s)); }
};

/// Elastic contacts and tubes share a rotation of the base as the closed form says.
TEST(SolveFriction, ClosedForm) {
  const Robot<2> robot = straight();
  constexpr double torque = 0.02, turn = 0.15;
  for (const double slip : {0.15, 0.3, 1.0}) {
    Walk<2> walk(robot, distributed(torque, slip));
    const Joints<2> q = at(turn, 0);
    walk.to(at(0, 0)).to(q);
    solve_friction(walk.system, std::span(walk.rows), pool);
    const Bound bound(robot, q, turn, torque, slip);
    const auto h = walk.remembered<Friction>();
    double differ = 0;
    for (const auto& [breakpoint, s] : {std::pair(1, bound.overlap), {Contacts<2>::plate, 0.0}}) {
      const std::size_t k = Contacts<2>::index(0, breakpoint);
      EXPECT_NEAR(h[k], bound.rotation(s) / slip, 0.03 * h[k]) << slip;  // between contacts, h is a straight line
      EXPECT_NEAR(walk.rows[1].torsion.back()[k], bound.rotation(s) - turn, 0.002) << slip;
      differ = h[k] - differ;
    }
    EXPECT_GT(differ, slip < 0.2 ? 0.05 : 0.0) << "the base turns farther than the tip";
  }
}

/// A walk among curved tubes that turns back and forth.
Walk<2> curved_walk(double law, unsigned seed) {
  Random random(seed);
  Walk<2> walk(two_tubes(), with_friction(0.03, 0.7, law));
  for (int k = 0; k < 12; ++k)
    walk.to(at(test::uniform(random, -1.5, 1.5), test::uniform(random, -1, 1), -0.35 + 1e-3 * k));
  set_frictionless_torsion<2>(System<2>{walk.system.transmission, Model<2>(two_tubes()), {}, walk.system.settings},
                              walk.rows);
  return walk;
}

/// The torsion of the rows is that of the equilibrium with the friction which it leaves.
TEST(SolveFriction, Consistency) {
  for (const double law : {0.0, elastic}) {
    Walk<2> walk = curved_walk(law, 1);
    const std::vector<RecordedRow<2>> plain = walk.rows;
    EXPECT_GT(solve_friction(walk.system, std::span(walk.rows), pool), 0.05);
    const auto history = histories<2, Catalogue>(walk.system, walk.rows);
    double changed = 0;
    for (std::size_t row = 0; row < walk.rows.size(); ++row) {
      Workspace<2> ws;
      RecordedPrediction<2, Catalogue> p;
      ASSERT_EQ(predict(walk.system, walk.rows[row], history[row], ws, p), Status::ok);
      const auto& torsion = walk.rows[row].torsion.back();
      const auto found = relative_torsion(p.model, ws, torsion);
      for (std::size_t k = 0; k < torsion.size(); ++k) EXPECT_NEAR(found[k], torsion[k], 2e-4) << row;
      changed = std::max(changed, std::abs(torsion[0] - plain[row].torsion.back()[0]));
    }
    EXPECT_GT(changed, 0.05);
    EXPECT_LT(solve_friction(walk.system, std::span(walk.rows), pool), 1e-3) << "it had not converged";
  }
}

/// Contacts come and go while the tubes slide, and some without a load stick and slip.
Walk<3> coming_and_going(int rows, int steps) {
  const Robot<3> robot = test::paper_robot();
  Catalogue::On<3> effects;
  effect<Friction, 3>(effects).values = {0.03, 0.03, 0.03, 0, 0.03, 1, elastic};
  Random random(3);
  Walk<3> walk(robot, effects);
  walk.system.settings.steps = steps;
  for (int k = 0; k < rows; ++k) {
    Joints<3> q;
    q.beta << -0.30 - test::uniform(random, 0, 0.08), -0.22 - test::uniform(random, 0, 0.06),
        -0.12 - test::uniform(random, 0, 0.05);
    for (double& angle : q.alpha) angle = test::uniform(random, -2, 2);
    walk.to(q);
  }
  set_frictionless_torsion<3>(System<3>{walk.system.transmission, Model<3>(robot), {}, walk.system.settings},
                              walk.rows);
  return walk;
}

TEST(SolveFriction, ContactsThatComeAndGo) {
  Walk<3> walk = coming_and_going(test::cases(60), 4);
  EXPECT_GT(solve_friction(walk.system, std::span(walk.rows), pool), 0.1);
  EXPECT_LT(solve_friction(walk.system, std::span(walk.rows), pool), 1e-3);
}

/// Half of the steps with which readings are integrated are enough.
TEST(SolveFriction, Steps) {
  Walk<3> walk = coming_and_going(20, 2), fine = coming_and_going(20, 12);
  EXPECT_GT(solve_friction(walk.system, std::span(walk.rows), pool), 0.1);
  EXPECT_GT(solve_friction(fine.system, std::span(fine.rows), pool), 0.1);
  for (std::size_t row = 0; row < walk.rows.size(); ++row)
    for (std::size_t c = 0; c < std::size_t(Contacts<3>::count); ++c)
      EXPECT_NEAR(walk.rows[row].torsion.back()[c], fine.rows[row].torsion.back()[c], 2e-3) << row;
}

/// Derivatives against central differences. They jump at the few samples where a contact starts to stick or to slip.
TEST(SolveFriction, Derivatives) {
  using P = SystemParameters<2, Catalogue>;
  using V = ParameterVector<2>;
  for (const double law : {0.0, elastic}) {
    Walk<2> walk = curved_walk(law, 4);
    auto effects = walk.system.model.effects();
    effect<Friction, 2>(effects).values = {0.03, 0.02, 0.01, 0.3, 0.7, law};
    walk.system.model = Model<2, Catalogue>(two_tubes(), effects);
    const auto solved = [&](const Eigen::VectorXd& x, LinearisedTorsion<2>* linear) {
      Walk<2> other = walk;
      other.system = P::with_values(walk.system, x);
      for (int again = 0; again < 3; ++again) solve_friction(other.system, std::span(other.rows), pool, linear);
      Eigen::Matrix<double, Contacts<2>::count, Eigen::Dynamic> torsion(Contacts<2>::count, 0);
      for (const auto& row : other.rows)
        for (const auto& sample : row.torsion) {
          torsion.conservativeResize(Eigen::NoChange, torsion.cols() + 1);
          torsion.rightCols<1>() = VecN<Contacts<2>::count>::Map(sample.data());
        }
      return torsion;
    };
    const std::vector<std::pair<int, double>> changes{{V::count, 2e-4},
                                                      {V::count + 1, 2e-4},
                                                      {V::count + 2, 2e-4},
                                                      {V::count + 3, 5e-3},
                                                      {V::count + 4, 5e-3},
                                                      {V::index(Parameter::curvature, 0), 0.02},
                                                      {V::index(Parameter::home_rotation, 0), 2e-3},
                                                      {V::index(Parameter::youngs_modulus, 1), 4e9},
                                                      {V::index(Parameter::rotation_ratio), 1e-3},
                                                      {V::index(Parameter::home_translation, 1), 1e-4}};
    LinearisedTorsion<2> linear;
    for (const auto& [parameter, change] : changes) linear.variables.push_back(parameter);
    const Eigen::VectorXd x = P::values(walk.system);
    const auto torsion = solved(x, &linear);
    int looked_at = 0;
    for (std::size_t j = 0; j < changes.size(); ++j) {
      const auto [parameter, change] = changes[j];
      Eigen::VectorXd more = x, less = x;
      more[parameter] += change, less[parameter] -= change;
      const Eigen::MatrixXd found = (solved(more, nullptr) - solved(less, nullptr)) / (2 * change);
      Eigen::MatrixXd exact(found.rows(), found.cols());
      for (Eigen::Index k = 0; k < found.cols(); ++k) exact.col(k) = linear.at(std::size_t(k)).col(Eigen::Index(j));
      if (found.norm() * change < 1e-5) continue;  // the outer tube touches nothing but the plate
      ++looked_at;
      const std::string what = P::name(parameter) + ", law " + std::to_string(law);
      EXPECT_LT((found - exact).norm(), 0.05 * found.norm()) << what;
      std::vector<double> far;
      for (Eigen::Index k = 0; k < exact.size(); ++k) far.push_back(std::abs(found.data()[k] - exact.data()[k]));
      std::ranges::nth_element(far, far.begin() + std::ptrdiff_t(far.size() / 2));
      EXPECT_LT(far[far.size() / 2], 0.01 * found.cwiseAbs().maxCoeff()) << what;
    }
    EXPECT_EQ(looked_at, 9) << "law " << law;
    const Eigen::VectorXd there = x + 0.5 * (Eigen::VectorXd::Unit(x.size(), V::count) * 2e-4);
    RelativeTorsion<2> extrapolated;
    VecN<Contacts<2>::count>::Map(extrapolated.data()) = torsion.rightCols<1>();
    linear.extrapolate(there, std::size_t(torsion.cols()) - 1, extrapolated);
    const Eigen::VectorXd expected = torsion.rightCols<1>() + 1e-4 * linear.at(std::size_t(torsion.cols()) - 1).col(0);
    for (std::size_t c = 0; c < extrapolated.size(); ++c) EXPECT_DOUBLE_EQ(extrapolated[c], expected[Eigen::Index(c)]);
  }
}

/// Segments of a recording are solved at once, and some end in another state than the next one began with: the answer is
/// that of one walk, for any number of threads.
TEST(SolveFriction, Segments) {
  for (const double law : {0.0, elastic}) {
    Random random(6);
    Walk<2> walk(two_tubes(), with_friction(0.03, 0.7, law));
    for (int k = 0; k < 160; ++k)
      walk.to(at(test::uniform(random, -1.5, 1.5), test::uniform(random, -1, 1), -0.35 + 6e-5 * k));
    set_frictionless_torsion<2>(System<2>{walk.system.transmission, Model<2>(two_tubes()), {}, walk.system.settings},
                                walk.rows);
    Walk<2> other = walk;
    const std::vector<RecordedRow<2>> plain = walk.rows;
    ThreadPool alone(1);
    LinearisedTorsion<2> linear{.variables = {0, ParameterVector<2>::count}}, same = linear;
    EXPECT_EQ(solve_friction(walk.system, std::span(walk.rows), pool, &linear),
              solve_friction(other.system, std::span(other.rows), alone, &same));
    EXPECT_EQ(linear.derivatives, same.derivatives);
    EXPECT_TRUE(std::ranges::all_of(linear.equilibria, [](const auto& found) { return found.has_value(); }));
    const RecordedPath<2> path = recorded_path<2, Catalogue>(walk.system, plain);
    ASSERT_GT(path.q.size(), (detail::SolvedSamples<2, Catalogue>::most)) << "all of it is solved at once";
    detail::PathSolver<2, Catalogue> solver(walk.system.model.effects());
    double differ = 0;
    for (std::size_t k = 0; k < path.q.size(); ++k) {
      const auto [row, of_row] = path.index[k];
      solver.solve(walk.system, path.sample(plain, k), plain[row].torsion[of_row], path, k, {});
      EXPECT_EQ(walk.rows[row].torsion[of_row], other.rows[row].torsion[of_row]) << "row " << row;
      const RelativeTorsion<2> one_walk = solver.state().torsion;
      for (std::size_t c = 0; c < one_walk.size(); ++c)
        differ = std::max(differ, std::abs(one_walk[c] - walk.rows[row].torsion[of_row][c]));
    }
    EXPECT_LT(differ, 1e-3) << "law " << law;
  }
}

/// The friction of a dense recording is solved at some samples; at the others the torsion is that of a walk through all.
TEST(SolveFriction, DenseRecordings) {
  for (const double insertion : {0.0, 0.7}) {
    Random random(8);
    Walk<2> walk(two_tubes(), with_friction(0.03, insertion, elastic));
    Joints<2> q = at(0, 0);
    for (int corner = 0; corner < 6; ++corner) {
      const Joints<2> from = q,
                      to = at(test::uniform(random, -1, 1), test::uniform(random, -1, 1), -0.35 + 1e-3 * corner);
      const int steps = int((to.alpha - from.alpha).cwiseAbs().maxCoeff() / 0.003);
      for (int k = 1; k <= steps; ++k) {
        q.alpha = from.alpha + double(k) / steps * (to.alpha - from.alpha);
        q.beta = from.beta + double(k) / steps * (to.beta - from.beta);
        walk.to(q);
      }
    }
    set_frictionless_torsion<2>(System<2>{walk.system.transmission, Model<2>(two_tubes()), {}, walk.system.settings},
                                walk.rows);
    const std::vector<RecordedRow<2>> plain = walk.rows;
    LinearisedTorsion<2> linear{.variables = {ParameterVector<2>::count}};
    solve_friction(walk.system, std::span(walk.rows), pool, &linear);
    const auto solved = std::ranges::count_if(linear.equilibria, [](const auto& found) { return found.has_value(); });
    EXPECT_LT(solved, std::ssize(walk.rows) / 3) << "not fewer";

    const RecordedPath<2> path = recorded_path<2, Catalogue>(walk.system, plain);
    detail::PathSolver<2, Catalogue> solver(walk.system.model.effects());
    double differ = 0, added = 0;
    for (std::size_t k = 0; k < path.q.size(); ++k) {
      solver.solve(walk.system, path.sample(plain, k), plain[k].torsion[0], path, k, {});
      for (std::size_t c = 0; c < std::size_t(Contacts<2>::count); ++c) {
        differ += std::pow(solver.state().torsion[c] - walk.rows[k].torsion[0][c], 2);
        added += std::pow(solver.state().torsion[c] - plain[k].torsion[0][c], 2);
      }
    }
    EXPECT_LT(std::sqrt(differ / added), 0.03) << "insertion " << insertion;
  }
}

TEST(SolveFriction, WithoutFriction) {
  Walk<2> walk(two_tubes(), with_friction(0));
  walk.to(at(0, 0)).to(at(1, 0));
  Recording<2, Catalogue> recording(walk.system, walk.rows, std::vector<Pose>(walk.rows.size()), {}, pool);
  EXPECT_EQ(recording.solve_friction(Eigen::VectorXd(0)), 0);
}

/// The answer does not depend on the rows into which a straight motion is divided.
TEST(SolveFriction, Rows) {
  const Joints<2> start = at(0, 0), end = at(2.5, -1.5, -0.34);
  const auto walked = [&](int parts, bool cut) {
    Walk<2> walk(two_tubes(), with_friction(0.03, 0.7, elastic));
    for (int k = 0; k <= parts; ++k) {
      const double part = double(k) / parts;
      Joints<2> q;
      q.alpha = start.alpha + part * (end.alpha - start.alpha);
      q.beta = start.beta + part * (end.beta - start.beta);
      walk.to(q);
    }
    set_frictionless_torsion<2>(System<2>{walk.system.transmission, Model<2>(two_tubes()), {}, walk.system.settings},
                                walk.rows);
    if (!cut)
      for (auto& row : walk.rows) row.torsion = {row.torsion.back()}, row.jumps = {row.jumps.back()};
    solve_friction(walk.system, std::span(walk.rows), pool);
    return walk;
  };
  const Walk<2> whole = walked(1, true), divided = walked(60, true), uncut = walked(1, false);
  EXPECT_GT(whole.rows[1].torsion.size(), 10u);
  const double there = divided.rows.back().torsion.back()[0];
  EXPECT_NEAR(whole.rows.back().torsion.back()[0], there, 5e-3);
  EXPECT_GT(std::abs(uncut.rows.back().torsion.back()[0] - there), 0.02) << "the way is so even that it proves nothing";
}

}  // namespace solve_friction_test
}  // namespace ctcr
