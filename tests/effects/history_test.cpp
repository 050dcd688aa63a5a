// Effects that remember: friction, backlash, delay.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "ctcr/friction/frictionless_torsion.hpp"
#include "ctcr/friction/solve_friction.hpp"
#include "support/walk.hpp"

namespace ctcr {
namespace history_test {

using test::at, test::effect, test::Random, test::two_tubes, test::Walk, test::with_friction;

TEST(Friction, FollowsTheDirectionOfTheLastRotation) {
  constexpr std::size_t in_plate = Contacts<2>::count;
  const auto h = Walk<2>(two_tubes(), with_friction(0.03)).to(at(0, 0)).to(at(5, 0)).remembered<Friction>();
  EXPECT_NEAR(h[0], 1, 1e-6);
  EXPECT_EQ(h[in_plate], 0);
  const auto back =
      Walk<2>(two_tubes(), with_friction(0.03)).to(at(0, 0)).to(at(5, 0)).to(at(4.7, 0)).remembered<Friction>();
  EXPECT_NEAR(back[0], -1 + 2 * std::exp(-1), 1e-6);
  const auto outer = Walk<2>(two_tubes(), with_friction(0.03)).to(at(0, 0)).to(at(0, 5)).remembered<Friction>();
  EXPECT_NEAR(outer[0], -1, 1e-6);  // against the turning outer tube the inner one turned backwards
  EXPECT_NEAR(outer[in_plate], 1, 1e-6);
}

/// By the torque that it transmits.
TEST(Friction, HoldsTheTipBack) {
  // One tube whose curve is half in the plate: behind it the moment EI kappa, in front of it none.
  Robot<1> robot;
  robot.tubes[0] = test::paper_robot().tubes[0];
  const Tube& tube = robot.tubes[0];
  Joints<1> q;
  q.beta << 0.02 - tube.length;
  Catalogue::On<1> effects;
  effect<Friction, 1>(effects).values = {0.05, 0, 0.3, 0};
  for (const double direction : {1.0, -1.0}) {
    Joints<1> end = q;
    end.alpha << 10 * direction;
    const Solution<1> s = Walk<1>(robot, effects).to(q).to(end).solution();
    const double torque = 0.05 * tube.EI() * tube.curvature, lag = torque * -q.beta[0] / tube.GJ();
    const double stands = std::atan2(-s.position.x(), s.position.y()) + std::numbers::pi;  // it bends towards -y
    EXPECT_NEAR(std::remainder(stands - (end.alpha[0] - direction * lag), 2 * std::numbers::pi), 0, 1e-6);
    EXPECT_GT(lag, 0.1);
  }
}

TEST(Friction, DistributedTorque) {
  Robot<2> robot = two_tubes();
  for (Tube& tube : robot.tubes) tube.curvature = 0;
  const Tube &inner = robot.tubes[0], &outer = robot.tubes[1];
  Catalogue::On<2> effects;
  effect<Friction, 2>(effects).values = {0, 0, 0.02, 0.3, 0};
  for (const double direction : {1.0, -1.0}) {
    const Joints<2> start = at(-10 * direction, 0), end = at(0.4, 0);
    const Solution<2> s = Walk<2>(robot, effects).to(start).to(end).solution();
    const double overlap = outer.length + end.beta[1], torque = 0.02 * overlap;
    const auto torsion = [&](const Tube& t, double beta) { return torque * (-beta + 0.5 * overlap) / t.GJ(); };
    EXPECT_NEAR(rotation_vector(s.rotation).z(), 0.4 - direction * torsion(inner, end.beta[0]), 1e-9);
    EXPECT_NEAR(rotation_vector(s.tube_tips[1].rotation).z(), direction * torsion(outer, end.beta[1]), 1e-9);
    EXPECT_GT(torsion(inner, end.beta[0]), 0.05);
  }
}

TEST(Friction, FollowsRelativeTorsion) {
  Walk<2> walk(two_tubes(), with_friction(0.03, 0, 1)), straight = walk;
  walk.to(at(0, 0)).to(at(0.12, 0)).to(at(0.2, 0));
  walk.rows[1].torsion.resize(1);
  walk.rows[2].torsion.resize(1);
  walk.rows[1].torsion[0].fill(-0.06);  // half of it
  walk.rows[2].torsion[0].fill(-0.14);  // no more motion where they touch
  EXPECT_NEAR(walk.remembered<Friction>()[0], straight.to(at(0, 0)).to(at(0.06, 0)).remembered<Friction>()[0], 1e-12);
}

/// Sliding by insertion takes its share of the limit.
TEST(Friction, SlidingTurnsItAwayFromRotation) {
  for (const double radius : {0.4e-3, 1.2e-3}) {
    Walk<2> walk(two_tubes(), with_friction(0.03, 1, 1));
    const auto slid = [&](double turn, double slide) {
      Walk<2> other = walk;
      other.to(at(0, 0, -0.35)).to(at(turn, 0, -0.35 + slide));
      other.rows[0].radius.fill(radius);
      return other.remembered<Friction>();
    };
    const auto h = slid(0.03, 0.04 * radius);  // a tenth of the way to slip, 3 : 4
    EXPECT_NEAR(h[0], 0.1, 1e-12);
    EXPECT_NEAR(h[Contacts<2>::count + 1], 4.0 / 3 * h[0], 1e-12) << "what slides at the radius counts like rotation";
  }
  EXPECT_DOUBLE_EQ(ContactRadii<2>(two_tubes())[1], 0.5 * two_tubes().tubes[1].outer_diameter);
}

TEST(History, AFirstRowMayComeFromHome) {
  Catalogue::On<2> effects = with_friction(0.03, 0.7, 1);
  effect<BacklashRotation, 2>(effects).values = {0.1, 0.05};
  Walk<2> recorded(two_tubes(), effects), from_home(two_tubes(), effects);
  Transmission<2>& transmission = recorded.system.transmission;
  transmission.home_translation = at(0, 0).beta;
  from_home.system.transmission = transmission;
  const auto motors = [&](const Joints<2>& q) { return motor_angles(transmission, q); };
  const Joints<2> first = at(1.1, -0.4, -0.33), next = at(0.7, -0.2, -0.34);
  recorded.rows = {{motors(at(0, 0)), {}, {}}, {motors(first), {}, {}}, {motors(next), {}, {}}};
  from_home.rows = {{motors(first), {}, {}}, {motors(next), {}, {}}};
  from_home.rows[0].from_home = true;
  const System<2> plain{transmission, Model<2>(two_tubes()), {}, recorded.system.settings};
  ThreadPool pool(1);
  for (const bool is_solved : {false, true}) {
    if (is_solved)
      for (Walk<2>* walk : {&recorded, &from_home}) {
        set_frictionless_torsion<2>(plain, walk->rows);
        solve_friction(walk->system, std::span(walk->rows), pool);
      }
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_NEAR(from_home.remembered<Friction>()[k], recorded.remembered<Friction>()[k], 1e-4) << is_solved;
    for (std::size_t i = 0; i < 2; ++i)
      EXPECT_NEAR(from_home.remembered<BacklashRotation>()[i], recorded.remembered<BacklashRotation>()[i], 1e-12);
  }
  EXPECT_GT(from_home.rows[0].torsion.size(), 5u) << "a long way is cut into parts";
}

TEST(Friction, LagsAndNeverLeads) {
  Random random(1);
  for (int n = 0; n < test::cases(10); ++n) {
    const double start = test::uniform(random, -3, 3), turn = test::uniform(random, 1, 3) * (n % 2 == 0 ? 1 : -1);
    const auto after = [&](double coefficient) {
      return Walk<2>(two_tubes(), with_friction(coefficient)).to(at(start - turn, 0)).to(at(start, 0));
    };
    const auto shape_behind_plate = [&](const Walk<2>& walk) {
      Workspace<2> ws;
      RecordedPrediction<2, Catalogue> p;
      EXPECT_EQ(test::predict_last(walk.system, walk.rows, ws, p), Status::ok);
      return p;
    };
    const auto rubbing = shape_behind_plate(after(0.01)), smooth = shape_behind_plate(after(0));
    // Seen from the outer tube, which hardly moves, the tip of the inner one stays behind.
    const double lead = rotation_vector(rubbing.solution.rotation * smooth.solution.rotation.transpose()).z();
    EXPECT_LT(lead * turn, 0) << n;
  }
}

/// Not on the speed, nor on how a move is divided into rows.
TEST(Friction, DependsOnThePathAlone) {
  for (const auto& [insertion, law] : {std::pair(0.0, 0.0), {0.7, 0.0}, {0.0, 1.0}, {0.7, 1.0}}) {
    Walk<2> once(two_tubes(), with_friction(0.03, insertion, law)), slowly = once, divided = once;
    once.to(at(0, 0)).to(at(0.5, -0.1), 1).to(at(0.2, 0.3, -0.34, -0.24), 2);
    slowly.to(at(0, 0)).to(at(0.5, -0.1), 100).to(at(0.2, 0.3, -0.34, -0.24), 300);
    divided.to(at(0, 0)).to(at(0.5, -0.1), 1);
    for (int k = 1; k <= 7; ++k) {
      const double part = k / 7.0;
      divided.to(at(0.5 - 0.3 * part, -0.1 + 0.4 * part, -0.35 + 0.01 * part, -0.25 + 0.01 * part), 1 + part);
    }
    const auto h = once.remembered<Friction>();
    for (const auto& walk : {slowly, divided})
      for (std::size_t i = 0; i < h.size(); ++i) EXPECT_NEAR(walk.remembered<Friction>()[i], h[i], 1e-10);
  }
}

TEST(Friction, IsTakenOffByInsertion) {
  const auto h = [](double insertion, double law = 0) {
    return Walk<2>(two_tubes(), with_friction(0.03, insertion, law))
        .to(at(0, 0))
        .to(at(5, 0))
        .to(at(5, 0, -0.3499))
        .remembered<Friction>()[0];
  };
  EXPECT_NEAR(h(0), 1, 1e-6);
  EXPECT_NEAR(h(1), std::exp(-(1e-4 / 0.8e-3) / 0.3), 1e-6);
  EXPECT_NEAR(h(0, 1), 1, 1e-12);
  EXPECT_NEAR(h(1, 1), 1 / std::cosh((1e-4 / 0.8e-3) / 0.3), 1e-9);  // round the circle of the limit
}

TEST(Friction, OfAContactIsElasticUntilItSlips) {
  Walk<2> walk(two_tubes(), with_friction(0.03, 1, 1));
  walk.to(at(0, 0)).to(at(0.12, 0));
  EXPECT_NEAR(walk.remembered<Friction>()[0], 0.4, 1e-12);
  walk.to(at(0, 0));
  EXPECT_NEAR(walk.remembered<Friction>()[0], 0, 1e-12);
  walk.to(at(0.5, 0)).to(at(0.44, 0));
  EXPECT_NEAR(walk.remembered<Friction>()[0], 0.8, 1e-12);
}

/// With the second law the stiffness of a contact does not grow with its limit.
TEST(Friction, StiffnessIsIndependentOfTheLimit) {
  constexpr double usual = MomentJumps<2>::usual;
  const auto torque = [](double before, double after, double turn, double along = 0) {
    Catalogue::On<2> effects = with_friction(0.03, 1, 1);
    effect<Friction, 2>(effects).values[2] = along;
    Walk<2> walk(two_tubes(), effects);
    walk.to(at(0, 0)).to(at(0.03, 0)).to(at(0.03 + turn, 0));
    const double jumps[] = {before, before, after};
    for (std::size_t i = 0; i < 3; ++i) {
      walk.rows[i].torsion.resize(1);
      walk.rows[i].jumps.resize(1);
      walk.rows[i].jumps[0].fill(jumps[i]);
    }
    return 0.03 * after * walk.remembered<Friction>()[0];
  };
  for (const double jump : {0.5 * usual, usual, 2 * usual})
    EXPECT_NEAR(torque(jump, jump, 0.02), 0.03 * usual * 0.05 / 0.3, 1e-15) << jump;
  // Where the tubes press less hard, they give way to what is left; where harder, nothing is lost.
  EXPECT_NEAR(torque(usual, 3 * usual, 0), torque(usual, usual, 0), 1e-15);
  EXPECT_NEAR(torque(usual, 0.1 * usual, 0.01), 0.03 * 0.1 * usual, 1e-9);
  // What is rubbed all along does not depend on how hard they press: no more does its stiffness.
  const double share = 0.03 * usual / (0.03 * usual + 0.05 * 0.02), h = torque(2 * usual, 2 * usual, 0, 0.02) / 0.06;
  EXPECT_NEAR(h, usual * 0.03 / (0.3 * (1 + share)), 1e-12);
}

TEST(Backlash, IsAPlayOperator) {
  Catalogue::On<2> effects;
  constexpr double play = 0.02, gap = 1e-4;
  effect<BacklashRotation, 2>(effects).values = {play, 0};
  effect<BacklashTranslation, 2>(effects).values = {gap, 0};
  Walk<2> walk(two_tubes(), effects);
  const auto lag = [&] { return walk.remembered<BacklashRotation>()[0]; };
  walk.to(at(0, 0));
  EXPECT_EQ(lag(), 0);
  walk.to(at(0.005, 0));
  EXPECT_NEAR(lag(), -0.005, 1e-15);  // within the play the tube stands still
  walk.to(at(1, 0.3));
  EXPECT_NEAR(lag(), -play, 1e-15);
  EXPECT_EQ(walk.remembered<BacklashRotation>()[1], 0);
  walk.to(at(1, 1));
  EXPECT_NEAR(lag(), -play, 1e-15);  // a tube at rest keeps its lag
  walk.to(at(1 - play, 0));
  EXPECT_NEAR(lag(), 0, 1e-12);
  walk.to(at(-1, 0));
  EXPECT_NEAR(lag(), play, 1e-15);
  const auto closed = walk.remembered<BacklashRotation>();
  walk.to(at(0, 0)).to(at(-1.5, 0)).to(at(-1, 0)).to(at(-1.5, 0)).to(at(-1, 0));
  const auto loop = walk.remembered<BacklashRotation>();
  walk.to(at(-1.5, 0)).to(at(-1, 0));
  EXPECT_EQ(walk.remembered<BacklashRotation>(), loop);  // a closed loop closes
  EXPECT_NEAR(loop[0], -closed[0], 1e-15);
  EXPECT_EQ(walk.remembered<BacklashTranslation>()[0], 0);
  walk.to(at(-1, 0, -0.34)).to(at(-1, 0, -0.34 - gap / 2));
  EXPECT_NEAR(walk.remembered<BacklashTranslation>()[0], -gap / 2, 1e-15);
}

TEST(Backlash, DoesNotDependOnHowAMoveIsDivided) {
  Catalogue::On<2> effects;
  effect<BacklashRotation, 2>(effects).values = {0.3, 0.1};
  Walk<2> once(two_tubes(), effects), divided = once;
  once.to(at(0, 0)).to(at(1, 0.05)).to(at(0.8, -0.2));
  divided.to(at(0, 0)).to(at(1, 0.05));
  for (int k = 1; k <= 9; ++k) divided.to(at(1 - 0.2 * k / 9, 0.05 - 0.25 * k / 9));
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_NEAR(divided.remembered<BacklashRotation>()[i], once.remembered<BacklashRotation>()[i], 1e-14);
}

TEST(Backlash, MovesTheTubes) {
  Catalogue::On<2> effects;
  effect<BacklashRotation, 2>(effects).values = {0.02, 0.03};
  const Solution<2> s = Walk<2>(two_tubes(), effects).to(at(-1, 2)).to(at(0.5, 0.4)).solution();
  const Solution<2> expected = Walk<2>(two_tubes()).to(at(0.5 - 0.02, 0.4 + 0.03)).solution();
  EXPECT_LE((s.position - expected.position).norm(), 1e-12);
}

TEST(Delay, IsThePoseOfAWhileAgo) {
  Catalogue::On<2> effects;
  const auto pose = [&](double delay, double spread) {
    effect<Delay, 2>(effects).values = {delay, spread};
    return Walk<2>(two_tubes(), effects)
        .to(at(0, 0), 10)
        .to(at(0.4, -0.2, -0.34), 12)
        .to(at(0.6, 0.2, -0.34), 13)
        .solution();
  };
  for (const auto& [delay, q] : {std::pair(0.0, at(0.6, 0.2, -0.34)),
                                 {0.25, at(0.55, 0.1, -0.34)},
                                 {1.0, at(0.4, -0.2, -0.34)},
                                 {2.0, at(0.2, -0.1, -0.345)}}) {
    const Solution<2> expected = Walk<2>(two_tubes()).to(q).solution();
    EXPECT_LE((pose(delay, 0).position - expected.position).norm(), 1e-11) << delay;
  }
  // The mean of 0.5 and 1.5 s ago.
  const Solution<2> expected = Walk<2>(two_tubes()).to(at(0.4, -0.075, -0.34125)).solution();
  EXPECT_LE((pose(1.0, 0.5).position - expected.position).norm(), 1e-11);
}

TEST(Delay, VanishesAtRestAndWhereAClockStartsAnew) {
  Catalogue::On<2> effects;
  effect<Delay, 2>(effects).values = {0.3, 0.4};
  const auto lag = [](const Walk<2>& walk) { return walk.remembered<Delay>(); };
  const std::array<double, 4> none{};
  Walk<2> walk(two_tubes(), effects);
  EXPECT_EQ(lag(walk.to(at(0, 0), 0)), none);
  EXPECT_NE(lag(walk.to(at(1, 0), 1)), none);
  EXPECT_EQ(lag(walk.to(at(1, 0), 2)), none);
  EXPECT_EQ(lag(walk.to(at(2, 0), 0)), none);
  // The mean of 0.18 s ago and of 0.42 s ago, before the run began.
  EXPECT_NEAR(lag(walk.to(at(2.2, 0), 0.4))[2], 0.5 * (2 - 2.2) + 0.5 * (2.11 - 2.2), 1e-12);
  EXPECT_EQ(lag(walk.to(at(3, 0), std::numeric_limits<double>::quiet_NaN())), none);  // without times there is none
}

TEST(Creep, IsALessCurvedTube) {
  Catalogue::On<2> effects;
  effect<Creep, 2>(effects).values = {0.3, -0.1, 40};
  const auto pose = [&](std::initializer_list<double> times) {
    Walk<2> walk(two_tubes(), effects);
    for (const double time : times) walk.to(at(0.4, -0.2, -0.34), time);
    return walk.solution().position;
  };
  for (const double t : {0.0, 10.0, 40.0, 1000.0}) {
    Robot<2> robot = two_tubes();
    robot.tubes[0].curvature *= 1 - 0.3 * t / (t + 40);
    robot.tubes[1].curvature *= 1 + 0.1 * t / (t + 40);
    const Vec3 expected = Walk<2>(robot).to(at(0.4, -0.2, -0.34)).solution().position;
    EXPECT_LE((pose({5, 5 + t}) - expected).norm(), 1e-11) << t;
    EXPECT_LE((pose({5, 5 + t / 3, 5 + t}) - expected).norm(), 1e-11) << t;  // however the time is divided
    EXPECT_LE((pose({5, 5 + t, 0}) - expected).norm(), 1e-11) << t;          // a clock that starts anew adds none
  }
  const Vec3 fresh = Walk<2>(two_tubes()).to(at(0.4, -0.2, -0.34)).solution().position;
  EXPECT_LE((pose({0, std::numeric_limits<double>::quiet_NaN()}) - fresh).norm(), 1e-11);  // no times
}

}  // namespace history_test
}  // namespace ctcr
