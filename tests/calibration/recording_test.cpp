#include "ctcr/calibration/identification/recording.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "ctcr/calibration/identification/identify_with_exclusions.hpp"
#include "ctcr/mechanics/all_equilibria.hpp"
#include "support/catalogue_cases.hpp"
#include "support/random_robots.hpp"
#include "support/solver.hpp"

namespace recording_test {

using namespace ctcr;
using P = ParameterVector<2>;

constexpr Noise noise{.position_jitter = 5e-5, .rotation_jitter = 5e-4, .position_field = 2e-4, .rotation_field = 2e-3};

/// Two tubes of the paper's robot, the tracker anywhere.
System<2> bench() {
  Robot<2> robot;
  for (std::size_t i = 0; i < 2; ++i) robot.tubes[i] = test::paper_robot().tubes[i];
  const Transmission<2> transmission{3e-4, -0.5, VecN<2>(-0.3, -0.22), VecN<2>(0.1, -0.2)};
  return {transmission, Model<2>(robot), {{rotation_matrix(Vec3(2, 0.3, -0.4)), Vec3(-0.05, 0.01, 0.02)}, 0}, {}};
}

/// The system with one parameter increased.
System<2> changed(const System<2>& system, int index, double by) {
  Eigen::VectorXd x = SystemParameters<2, EffectList<>>::values(system);
  x[index] += by;
  return SystemParameters<2, EffectList<>>::with_values(system, x);
}

struct Table {
  std::vector<RecordedRow<2>> rows;
  std::vector<Pose> measured;
};

/// A path through joint space, and what a system reads along it.
Table path(const System<2>& nominal, const System<2>& truth, int rows, test::Random& random, double max_force = 0.1) {
  Table table;
  Workspace<2> ws;
  Prediction<2> prediction;
  const auto anywhere = [&] {
    return Joints<2>{VecN<2>(test::uniform(random, -0.3, -0.26), test::uniform(random, -0.24, -0.2)),
                     VecN<2>(test::uniform(random, -3, 3), test::uniform(random, -3, 3))};
  };
  Joints<2> q = anywhere(), next = anywhere();
  for (int step = 0; int(table.rows.size()) < rows; ++step) {
    const double part = double(step % 8) / 8;
    if (part == 0) q = std::exchange(next, anywhere());
    const Joints<2> here{q.beta + part * (next.beta - q.beta), q.alpha + part * (next.alpha - q.alpha)};
    const RecordedRow<2> row{
        motor_angles(nominal.transmission, here), {.force = test::random_vector(random, max_force)}, {}};
    ws.reset();
    const Status status = predict(truth, row.theta, row.load, ws, prediction);
    if (status != Status::ok || prediction.solution.stability < 0.1) continue;  // about to snap
    table.rows.push_back(row);
    table.measured.push_back(prediction.reading);
  }
  return table;
}

Eigen::MatrixX3d places(const Table& table) {
  Eigen::MatrixX3d places(Eigen::Index(table.measured.size()), 3);
  for (std::size_t i = 0; i < table.measured.size(); ++i) places.row(Eigen::Index(i)) = table.measured[i].position;
  return places;
}

void add_noise(Table& table, const Noise& n, test::Random& random) {
  std::normal_distribution<double> normal;
  const auto rows = Eigen::Index(table.rows.size());
  const Eigen::MatrixXd factor = smooth_field(places(table), n.correlation_length, 1e-6).factor;
  Eigen::MatrixXd cause(factor.cols(), 6);
  for (double& c : cause.reshaped()) c = normal(random);
  const Eigen::MatrixXd smooth = factor * cause;
  for (Eigen::Index i = 0; i < rows; ++i) {
    Pose& pose = table.measured[std::size_t(i)];
    Vec6 e;
    for (int a = 0; a < 6; ++a)
      e[a] = (a < 3 ? n.position_field : n.rotation_field) * smooth(i, a) +
             (a < 3 ? n.position_jitter : n.rotation_jitter) * normal(random);
    pose.position += e.head<3>();
    pose.rotation = rotation_matrix(e.tail<3>()) * pose.rotation;
  }
}

/// What a calibration usually frees, and how uncertain it is before.
struct Free {
  std::vector<int> index;
  std::vector<FreeParameter> parameters;
};
Free free_parameters(const Eigen::VectorXd& nominal_values, const std::vector<int>& index) {
  Free out{index, {}};
  for (std::size_t k = 0; k < index.size(); ++k) {
    const auto [kind, i] = P::entry(index[k]);
    const double value = nominal_values[Eigen::Index(k)];
    const double sd = kind == Parameter::youngs_modulus                                         ? 0.1 * value
                      : kind == Parameter::curvature                                            ? 0.05 * value
                      : kind == Parameter::home_rotation || kind == Parameter::tracker_rotation ? 0.02
                      : kind == Parameter::translation_ratio || kind == Parameter::rotation_ratio
                          ? 1e-3 * std::abs(value)
                          : 1e-3;
    out.parameters.push_back({std::string(std::string_view(P::name(index[k]))), value, sd});
  }
  return out;
}
std::vector<int> usual_parameters() {
  std::vector<int> index;
  for (const Parameter kind :
       {Parameter::youngs_modulus, Parameter::length, Parameter::curved_length, Parameter::curvature,
        Parameter::home_translation, Parameter::home_rotation, Parameter::tracker_position, Parameter::tracker_rotation,
        Parameter::sensor_position, Parameter::sensor_rotation})
    for (int i = 0; i < P::size(kind); ++i) index.push_back(P::index(kind, i));
  return index;
}

TEST(Recording, IsZeroAtTheSystemThatMadeIt) {
  test::Random random(1);
  ThreadPool pool(1);
  const Table table = path(bench(), bench(), 20, random);
  Recording<2> readings(bench(), table.rows, table.measured, usual_parameters(), pool);
  Eigen::VectorXd residual;
  ASSERT_TRUE(readings(readings.nominal(), residual, nullptr));
  EXPECT_LE(residual.cwiseAbs().maxCoeff(), 1e-8);
}

TEST(Recording, HasTheSlopesOfItsDifferences) {
  test::Random random(2);
  ThreadPool pool(1);
  std::vector<int> all(P::count);
  std::iota(all.begin(), all.end(), 0);
  const Table table = path(bench(), bench(), 9, random);
  Recording<2> readings(bench(), table.rows, table.measured, all, pool);
  Eigen::VectorXd x = readings.nominal();
  x.segment<3>(P::index(Parameter::tracker_rotation)) << 0.3, -0.2, 0.5;  // turns that are not small
  x.segment<3>(P::index(Parameter::sensor_rotation)) << -0.4, 0.6, 0.2;
  x[P::index(Parameter::length)] += 1e-3;
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
  ASSERT_TRUE(readings(x, residual, &jacobian));
  for (int k = 0; k < P::count; ++k) {
    const ParameterKind& kind = P::info(P::entry(k).kind);
    if (P::entry(k).kind == Parameter::bending_stiffness) continue;  // replaced by the modulus
    const double size = kind.unit == "m/rad" ? 1e-3 : kind.unit == "m" ? 1e-2 : kind.low > 0 ? kind.low : 1.0;
    const double h = 1e-5 * size;
    Eigen::VectorXd plus, minus, at = x;
    at[k] = x[k] + h;
    ASSERT_TRUE(readings(at, plus, nullptr));
    at[k] = x[k] - h;
    ASSERT_TRUE(readings(at, minus, nullptr));
    const Eigen::VectorXd slope = (plus - minus) / (2 * h);
    EXPECT_LE((jacobian.col(k) - slope).norm(), 1e-4 * (slope.norm() + 1e-2 / size)) << kind.name;
  }
}

TEST(Recording, GivesTheSameByTheGeneralPath) {
  test::Random random(7);
  ThreadPool pool(1);
  std::vector<int> all(P::count);
  std::iota(all.begin(), all.end(), 0);
  for (const Vec3& gravity : {Vec3(0, 0, 0), Vec3(1, -9, 3)}) {
    System<2> system = bench();
    Robot<2> robot = system.model.robot();
    robot.gravity = gravity;
    system.model = Model<2>(robot);
    system.settings = {.tolerance = 1e-12, .steps = 8, .accuracy = test::as_told};
    const System<2, Catalogue> general{system.transmission, Model<2, Catalogue>(robot, test::hardly_any_effects<2>()),
                                       system.sensor, system.settings};
    const Table table = path(system, changed(system, P::index(Parameter::length), 1e-3), 9, random);
    Recording<2> fast(system, table.rows, table.measured, all, pool);
    Recording<2, Catalogue> slow(general, table.rows, table.measured, all, pool);
    Eigen::VectorXd residual[2];
    Eigen::MatrixXd jacobian[2];
    ASSERT_TRUE(fast(fast.nominal(), residual[0], &jacobian[0]));
    ASSERT_TRUE(slow(slow.nominal(), residual[1], &jacobian[1]));
    EXPECT_LE((residual[0] - residual[1]).cwiseAbs().maxCoeff(), 1e-8);
    for (int k = 0; k < P::count; ++k)
      EXPECT_LE((jacobian[0].col(k) - jacobian[1].col(k)).norm(), 1e-4 * jacobian[1].col(k).norm())
          << std::string_view(P::name(k));
  }
}

TEST(Recording, DoesNotDependOnTheThreads) {
  test::Random random(3);
  const auto table = path(bench(), bench(), 150, random);
  Eigen::VectorXd residual[2];
  Eigen::MatrixXd jacobian[2];
  for (int k = 0; k < 2; ++k) {
    ThreadPool pool(1 + 2 * k);
    Recording<2> readings(bench(), table.rows, table.measured, usual_parameters(), pool);
    Eigen::VectorXd x = readings.nominal();
    ASSERT_TRUE(readings(x, residual[k], nullptr));
    x[0] *= 1.05;
    ASSERT_TRUE(readings(x, residual[k], &jacobian[k]));
  }
  EXPECT_EQ(residual[0], residual[1]);
  EXPECT_EQ(jacobian[0], jacobian[1]);
}

/// Two tubes, curved from end to end and opposed so that they rest in two mirror images, with the robot's frame for the
/// tracker's.
struct Bistable {
  explicit Bistable(test::Random& random)
    : system{Transmission<2>{1, 1, VecN<2>::Zero(), VecN<2>::Zero()}, Model<2>(drawn(random)), {{}, 0}, {}},
      row{turned(0)},
      rests(all_equilibria(system.model, joints(system.transmission, row.theta), {})) {}

