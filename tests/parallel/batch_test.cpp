#include "ctcr/parallel/batch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "support/no_alloc.hpp"
#include "support/random_robots.hpp"
#include "support/solver.hpp"

namespace batch_test {

using namespace ctcr;

struct Answer {
  Status status;
  int iterations;
  Vec3 position;
  Mat3 rotation;
  Eigen::Matrix<double, 6, 6> jacobian;
  Mat6 compliance;

  bool operator==(const Answer&) const = default;
};

/// A path with small steps, then configurations anywhere, some of them impossible.
std::vector<Configuration<3>> path_and_random(const Robot<3>& robot, int count) {
  test::Random random(7);
  std::vector<Configuration<3>> result;
  Configuration<3> c{test::random_joints(robot, random), test::random_load(random)};
  for (int i = 0; i < count; ++i) {
    if (i < count / 2) {
      c.joints.alpha.array() += 0.02;
      c.joints.beta.array() -= 1e-5;
    } else {
      c = {test::random_joints(robot, random), i % 2 == 0 ? test::random_load(random) : TipLoad{}};
    }
    result.push_back(c);
    if (i % 17 == 3) result.back().joints.beta[0] = 0.01;
    if (i % 31 == 5) result.back().load.force[1] = std::numeric_limits<double>::quiet_NaN();
  }
  return result;
}

std::vector<Answer> solved(const Model<3>& model, const std::vector<Configuration<3>>& cases, int threads) {
  std::vector<Answer> answers(cases.size());
  ThreadPool pool(threads);
  solve_batch<Derivatives::compliance>(
      model, std::ptrdiff_t(cases.size()), [&](std::ptrdiff_t i) { return cases[std::size_t(i)]; },
      [&](std::ptrdiff_t i, const Solution<3>& s) {
        answers[std::size_t(i)] = {s.status, s.iterations, s.position, s.rotation, s.jacobian, s.compliance};
      },
      pool);
  return answers;
}

/// Bit for bit the same answers for any number of threads.
TEST(Batch, Threads) {
  const Model<3> model(test::paper_robot());
  const auto cases = path_and_random(model.robot(), 700);
  const auto serial = solved(model, cases, 1);
  for (const int threads : {2, 3, 8}) {
    const auto parallel = solved(model, cases, threads);
    for (std::size_t i = 0; i < cases.size(); ++i)
      ASSERT_TRUE(serial[i] == parallel[i]) << threads << " threads, " << i;
  }
}

/// Warm starts lead to the answers of cold ones.
TEST(Batch, ColdStarts) {
  const Model<3> model(test::paper_robot());
  const auto cases = path_and_random(model.robot(), 700);
  const auto answers = solved(model, cases, 2);
  int warm = 0, cold = 0;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    Workspace<3> ws;
    Solution<3> single;
    ASSERT_EQ(solve<Derivatives::compliance>(model, cases[i].joints, cases[i].load, ws, single), answers[i].status);
    ASSERT_LE((single.position - answers[i].position).norm(), 1e-9) << i;
    ASSERT_LE((single.jacobian - answers[i].jacobian).norm(), 1e-7) << i;
    (i < cases.size() / 2 ? warm : cold) += answers[i].iterations < single.iterations;
  }
  EXPECT_GT(warm, 200);  // along the path the warm start must save evaluations
  EXPECT_EQ(cold, 0);    // elsewhere it must not be tried
}

/// They are reported, and the others are solved.
TEST(Batch, BadConfigurations) {
  const Model<3> model(test::paper_robot());
  const auto cases = path_and_random(model.robot(), 200);
  const auto answers = solved(model, cases, 2);
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (i % 17 == 3)
      EXPECT_EQ(answers[i].status, Status::joints_out_of_order);
    else if (i % 31 == 5)
      EXPECT_EQ(answers[i].status, Status::not_finite);
    else
      EXPECT_EQ(answers[i].status, Status::ok) << i;
    EXPECT_TRUE(answers[i].position.allFinite());
  }
}

/// Each is called once, whatever the count.
TEST(Batch, Indices) {
  test::Random random(1);
  const Model<1> model(test::random_robot<1>(random));
  ThreadPool pool(2);
  for (const std::ptrdiff_t count : {0, 1, 63, 64, 65, 1000}) {
    std::vector<int> calls(std::size_t(count) + 1);
    solve_batch(
        model, count, [](std::ptrdiff_t) { return Configuration<1>{}; },
        [&](std::ptrdiff_t i, const Solution<1>&) { ++calls[std::size_t(i)]; }, pool);
    EXPECT_EQ(calls.back(), 0);
    calls.pop_back();
    EXPECT_EQ(calls, std::vector<int>(std::size_t(count), 1));
  }
}

/// It does not grow with the count.
TEST(Batch, Memory) {
  const Model<3> model(test::paper_robot());
  ThreadPool pool(2);
  for (const std::ptrdiff_t count : {10, 1000}) {
    const test::HeapGuard guard;
    solve_batch(
        model, count, [](std::ptrdiff_t) { return Configuration<3>{}; }, [](std::ptrdiff_t, const Solution<3>&) {},
        pool);
    EXPECT_EQ(guard.uses(), 2);  // the workspaces: one allocation, one release
  }
}

}  // namespace batch_test
