// How accurate and how robust the model is, as markdown tables: run it after a change of integrator or solver.
// usage: accuracy [CONFIGURATIONS [COLD_STARTS]]
#include <array>
#include <cstdlib>

#include "ctcr/mechanics/integrators.hpp"
#include "support/configurations.hpp"
#include "support/fine_model.hpp"
#include "support/rival.hpp"
#include "support/study.hpp"

namespace {

using namespace bench;
using ctcr::Derivatives;
using ctcr::Mat6;
using ctcr::Model;
using ctcr::Solution;
using ctcr::Status;
using ctcr::Workspace;
using Robot = ctcr::Robot<3>;
using rival::Outputs;

enum class Designs { table_ii, random };

constexpr Designs all_designs[] = {Designs::table_ii, Designs::random};

std::string name_of(Designs designs) { return designs == Designs::table_ii ? "Table II" : "random"; }

/// Calls f(robot, configuration, random): the Table II robot, or a new random design each time. Same for every study.
template <class F>
void for_each_configuration(Designs designs, bool loaded, int count, F&& f) {
  Random random(11);
  for (int i = 0; i < count; ++i) {
    const Robot robot = designs == Designs::random ? random_design(random) : table_ii();
    const Configuration c = random_configuration(robot, loaded, random);
    f(robot, c, random);
  }
}

/// What a method finds from a cold start.
struct Found {
  bool converged = false;
  ctcr::Vec3 position;
  Mat6 jacobian, compliance;
};

template <class Stepper>
struct Ours {
  Found operator()(const Robot& robot, const Configuration& c) const {
    Workspace<3> workspace;
    Solution<3> s;
    const Model<3> model(robot);
    const bool force = !c.load.force.isZero();
    const Status status = force ? ctcr::solve<Derivatives::compliance, Stepper>(model, c.joints, c.load, workspace, s)
                                : ctcr::solve<Derivatives::jacobian, Stepper>(model, c.joints, c.load, workspace, s);
    return {status == Status::ok, s.position, s.jacobian, s.compliance};
  }
};

struct Rivals {
  Found operator()(const Robot& robot, const Configuration& c) const {
    return c.load.force.isZero() ? solve<false>(robot, c) : solve<true>(robot, c);
  }

private:
  template <bool Loaded>
  static Found solve(const Robot& robot, const Configuration& c) {
    const rival::Rival<3, Loaded> rival(robot);
    auto unknowns = rival::Rival<3, Loaded>::Unknowns::Zero().eval();
    typename rival::Rival<3, Loaded>::Solution s;
    const bool converged = rival.solve(c.joints, c.load, unknowns, s);
    rival.template step<Outputs::compliance>(c.joints, c.load, unknowns, s);
    return {converged, s.position, s.jacobian, s.compliance};
  }
};

struct MethodErrors {
  Errors tip, jacobian, compliance;
  int left_out = 0;
};

/// Errors against the finely integrated model; tips over deployed length. Left out: not converged, or another
/// equilibrium than the fine model's (tips more than 2 % of the length apart).
template <class Method>
MethodErrors method_errors(Designs designs, bool loaded, int count, const Method& method) {
  MethodErrors errors;
  for_each_configuration(designs, loaded, count, [&](const Robot& robot, const Configuration& c, Random&) {
    const Found found = method(robot, c);
    const double L = robot.tubes[0].length + c.joints.beta[0];
    const FineModel fine(robot, c);
    if (!found.converged || !fine.converged || (found.position - fine.position).norm() > 0.02 * L) {
      ++errors.left_out;
      return;
    }
    errors.tip.add((found.position - fine.position).norm() / L);
    if (!fine.differentiable) return;
    errors.jacobian.add(relative_error(found.jacobian, fine.jacobian, L));
    if (loaded) errors.compliance.add(relative_error(found.compliance, fine.compliance, L));
  });
  return errors;
}

template <class Method>
void study_method(const char* name, int count, const Method& method) {
  for (const bool loaded : {false, true})
    for (const Designs designs : all_designs) {
      const MethodErrors e = method_errors(designs, loaded, count, method);
      print_row({name, loaded ? "loaded" : "unloaded", name_of(designs), text(e.tip.mean()), text(e.tip.max),
                 text(e.jacobian.mean()), text(e.jacobian.max), loaded ? text(e.compliance.mean()) : "",
                 loaded ? text(e.compliance.max) : "", std::to_string(e.left_out)});
    }
}

void study_methods(int count) {
  print_header(
      "Steps as the default takes them, one per segment for the others, against 64: tip over length, J and C against "
      "differences of the fine model",
      {"method", "load", "designs", "tip mean", "max", "J mean", "max", "C mean", "max", "left out"});
  study_method("default", count, Ours<ctcr::MagnusRk4>{});
  study_method("SSPRK3", count, Ours<ctcr::SspRk3>{});
  study_method("RK4", count, Ours<ctcr::ClassicalRk4>{});
  study_method("RK8(7)13M", count, Ours<ctcr::PrinceDormand8>{});
  study_method("rival", count, Rivals{});
}

void study_cold_starts(int count) {
  print_header("Cold starts", {"designs", "load", "starts", "ok", "not converged", "singular", "other", "evaluations",
                               "farthest tip over length"});
  for (const Designs designs : all_designs)
    for (const bool loaded : {false, true}) {
      std::array<int, 6> by_status{};
      double evaluations = 0, farthest = 0;
      for_each_configuration(designs, loaded, count, [&](const Robot& robot, const Configuration& c, Random&) {
        Workspace<3> workspace;
        Solution<3> solution;
        const Status status = ctcr::solve<Derivatives::none>(Model<3>(robot), c.joints, c.load, workspace, solution);
        ++by_status[std::size_t(status)];
        evaluations += double(solution.iterations) / count;
        farthest = std::max(farthest, solution.position.norm() / (robot.tubes[0].length + c.joints.beta[0]));
      });
      const int ok = by_status[std::size_t(Status::ok)];
      const int unconverged = by_status[std::size_t(Status::not_converged)];
      const int singular = by_status[std::size_t(Status::singular)];
      print_row({name_of(designs), loaded ? "loaded" : "unloaded", std::to_string(count), std::to_string(ok),
                 std::to_string(unconverged), std::to_string(singular),
                 std::to_string(count - ok - unconverged - singular), text(evaluations), text(farthest)});
    }
}

struct WarmErrors {
  Errors tip;              // [m], of steps that answered ok
  int others = 0;          // steps that answered that they need a solve
  double evaluations = 0;  // mean of all
};

/// One step() from a converged warm start, every joint moved by the given size with a random sign.
WarmErrors warm_errors(bool loaded, int count, double millimetres, double degrees) {
  WarmErrors errors;
  for_each_configuration(
      Designs::table_ii, loaded, count, [&](const Robot& robot, const Configuration& c, Random& random) {
        const Model<3> model(robot);
        Workspace<3> workspace;
        Solution<3> stepped, exact;
        if (ctcr::solve<Derivatives::jacobian>(model, c.joints, c.load, workspace, stepped) != Status::ok) return;
        const auto sign = [&random] { return uniform(random, -1, 1) > 0 ? 1.0 : -1.0; };
        ctcr::Joints<3> q;
        do {
          q = c.joints;
          for (double& beta : q.beta) beta += sign() * 1e-3 * millimetres;
          for (double& alpha : q.alpha) alpha += sign() * degrees * std::numbers::pi / 180.0;
        } while (check_joints(robot, q) != Status::ok);
        Workspace<3> reference = workspace;
        const Status status = ctcr::step<Derivatives::jacobian>(model, q, c.load, workspace, stepped);
        if (ctcr::solve<Derivatives::jacobian>(model, q, c.load, reference, exact) != Status::ok) return;
        if (status == Status::ok)
          errors.tip.add((stepped.position - exact.position).norm());
        else
          ++errors.others;
        errors.evaluations += stepped.iterations;
      });
  errors.evaluations /= errors.tip.count + errors.others;
  return errors;
}

void study_warm_starts(int count) {
  print_header("Tip error [m] after one step() from a warm start",
               {"joints moved by", "load", "ok", "mean", "max", "needs_solve", "evaluations"});
  for (const double size : {0.1, 1.0, 10.0})
    for (const bool loaded : {false, true}) {
      const WarmErrors e = warm_errors(loaded, count, size, size);
      print_row({text(size) + " mm, " + text(size) + " deg", loaded ? "loaded" : "unloaded",
                 std::to_string(e.tip.count), text(e.tip.mean()), text(e.tip.max), std::to_string(e.others),
                 text(e.evaluations)});
    }
}

}  // namespace

int main(int argc, char** argv) {
  const int configurations = argc > 1 ? std::atoi(argv[1]) : 1000;
  const int starts = argc > 2 ? std::atoi(argv[2]) : 20000;
  study_methods(configurations);
  study_cold_starts(starts);
  study_warm_starts(configurations);
}
