#pragma once
// The five rows of the paper's Table I, and what is needed to run each on ours and on the rival.
#include <array>
#include <vector>

#include "configurations.hpp"
#include "fine_model.hpp"
#include "rival.hpp"

namespace bench {

inline constexpr int n_configurations = 1000;

template <bool Loaded_, ctcr::Derivatives D>
struct Case {
  static constexpr bool loaded = Loaded_;
  static constexpr ctcr::Derivatives derivatives = D;
  static constexpr rival::Outputs rival_outputs = rival::Outputs(int(D));
  static constexpr const char* name = D == ctcr::Derivatives::none ? (loaded ? "loaded" : "unloaded")
                                      : D == ctcr::Derivatives::jacobian
                                          ? (loaded ? "loaded_jacobian" : "unloaded_jacobian")
                                          : "loaded_jacobian_compliance";
};

/// Calls f(Case{}) for each row.
template <class F>
void for_each_case(F&& f) {
  using enum ctcr::Derivatives;
  f(Case<false, none>{});
  f(Case<false, jacobian>{});
  f(Case<true, none>{});
  f(Case<true, jacobian>{});
  f(Case<true, compliance>{});
}

/// 1000 random configurations of the Table II robot, and ours converged on each.
template <bool Loaded>
struct Solved {
  ctcr::Robot<3> robot = table_ii();
  ctcr::Model<3> model{robot};
  std::vector<Configuration> configurations = random_configurations(robot, Loaded, n_configurations);
  std::vector<ctcr::Workspace<3>> workspaces{n_configurations};  // warm start: the solution
  std::vector<ctcr::Solution<3>> solutions{n_configurations};
  bool all_solved = true;

  Solved() {
    for (std::size_t i = 0; i < n_configurations; ++i) {
      const auto& [joints, load] = configurations[i];
      const ctcr::Status status =
          ctcr::solve<ctcr::Derivatives::none>(model, joints, load, workspaces[i], solutions[i], {});
      all_solved = all_solved && status == ctcr::Status::ok;
    }
  }

  static const Solved& instance() {
    static const Solved solved;
    return solved;
  }
};

/// Whether J and C of a step agree with differences of the fine model on some of the configurations: a step that is
/// fast and wrong must not be timed.
template <class Case>
bool derivatives_are_right() {
  const auto& solved = Solved<Case::loaded>::instance();
  for (std::size_t i = 0; i < 30; ++i) {
    const Configuration& c = solved.configurations[i];
    const FineModel fine(solved.robot, c);
    if (!fine.differentiable) continue;
    auto workspace = solved.workspaces[i];
    ctcr::Solution<3> s;
    if (ctcr::step<Case::derivatives>(solved.model, c.joints, c.load, workspace, s, {}) != ctcr::Status::ok)
      return false;
    const double length = solved.robot.tubes[0].length + c.joints.beta[0];
    constexpr double tolerance = 5e-3;  // integration error of one step per segment: 3e-3 at most
    if (Case::derivatives != ctcr::Derivatives::none &&
        !(relative_error(s.jacobian, fine.jacobian, length) < tolerance))
      return false;
    if (Case::derivatives == ctcr::Derivatives::compliance &&
        !(relative_error(s.compliance, fine.compliance, length) < tolerance))
      return false;
  }
  return true;
}

/// The rival converged on those of the same configurations where its unguarded Gauss-Newton finds, from zero, the
/// equilibrium that ours found (tips within 1 mm).
template <bool Loaded>
struct RivalSolved {
  using Rival = rival::Rival<3, Loaded>;
  Rival rival{Solved<Loaded>::instance().robot};
  std::vector<Configuration> configurations;
  std::vector<typename Rival::Unknowns> unknowns;

  RivalSolved() {
    const auto& ours = Solved<Loaded>::instance();
    for (std::size_t i = 0; i < n_configurations; ++i) {
      const auto& [joints, load] = ours.configurations[i];
      typename Rival::Unknowns guess = Rival::Unknowns::Zero();
      typename Rival::Solution solution;
      if (!rival.solve(joints, load, guess, solution)) continue;
      if ((solution.position - ours.solutions[i].position).norm() > 1e-3) continue;
      configurations.push_back(ours.configurations[i]);
      unknowns.push_back(guess);
    }
  }

  /// False when the two disagree on more than 3 % of the configurations: then one of them is wrong.
  [[nodiscard]] bool agrees() const noexcept { return int(configurations.size()) >= n_configurations * 97 / 100; }

  static const RivalSolved& instance() {
    static const RivalSolved solved;
    return solved;
  }
};

}  // namespace bench
