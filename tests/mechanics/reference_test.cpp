// Poses that other methods found (energy minimisation without shooting or Runge-Kutta): the model must find them, too.
#include <gtest/gtest.h>

#include "ctcr/mechanics/all_equilibria.hpp"
#include "support/laws.hpp"
#include "support/reference_poses.hpp"

namespace ctcr {
namespace reference_test {

namespace fs = std::filesystem;

struct Errors {
  double position = 0, rotation = 0;  ///< largest seen [m], [rad]
  int poses = 0;
};

template <int N>
Errors errors_of(const Robot<N>& robot, const std::vector<test::Row>& rows, int steps) {
  Errors worst;
  for (const test::Row& row : rows) {
    Joints<N> q;
    for (int i = 0; i < N; ++i) {
      q.beta[i] = row.at("beta" + std::to_string(i + 1) + "_m");
      q.alpha[i] = row.at("alpha" + std::to_string(i + 1) + "_rad");
    }
    TipLoad load{.force = {row.at("fx_N"), row.at("fy_N"), row.at("fz_N")}};
    if (row.contains("mx_Nm")) load.moment = {row.at("mx_Nm"), row.at("my_Nm"), row.at("mz_Nm")};
    const Eigen::Quaterniond rotation(row.at("qw"), row.at("qx"), row.at("qy"), row.at("qz"));
    const Pose expected{rotation.normalized().toRotationMatrix(), {row.at("x_m"), row.at("y_m"), row.at("z_m")}};
    const Solution<N> plain = test::solved<Derivatives::none>(robot, q, load, steps);
    const Solution<N> full = test::solved<Derivatives::compliance>(robot, q, load, steps);
    for (Solution<N> solution : {plain, full}) {
      EXPECT_EQ(solution.status, Status::ok);
      const auto off_by = [&](const Solution<N>& s) { return (s.position - expected.position).norm(); };
      if (off_by(solution) > 1e-3)  // another equilibrium: the reference must be among those where the robot may rest
        for (const auto& other : all_equilibria(Model<N>(robot), q, load, {.steps = steps, .accuracy = test::as_told}))
          if (off_by(other.solution) < off_by(solution)) solution = other.solution;
      const Vec6 off = test::difference(expected, solution.pose());
      worst.position = std::max(worst.position, off.head<3>().norm());
      worst.rotation = std::max(worst.rotation, off.tail<3>().norm());
    }
    ++worst.poses;
  }
  return worst;
}

Errors errors_of(const fs::path& robot_file, const fs::path& table, int steps) {
  const test::RobotFile file(robot_file);
  const std::vector<test::Row> rows = test::read_table(table);
  switch (file.tubes.size()) {
    case 1: return errors_of(file.robot<1>(), rows, steps);
    case 2: return errors_of(file.robot<2>(), rows, steps);
    case 3: return errors_of(file.robot<3>(), rows, steps);
    case 4: return errors_of(file.robot<4>(), rows, steps);
    default: ADD_FAILURE() << robot_file << ": " << file.tubes.size() << " tubes"; return {};
  }
}

/// @param usual_limit  tip error allowed to one step per segment [m]
void expect_reference(const fs::path& robot_file, const fs::path& table, double usual_limit) {
  SCOPED_TRACE(table);
  const Errors fine = errors_of(robot_file, table, 16), usual = errors_of(robot_file, table, 1);
  EXPECT_GT(fine.poses, 0);
  EXPECT_LT(fine.position, 5e-6);
  EXPECT_LT(fine.rotation, 1e-4);
  EXPECT_LT(usual.position, usual_limit);
}

TEST(Reference, OwnPoses) {
  int tables = 0;
  for (const auto& folder : fs::directory_iterator(test::reference_folder()))
    for (const char* table : {"poses.csv", "moment_poses.csv"})
      if (fs::exists(folder.path() / table)) {
        // Loads that bend these tubes strongly: more than one step per segment is meant for.
        expect_reference(folder.path() / "robot.yaml", folder.path() / table, 1e-3);
        ++tables;
      }
  EXPECT_GE(tables, 4) << "run from the project's folder";
}

TEST(Reference, SharedPoses) {
  const fs::path shared = test::shared_reference_folder();
  if (!fs::exists(shared)) GTEST_SKIP() << shared << " is absent; CTCR_SHARED_REFERENCE can name it";
  for (const std::string robot : {"table2", "robot_b"})
    expect_reference(shared / (robot + ".yaml"), shared / (robot + "_poses.csv"), 2e-4);
}

}  // namespace reference_test
}  // namespace ctcr
