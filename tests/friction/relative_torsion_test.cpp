#include "ctcr/friction/relative_torsion.hpp"

#include <gtest/gtest.h>

#include "ctcr/friction/path_solver.hpp"
#include "support/walk.hpp"

namespace ctcr {
namespace relative_torsion_test {

using test::effect, test::Random;

/// Against central differences, by the friction at each contact and by parameters of all kinds.
TEST(RelativeTorsion, Derivatives) {
  using P = SystemParameters<3, Catalogue>;
  using V = ParameterVector<3>;
  Random random(3);
  int solved = 0;
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
                                      {.tolerance = 1e-12, .steps = 3, .accuracy = test::as_told}};
    const RecordedRow<3> row{motor_angles(system.transmission, c.q), c.load, {}};
    Workspace<3> ws;
    RecordedPrediction<3, Catalogue> prediction;
    if (predict(system, row, system.model.effects().history(), ws, prediction) != Status::ok)
      continue;  // effects may have it snap
    ++solved;
    const auto torsion = [&](const System<3, Catalogue>& now) {
      EXPECT_EQ(predict(now, row, now.model.effects().history(), ws, prediction), Status::ok);
      return relative_torsion(prediction.model, ws, {});
    };
    std::vector<int> parameters{V::index(Parameter::curvature, 0),   V::index(Parameter::youngs_modulus, 1),
                                V::index(Parameter::length, 1),      V::index(Parameter::gravity, 0),
                                V::index(Parameter::rotation_ratio), V::index(Parameter::home_rotation, 1)};
    const std::size_t first_of_friction = parameters.size();
    for (int k = 0; k < Friction<3>::count; ++k) parameters.push_back(V::count + k);
    detail::Variables<3, Catalogue> variables;
    for (int j = 0; j < int(parameters.size()); ++j)
      variables.put(first_variable<3> + j, j, parameters[std::size_t(j)]);
    const auto derivatives = detail::torsion_derivatives(system, row, prediction, ws, variables);
    const auto by_friction_alone = torsion_derivatives(prediction.model, ws);
    EXPECT_LT((derivatives.by_friction - by_friction_alone.by_friction).norm(), 1e-10);
    const auto check = [&](const auto& column, double change, double tolerance, const auto& moved) {
      const auto more = torsion(moved(change)), less = torsion(moved(-change));
      for (int i = 0; i < Contacts<3>::count; ++i)
        EXPECT_NEAR(column[i], wrapped(more[std::size_t(i)] - less[std::size_t(i)]) / (2 * change), tolerance)
            << n << ": contact " << i;
    };
    for (int k = 0; k < Contacts<3>::count; ++k)
      check(derivatives.by_friction.col(k), 1e-4, 1e-6, [&](double by) {
        auto other = effects;
        effect<Friction, 3>(other).history.state[std::size_t(k)] += by;
        System<3, Catalogue> moved = system;
        moved.model = Model<3, Catalogue>(c.robot, other);
        return moved;
      });
    for (std::size_t j = 0; j < parameters.size(); ++j) {
      const Eigen::VectorXd x = P::values(system);
      const bool is_friction = j >= first_of_friction;
      const double size = is_friction ? 1.0 : std::max(0.05, std::abs(x[parameters[j]])), change = 1e-5 * size;
      check(derivatives.by_variables.col(Eigen::Index(j)), change, 1e-4 / size, [&](double by) {
        Eigen::VectorXd there = x;
        there[parameters[j]] += by;
        return P::with_values(system, there);
      });
      if (!is_friction) {
        EXPECT_GT(derivatives.by_variables.col(Eigen::Index(j)).norm() * size, 1e-5) << P::name(parameters[j]);
      }
    }
    EXPECT_GT(derivatives.by_friction.norm(), 1e-3);
    EXPECT_GT(derivatives.by_variables.rightCols<Friction<3>::count>().norm(), 1e-2);
  }
  EXPECT_GT(solved, test::cases(5) / 2);
}

}  // namespace relative_torsion_test
}  // namespace ctcr