  /// The row with tube 2 turned.
  [[nodiscard]] RecordedRow<2> turned(double angle) const {
    return {motor_angles(system.transmission, Joints<2>{{0, 0}, {0, std::numbers::pi + angle}}), {}, {}};
  }
  [[nodiscard]] Pose reading(const RecordedRow<2>& at, Workspace<2>& ws) const {
    Prediction<2> prediction;
    EXPECT_EQ(predict(system, at.theta, at.load, ws, prediction), Status::ok);
    return prediction.reading;
  }

  System<2> system;
  RecordedRow<2> row;
  std::vector<Equilibrium<2>> rests;

private:
  static Robot<2> drawn(test::Random& random) {
    Robot<2> robot = test::random_robot<2>(random);
    const double length = test::uniform(random, 0.1, 0.2);
    for (Tube& tube : robot.tubes) {
      tube.length = tube.curved_length = length;
      tube.curvature = std::numbers::pi / 2 * test::uniform(random, 1.3, 2) / length;
    }
    return robot;
  }
};

// Where a robot may rest in two equilibria, each row stays in that of its reading, also after a trial that snapped to the
// other; and a recording that takes over from one which knew it begins there.
TEST(Recording, StaysInTheEquilibriumThatWasRead) {
  test::Random random(8);
  ThreadPool pool(1);
  for (int k = 0; k < test::cases(20); ++k) {
    const Bistable robot(random);
    ASSERT_EQ(robot.rests.size(), 2u) << k;
    int unknown = 0, snapped = 0;
    for (const Equilibrium<2>& rest : robot.rests) {
      Workspace<2> ws = rest.workspace;
      const Pose read = robot.reading(robot.row, ws);
      const auto recording = [&] {
        return Recording<2>(robot.system, {robot.row}, {read}, {P::index(Parameter::home_rotation, 1)}, pool);
      };
      const auto missed = [&](Recording<2>& readings, double turn) {
        Eigen::VectorXd residual;
        EXPECT_TRUE(readings(Eigen::VectorXd::Constant(1, turn), residual, nullptr)) << k;
        return residual.norm();
      };
      Recording<2> cold = recording(), knowing = recording(), taught = recording();
      unknown += missed(cold, 0) > 0.01;
      knowing.begin_in({{rest.workspace, 1.0}});
      for (const double turn : {2.5, -2.5}) {
        EXPECT_GT(missed(knowing, turn), 0.01) << k;
        EXPECT_LT(missed(knowing, 0), 1e-4) << k;
        ws = rest.workspace;
        (void)robot.reading(robot.turned(turn), ws);
        snapped += residual(robot.reading(robot.row, ws), read).norm() > 0.01;
      }
      taught.begin_in(knowing.equilibria());
      EXPECT_LT(missed(taught, 0), 1e-4) << k;
    }
    EXPECT_EQ(unknown, 1) << k;  // a solve that knows nothing ends in one of them, whatever was read
    EXPECT_GE(snapped, 1) << k;  // a robot that is turned so far and back need not come back
  }
}

// While the parameters move, each row follows the branch of its reading, as the robot itself would, however much more it
// misses there. What is known of that branch is not checked anew: the answers are those of solves that do, up to the error
// of integration that both may make.
TEST(Recording, FollowsTheBranchThatWasRead) {
  test::Random random(9);
  ThreadPool pool(1);
  int followed = 0;
  for (int k = 0; k < test::cases(20); ++k) {
    const Bistable robot(random);
    for (const Equilibrium<2>& rest : robot.rests) {
      Workspace<2> ws = rest.workspace;
      const Pose read = robot.reading(robot.row, ws);
      Recording<2> readings(robot.system, {robot.row}, {read}, {P::index(Parameter::home_rotation, 1)}, pool);
      readings.begin_in({{rest.workspace, 1.0}});
      Prediction<2> there;
      for (double turn = 0.02; turn < 0.6; turn += 0.02) {
        const RecordedRow<2> row = robot.turned(turn);
        if (predict(robot.system, row.theta, row.load, ws, there) != Status::ok || !there.solution.kept_branch) break;
        Workspace<2> anew;
        anew.begin_at(ws.guess);
        Eigen::VectorXd residual;
        ASSERT_TRUE(readings(Eigen::VectorXd::Constant(1, turn), residual, nullptr)) << k;
        EXPECT_LT((residual - ctcr::residual(read, robot.reading(row, anew))).norm(), 5e-4) << k << ": " << turn;
        ++followed;
      }
    }
  }
  EXPECT_GT(followed, 100 * test::cases(20) / 20);
}

TEST(Recording, TellsWhichRowsCannotBeSolvedAndLeavesOutWhatIsAsked) {
  test::Random random(4);
  auto table = path(bench(), bench(), 6, random);
  table.rows[2].theta = motor_angles(bench().transmission, {VecN<2>(0.01, -0.2), VecN<2>(0, 0)});  // before the plate
  table.measured[3].position.setConstant(std::nan(""));                                            // not measured
  ThreadPool pool(1);
  Recording<2> readings(bench(), table.rows, table.measured, usual_parameters(), pool);
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
  EXPECT_FALSE(readings(readings.nominal(), residual, &jacobian));
  EXPECT_EQ(readings.unsolved(), std::vector<int>{2});
  EXPECT_TRUE(residual.segment<6>(12).array().isNaN().all());
  EXPECT_TRUE(residual.segment<3>(18).array().isNaN().all());
  EXPECT_TRUE(residual.segment<3>(21).allFinite());
  EXPECT_TRUE(residual.segment<12>(24).allFinite());
  readings.activate({true, true, false, true, true, false});
  EXPECT_TRUE(readings(readings.nominal(), residual, &jacobian));
  EXPECT_TRUE(residual.segment<6>(30).array().isNaN().all());
}

TEST(IdentifyReadings, FindsTheRobotThatWasMeasured) {
  constexpr int seeds = 25;
  double distance = 0, chi_square = 0, degrees = 0;
  ThreadPool pool(1);
  const System<2> nominal = bench();
  for (int seed = 0; seed < seeds; ++seed) {
    test::Random random{std::uint64_t(1000 + seed)};
    std::normal_distribution<double> normal;
    Recording<2> any(nominal, {}, {}, usual_parameters(), pool);
    const Free free = free_parameters(any.nominal(), usual_parameters());
    Eigen::VectorXd truth = any.nominal();
    for (Eigen::Index k = 0; k < truth.size(); ++k)
      truth[k] += 0.7 * free.parameters[std::size_t(k)].sd * normal(random);
    auto table = path(nominal, any.system(truth), 48, random);
    add_noise(table, noise, random);
    Recording<2> readings(nominal, table.rows, table.measured, free.index, pool);
    std::vector<int> excluded;
    const Identification fit =
        identify_with_exclusions(readings, free.parameters, noise, places(table), {.starts = 1}, excluded);
    ASSERT_TRUE(fit.converged) << fit.status;
    EXPECT_TRUE(excluded.empty());
    // The truth was drawn from 0.7 of the prior, so it lies a little nearer than the posterior allows.
    const Eigen::VectorXd error = fit.values - truth;
    distance += error.dot(fit.covariance.llt().solve(error));
    chi_square += fit.chi_square;
    degrees += fit.bulk_observations - fit.effective_parameters;
  }
  const double n = double(usual_parameters().size());
  EXPECT_LT(distance / seeds, n + 4 * std::sqrt(2 * n / seeds));
  EXPECT_GT(distance / seeds, 0.6 * n);
  EXPECT_NEAR(chi_square / degrees, 1, 0.05);
}

TEST(IdentifyReadings, NamesTheGaugesOfARobot) {
  test::Random random(5);
  ThreadPool pool(1);
  const System<2> nominal = bench();
  auto table = path(nominal, nominal, 40, random, 0);
  add_noise(table, noise, random);
  Recording<2> readings(nominal, table.rows, table.measured, usual_parameters(), pool);
  const Free free = free_parameters(readings.nominal(), usual_parameters());
  const auto at = [&](Parameter kind, int i) {
    return std::find(free.index.begin(), free.index.end(), P::index(kind, i)) - free.index.begin();
  };
  IdentifyOptions options;
  Eigen::VectorXd yaw = Eigen::VectorXd::Zero(Eigen::Index(free.index.size()));
  const Vec3 axis = nominal.sensor.T_tracker_base.rotation.col(2);
  for (int i = 0; i < 2; ++i) yaw[at(Parameter::home_rotation, i)] = 1;
  for (int i = 0; i < 3; ++i) yaw[at(Parameter::tracker_rotation, i)] = -axis[i];
  options.known.push_back({"yaw", yaw});
  std::vector<int> excluded;
  const Identification fit =
      identify_with_exclusions(readings, free.parameters, noise, places(table), options, excluded);
  ASSERT_FALSE(fit.directions.empty());
  EXPECT_EQ(fit.directions[0].text.substr(0, 4), "yaw ");
  EXPECT_NEAR(fit.directions[0].ratio, 1, 1e-3);
}

TEST(IdentifyReadings, LeavesOutRowsThatStandInTheWay) {
  test::Random random(6);
  ThreadPool pool(1);
  const System<2> nominal = bench();
  auto table = path(nominal, changed(nominal, P::index(Parameter::home_translation, 1), 1e-3), 40, random);
  add_noise(table, {.position_jitter = 5e-5, .rotation_jitter = 5e-4}, random);
  const auto record = [&](std::size_t row, const VecN<2>& beta) {
    table.rows[row].theta.translation = motor_angles(nominal.transmission, {beta, VecN<2>(0, 0)}).translation;
  };
  // At the plate as recorded; the true home puts it behind, which the nominal one allows by far less than the fit finds.
  record(7, {joints(nominal.transmission, table.rows[7].theta).beta[0], -2e-4});
  record(9, {0.02, 0.01});
  const std::vector<int> homes{P::index(Parameter::home_translation, 0), P::index(Parameter::home_translation, 1)};
  Recording<2> readings(nominal, table.rows, table.measured, homes, pool);
  const Free free = free_parameters(readings.nominal(), homes);
  std::vector<int> excluded;
  const Identification fit = identify_with_exclusions(readings, free.parameters, noise, places(table), {}, excluded);
  EXPECT_TRUE(fit.converged) << fit.status;
  EXPECT_EQ(excluded, (std::vector<int>{7, 9}));
  EXPECT_NEAR(fit.values[1] - readings.nominal()[1], 1e-3, 4 * fit.sd[1]);
}

TEST(IdentifyReadings, RowsInTheWayOneBehindTheOtherDoNotHoldItUp) {
  test::Random random(6);
  ThreadPool pool(1);
  const System<2> nominal = bench();
  auto table = path(nominal, changed(nominal, P::index(Parameter::home_translation, 1), 1e-3), 60, random);
  add_noise(table, {.position_jitter = 5e-5, .rotation_jitter = 5e-4}, random);
  const std::vector<int> blocking{7, 11, 23, 31, 44};
  for (const int row : blocking) {
    auto& recorded = table.rows[std::size_t(row)];
    const double beta = joints(nominal.transmission, recorded.theta).beta[0];
    recorded.theta.translation =
        motor_angles(nominal.transmission, {VecN<2>(beta, -2e-5 * row), VecN<2>(0, 0)}).translation;
  }
  const std::vector<int> homes{P::index(Parameter::home_translation, 0), P::index(Parameter::home_translation, 1)};
  struct Counted : Recording<2> {
    using Recording<2>::Recording;
    int calls = 0;
    bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) {
      ++calls;
      return Recording<2>::operator()(x, residual, jacobian);
    }
  } readings(nominal, table.rows, table.measured, homes, pool);
  const Free free = free_parameters(readings.nominal(), homes);
  std::vector<int> excluded;
  const Identification fit =
      identify_with_exclusions(readings, free.parameters, noise, places(table), {.starts = 1}, excluded);
  EXPECT_TRUE(fit.converged) << fit.status;
  EXPECT_EQ(excluded, blocking);
  EXPECT_NEAR(fit.values[1] - readings.nominal()[1], 1e-3, 4 * fit.sd[1]);
  EXPECT_LT(readings.calls, 30);
}

}  // namespace recording_test
