// Tubes that rub wind each other up.
#include "ctcr/friction/solve_friction.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "ctcr/calibration/identification/recording.hpp"
#include "ctcr/friction/frictionless_torsion.hpp"
#include "support/walk.hpp"

namespace ctcr {
namespace wind_up_test {

using test::at, test::effect, test::Random, test::two_tubes, test::Walk, test::with_friction;

constexpr double elastic = 1;  // the second law of friction

ThreadPool pool(2);

Robot<2> straight() {
  Robot<2> robot = two_tubes();
  for (Tube& tube : robot.tubes) tube.curvature = 0;
  return robot;
}
Catalogue::On<2> rubbing_along(double torque_per_length, double slip_angle) {
  Catalogue::On<2> effects;
  effect<Friction, 2>(effects).values = {0, 0, torque_per_length, slip_angle, 0, elastic};
  return effects;
}
/// What tubes that are bound to each other elastically, all along, do when the inner one is turned at its base.
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

TEST(WindUp, ElasticContactsAndTubesShareARotation) {
  const Robot<2> robot = straight();
  constexpr double torque = 0.02, turn = 0.15;
  for (const double slip : {0.15, 0.3, 1.0}) {
    Walk<2> walk(robot, rubbing_along(torque, slip));
    const Joints<2> q = at(turn, 0);
    walk.to(at(0, 0)).to(q);
    wind_up(walk.system, std::span(walk.rows), pool);
    const Bound bound(robot, q, turn, torque, slip);
    const auto h = walk.remembered<Friction>();
    double differ = 0;
    for (const auto& [breakpoint, place] : {std::pair(1, bound.overlap), {Contacts<2>::plate, 0.0}}) {
      const std::size_t k = Contacts<2>::index(0, breakpoint);
      EXPECT_NEAR(h[k], bound.rotation(place) / slip, 0.03 * h[k]) << slip;  // between contacts, h is a straight line
      EXPECT_NEAR(walk.rows[1].twist.back()[k], bound.rotation(place) - turn, 0.002) << slip;
      differ = h[k] - differ;
    }
    EXPECT_GT(differ, slip < 0.2 ? 0.05 : 0.0) << "the base turns farther than the tip";
  }
}

TEST(WindUp, SlopesOfTheTwistAreItsDerivatives) {
  using P = SystemParameters<3, Catalogue>;
  using V = ParameterVector<3>;
  Random random(3);
  for (int n = 0; n < test::cases(5); ++n) {
    const auto c = test::smooth_case<3>(random, 0.1, 0.3, test::tilted_gravity);
    auto effects = test::random_effects<3>(random);
    auto& friction = effect<Friction, 3>(effects);
    friction.values = {0.03, 0.02, 0.05, 0.01, 0.3, 0, 0};
    for (double& h : friction.history.state) h = test::uniform(random, -0.9, 0.9);
    effect<Contact, 3>(effects).values[0] = 0;  // what surroundings push is held
    const System<3, Catalogue> system{{2e-4, -1, {-0.01, 0.02, 0.03}, {0.1, 0.2, 0.3}},
                                      Model<3, Catalogue>(c.robot, effects),
                                      {},
                                      {.tolerance = 1e-12, .steps = 3}};
    const RecordedRow<3> row{motor_angles(system.transmission, c.q), c.load, {}};
    Workspace<3> ws;
    RecordedPrediction<3, Catalogue> prediction;
    const auto twist = [&](const System<3, Catalogue>& now) {
      EXPECT_EQ(predict(now, row, now.model.effects().history(), ws, prediction), Status::ok);
      return twist_of(prediction.model, ws, now.settings.steps, {});
    };
    (void)twist(system);
    std::vector<int> parameters{V::index(Parameter::curvature, 0),   V::index(Parameter::youngs_modulus, 1),
                                V::index(Parameter::length, 1),      V::index(Parameter::gravity, 0),
                                V::index(Parameter::rotation_ratio), V::index(Parameter::home_rotation, 1)};
    const std::size_t first_of_friction = parameters.size();
    for (int k = 0; k < Friction<3>::count; ++k) parameters.push_back(V::count + k);
    detail::Variables<3, Catalogue> variables;
    for (int j = 0; j < int(parameters.size()); ++j)
      variables.put(first_variable<3> + j, j, parameters[std::size_t(j)]);
    const auto slopes = detail::twist_slopes(system, row, prediction, ws, variables);
    const auto plain = twist_slopes(prediction.model, ws, system.settings.steps);
    EXPECT_LT((slopes.by_rubbing - plain.by_rubbing).norm(), 1e-10);
    const auto check = [&](const auto& column, double change, double tolerance, const auto& moved) {
      const auto more = twist(moved(change)), less = twist(moved(-change));
      for (int i = 0; i < Contacts<3>::count; ++i)
        EXPECT_NEAR(column[i], wrapped(more[std::size_t(i)] - less[std::size_t(i)]) / (2 * change), tolerance)
            << n << ": contact " << i;
    };
    for (int k = 0; k < Contacts<3>::count; ++k)
      check(slopes.by_rubbing.col(k), 1e-4, 1e-6, [&](double by) {
        auto other = effects;
        effect<Friction, 3>(other).history.state[std::size_t(k)] += by;
        System<3, Catalogue> moved = system;
        moved.model = Model<3, Catalogue>(c.robot, other);
        return moved;
      });
    for (std::size_t j = 0; j < parameters.size(); ++j) {
      const Eigen::VectorXd x = P::values(system);
      const bool rubs = j >= first_of_friction;
      const double size = rubs ? 1.0 : std::max(0.05, std::abs(x[parameters[j]])), change = 1e-5 * size;
      check(slopes.by_variables.col(Eigen::Index(j)), change, 1e-4 / size, [&](double by) {
        Eigen::VectorXd there = x;
        there[parameters[j]] += by;
        return P::with_values(system, there);
      });
      if (!rubs) {
        EXPECT_GT(slopes.by_variables.col(Eigen::Index(j)).norm() * size, 1e-5) << P::name(parameters[j]);
      }
    }
    EXPECT_GT(slopes.by_rubbing.norm(), 1e-3);
    EXPECT_GT(slopes.by_variables.rightCols<Friction<3>::count>().norm(), 1e-2);
  }
}

/// A walk among curved tubes that turns back and forth.
Walk<2> curved_walk(double law, unsigned seed) {
  Random random(seed);
  Walk<2> walk(two_tubes(), with_friction(0.03, 0.7, law));
  for (int k = 0; k < 12; ++k)
    walk.to(at(test::uniform(random, -1.5, 1.5), test::uniform(random, -1, 1), -0.35 + 1e-3 * k));
  add_twist<2>(System<2>{walk.system.transmission, Model<2>(two_tubes()), {}, walk.system.settings}, walk.rows);
  return walk;
}

TEST(WindUp, TwistIsThatOfTheEquilibrium) {
  for (const double law : {0.0, elastic}) {
    Walk<2> walk = curved_walk(law, 1);
    const std::vector<RecordedRow<2>> plain = walk.rows;
    EXPECT_GT(wind_up(walk.system, std::span(walk.rows), pool), 0.05);
    const auto memory = histories<2, Catalogue>(walk.system, walk.rows);
    double wound = 0;
    for (std::size_t row = 0; row < walk.rows.size(); ++row) {
      Workspace<2> ws;
      RecordedPrediction<2, Catalogue> p;
      ASSERT_EQ(predict(walk.system, walk.rows[row], memory[row], ws, p), Status::ok);
      const auto& twist = walk.rows[row].twist.back();
      const auto found = twist_of(p.model, ws, walk.system.settings.steps, twist);
      for (std::size_t k = 0; k < twist.size(); ++k) EXPECT_NEAR(found[k], twist[k], 2e-4) << row;
      wound = std::max(wound, std::abs(twist[0] - plain[row].twist.back()[0]));
    }
    EXPECT_GT(wound, 0.05);
    EXPECT_LT(wind_up(walk.system, std::span(walk.rows), pool), 1e-3) << "it was not wound up to its end";
  }
}

/// Contacts come and go while the tubes slide, and some that rub nothing stick and slip.
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
  add_twist<3>(System<3>{walk.system.transmission, Model<3>(robot), {}, walk.system.settings}, walk.rows);
  return walk;
}

TEST(WindUp, FollowsContactsThatComeAndGo) {
  Walk<3> walk = coming_and_going(test::cases(60), 4);
  EXPECT_GT(wind_up(walk.system, std::span(walk.rows), pool), 0.1);
  EXPECT_LT(wind_up(walk.system, std::span(walk.rows), pool), 1e-3);
}

TEST(WindUp, NeedsHalfOfTheStepsOfReadings) {
  Walk<3> walk = coming_and_going(20, 2), fine = coming_and_going(20, 12);
  EXPECT_GT(wind_up(walk.system, std::span(walk.rows), pool), 0.1);
  EXPECT_GT(wind_up(fine.system, std::span(fine.rows), pool), 0.1);
  for (std::size_t row = 0; row < walk.rows.size(); ++row)
    for (std::size_t c = 0; c < std::size_t(Contacts<3>::count); ++c)
      EXPECT_NEAR(walk.rows[row].twist.back()[c], fine.rows[row].twist.back()[c], 2e-3) << row;
}

/// Which contacts stick and which slip changes with the parameters: there slopes jump, and few places have such kinks.
TEST(WindUp, KnowsHowTheTwistChangesWithTheParameters) {
  using P = SystemParameters<2, Catalogue>;
  using V = ParameterVector<2>;
  for (const double law : {0.0, elastic}) {
    Walk<2> walk = curved_walk(law, 4);
    auto effects = walk.system.model.effects();
    effect<Friction, 2>(effects).values = {0.03, 0.02, 0.01, 0.3, 0.7, law};
    walk.system.model = Model<2, Catalogue>(two_tubes(), effects);
    const auto wound = [&](const Eigen::VectorXd& x, Winding<2>* winding) {
      Walk<2> other = walk;
      other.system = P::with_values(walk.system, x);
      for (int again = 0; again < 3; ++again) wind_up(other.system, std::span(other.rows), pool, winding);
      Eigen::Matrix<double, Contacts<2>::count, Eigen::Dynamic> twist(Contacts<2>::count, 0);
      for (const auto& row : other.rows)
        for (const auto& place : row.twist) {
          twist.conservativeResize(Eigen::NoChange, twist.cols() + 1);
          twist.rightCols<1>() = VecN<Contacts<2>::count>::Map(place.data());
        }
      return twist;
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
    Winding<2> winding;
    for (const auto& [parameter, change] : changes) winding.variables.push_back(parameter);
    const Eigen::VectorXd x = P::values(walk.system);
    const auto twist = wound(x, &winding);
    int looked_at = 0;
    for (std::size_t j = 0; j < changes.size(); ++j) {
      const auto [parameter, change] = changes[j];
      Eigen::VectorXd more = x, less = x;
      more[parameter] += change, less[parameter] -= change;
      const Eigen::MatrixXd found = (wound(more, nullptr) - wound(less, nullptr)) / (2 * change);
      Eigen::MatrixXd slope(found.rows(), found.cols());
      for (Eigen::Index k = 0; k < found.cols(); ++k) slope.col(k) = winding.at(std::size_t(k)).col(Eigen::Index(j));
      if (found.norm() * change < 1e-5) continue;  // the outer tube touches nothing but the plate
      ++looked_at;
      const std::string what = P::name(parameter) + ", law " + std::to_string(law);
      EXPECT_LT((found - slope).norm(), 0.05 * found.norm()) << what;
      std::vector<double> far;
      for (Eigen::Index k = 0; k < slope.size(); ++k) far.push_back(std::abs(found.data()[k] - slope.data()[k]));
      std::ranges::nth_element(far, far.begin() + std::ptrdiff_t(far.size() / 2));
      EXPECT_LT(far[far.size() / 2], 0.01 * found.cwiseAbs().maxCoeff()) << what;
    }
    EXPECT_EQ(looked_at, 9) << "law " << law;
    const Eigen::VectorXd there = x + 0.5 * (Eigen::VectorXd::Unit(x.size(), V::count) * 2e-4);
    Twist<2> extrapolated;
    VecN<Contacts<2>::count>::Map(extrapolated.data()) = twist.rightCols<1>();
    winding.extrapolate(there, std::size_t(twist.cols()) - 1, extrapolated);
    const Eigen::VectorXd expected = twist.rightCols<1>() + 1e-4 * winding.at(std::size_t(twist.cols()) - 1).col(0);
    for (std::size_t c = 0; c < extrapolated.size(); ++c) EXPECT_DOUBLE_EQ(extrapolated[c], expected[Eigen::Index(c)]);
  }
}

/// Pieces of a recording are walked at once; some end otherwise than the next one began.
TEST(WindUp, IsThatOfOneWalkAndOfAnyNumberOfThreads) {
  for (const double law : {0.0, elastic}) {
    Random random(6);
    Walk<2> walk(two_tubes(), with_friction(0.03, 0.7, law));
    for (int k = 0; k < 160; ++k)
      walk.to(at(test::uniform(random, -1.5, 1.5), test::uniform(random, -1, 1), -0.35 + 6e-5 * k));
    add_twist<2>(System<2>{walk.system.transmission, Model<2>(two_tubes()), {}, walk.system.settings}, walk.rows);
    Walk<2> other = walk;
    const std::vector<RecordedRow<2>> plain = walk.rows;
    ThreadPool alone(1);
    Winding<2> winding{.variables = {0, ParameterVector<2>::count}}, same = winding;
    EXPECT_EQ(wind_up(walk.system, std::span(walk.rows), pool, &winding),
              wind_up(other.system, std::span(other.rows), alone, &same));
    EXPECT_EQ(winding.slopes, same.slopes);
    EXPECT_TRUE(std::ranges::all_of(winding.equilibria, [](const auto& found) { return found.has_value(); }));
    detail::RecordedPath<2, double> path(walk.system.transmission, plain, [](double x, int) { return x; });
    ASSERT_GT(path.q.size(), (detail::WoundPlaces<2, Catalogue>::most)) << "all of it fits into one go";
    detail::Winder<2, Catalogue> winder(walk.system.model.effects());
    double differ = 0;
    std::optional<TipGuess<2>> nowhere;
    for (std::size_t row = 0, k = 0; row < plain.size(); ++row)
      for (std::size_t way = 0; way < plain[row].places(); ++way, ++k) {
        nowhere.reset();
        winder.wind(walk.system, on_the_way<2>(plain, row, way), plain[row].twist[way], path, k, nowhere, nullptr,
                    nullptr);
        EXPECT_EQ(walk.rows[row].twist[way], other.rows[row].twist[way]) << "row " << row;
        const Twist<2> one_walk = winder.stand().twist;
        for (std::size_t c = 0; c < one_walk.size(); ++c)
          differ = std::max(differ, std::abs(one_walk[c] - walk.rows[row].twist[way][c]));
      }
    EXPECT_LT(differ, 1e-3) << "law " << law;
  }
}

TEST(WindUp, IsNothingWhereNothingRubs) {
  Walk<2> walk(two_tubes(), with_friction(0));
  walk.to(at(0, 0)).to(at(1, 0));
  Recording<2, Catalogue> recording(walk.system, walk.rows, std::vector<Pose>(walk.rows.size()), {}, pool);
  EXPECT_EQ(recording.wind_up(Eigen::VectorXd(0)), 0);
}

TEST(WindUp, DoesNotDependOnHowAWayIsRecorded) {
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
    add_twist<2>(System<2>{walk.system.transmission, Model<2>(two_tubes()), {}, walk.system.settings}, walk.rows);
    if (!cut)
      for (auto& row : walk.rows) row.twist = {row.twist.back()}, row.jumps = {row.jumps.back()};
    wind_up(walk.system, std::span(walk.rows), pool);
    return walk;
  };
  const Walk<2> whole = walked(1, true), divided = walked(60, true), uncut = walked(1, false);
  EXPECT_GT(whole.rows[1].twist.size(), 10u);
  const double there = divided.rows.back().twist.back()[0];
  EXPECT_NEAR(whole.rows.back().twist.back()[0], there, 5e-3);
  EXPECT_GT(std::abs(uncut.rows.back().twist.back()[0] - there), 0.02) << "the way is so even that it proves nothing";
}

}  // namespace wind_up_test
}  // namespace ctcr
