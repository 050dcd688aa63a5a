#pragma once
// Solves of one random case: cold, from near and from far, and a walk of control steps; each answer is judged.
#include <algorithm>
#include <map>
#include <optional>
#include <vector>

#include "robustness/judge.hpp"
#include "robustness/random_designs.hpp"
#include "support/robot_text.hpp"

namespace ctcr::test {

/// How an attack went.
struct Tally {
  std::map<std::string, int> statuses;                  ///< of solves, by start and status
  std::map<std::string, std::vector<int>> evaluations;  ///< of each solve, by start
  std::vector<std::string> faults;                      ///< each with its case as text
  long answers = 0, judged = 0;
};

/// Evaluations of a solve by its start, as rows of a markdown table: mean, percentiles and worst.
inline std::string evaluations_table(const Tally& tally, const std::string& name) {
  std::string table;
  for (auto [start, counts] : tally.evaluations) {
    std::ranges::sort(counts);
    const std::size_t size = counts.size();
    double sum = 0;
    for (int count : counts) sum += count;
    char row[160];
    const auto percentile = [&](double share) { return counts[std::min(size - 1, std::size_t(share * double(size)))]; };
    std::snprintf(row, sizeof row, "| %s | %s | %zu | %.1f | %d | %d | %d | %d | %d |\n", name.c_str(), start.c_str(),
                  size, sum / double(size), percentile(0.5), percentile(0.9), percentile(0.99), percentile(0.999),
                  counts.back());
    table += row;
  }
  return table;
}

/// How differently a compliance and its transpose have the load move the tip, as a part of the robot's length. Turns count
/// at the lever at which they count as errors of the position.
inline double asymmetry_of(const Mat6& compliance, const TipLoad& load, double length) {
  Vec6 wrench;
  wrench << load.force, load.moment;
  const Vec6 difference = (compliance - compliance.transpose()) * wrench;
  return std::max(difference.head<3>().norm() / length, detail::lever * difference.tail<3>().norm());
}

/// How an attack goes about it.
struct Attack {
  /// Of so many cases one is moved to others and its tips are compared with those in 32 steps, and one is judged by the
  /// independent model and walks: they take ten and a hundred times as long as a solve.
  int moved = 4, thorough = 40;
};

template <int N>
class Attacker {
public:
  Attacker(const Attack& attack, Random& random, Tally& tally) : attack_(attack), random_(random), tally_(tally) {}

  /// @param model  of the robot of the case   @param name  of the class, with seed and number of the case
  /// @param known  the effects of the model, where the independent rod knows all of them
  void at(const Case<N>& c, const auto& model, const std::optional<Known<N>>& known, const std::string& name) {
    name_ = name;
    known_ = known;
    thorough_ = number_ % attack_.thorough == 0;
    moved_ = thorough_ || number_ % attack_.moved == 0;
    ++number_;
    Workspace<N> ws;
    Solution<N> s;
    solve_from("cold", model, c, ws, s);
    if (!moved_ || !has_equilibrium(s.status)) return;
    solve_from("near", model, neighbour(c, 0.1), ws, s);
    const Case<N> far = neighbour(c, 1.5);
    solve_from("far", model, far, ws, s);
    if (thorough_ && s.status == Status::ok) walk(model, far, ws);
  }

private:
  void solve_from(const char* start, const auto& model, const Case<N>& c, Workspace<N>& ws, Solution<N>& s) {
    (void)solve<Derivatives::compliance>(model, c.q, c.load, ws, s, settings_);
    ++tally_.statuses[std::string(start) + ", " + to_string(s.status)];
    tally_.evaluations[start].push_back(s.iterations);
    judge(start, model, c, ws, s);
    if (known_ && s.status == Status::ok && length_of(c) > 1e-3 && c.load.moment.isZero(0.0) &&
        !is_symmetric(model, c, ws, s))
      fault("the compliance is not symmetric", start, c, s);
  }

  /// A force is conservative, a moment is not. Each of the two displacements may err by three times the accuracy; near a snap
  /// the compliance grows, and its error with it. An asymmetry beyond that must be an error of integration, of fourth order.
  bool is_symmetric(const auto& model, const Case<N>& c, const Workspace<N>& ws, const Solution<N>& s) const {
    const auto asymmetry = [&](const Solution<N>& of) {
      return asymmetry_of(of.compliance, c.load, length_of(c)) * std::min(1.0, of.stability);
    };
    if (asymmetry(s) < 6 * settings_.accuracy) return true;
    Workspace<N> fine;
    fine.begin_at(ws.guess);
    Solution<N> finer;
    const int steps = 2 * ws.steps.times * ws.steps.largest_share();
    (void)solve<Derivatives::compliance>(model, c.q, c.load, fine, finer, {.steps = steps, .accuracy = as_told});
    return finer.status == Status::ok && asymmetry(finer) < asymmetry(s) / 8;
  }

  void walk(const auto& model, Case<N> c, Workspace<N>& ws) {
    Solution<N> s;
    VecN<N> turn;
    for (double& x : turn) x = uniform(random_, -0.05, 0.05);
    for (int k = 0; k < 20; ++k) {
      c.q.alpha += turn;
      const Status status = step<Derivatives::compliance>(model, c.q, c.load, ws, s, settings_);
      judge("step", model, c, ws, s);
      if (s.iterations > settings_.evaluations) fault("more evaluations than the budget", "step", c, s);
      if (status != Status::ok) return;
    }
  }

  void judge(const char* start, const auto& model, const Case<N>& c, const Workspace<N>& ws, const Solution<N>& s) {
    ++tally_.answers;
    // Effects may displace the tip.
    const double longer = std::is_same_v<decltype(model), const Model<N>&> ? 0 : 1;
    if (!is_defined(s, c, longer)) fault("outputs are not defined", start, c, s);
    if (s.status != Status::ok || !moved_) return;
    if (!(length_of(c) > 1e-3)) return;  // a robot inside the plate has no shape to judge
    bool same_branch = true;
    std::string wrong = differs_from_finer_steps(c, model, ws, s, settings_.accuracy, same_branch);
    if (wrong.empty() && known_ && (thorough_ || !same_branch)) {
      ++tally_.judged;
      wrong = wrong_equilibrium(c, ws, s, settings_.accuracy, *known_);
    }
    if (!wrong.empty()) fault(wrong, start, c, s);
  }

  void fault(const std::string& what, const char* start, const Case<N>& c, const Solution<N>& s) {
    tally_.faults.push_back(name_ + ", " + start + ": " + what + " (" + to_string(s.status) + ", " +
                            std::to_string(s.iterations) + " evaluations)\n" + text(c));
  }

  /// The same robot elsewhere: turned by up to `by` [rad], moved and loaded accordingly.
  Case<N> neighbour(Case<N> c, double by) {
    const Case<N> other{c.robot, random_joints(c.robot, random_), {}};
    for (double& x : c.q.alpha) x += uniform(random_, -by, by);
    c.q.beta += std::min(0.3 * by, 1.0) * uniform(random_, 0, 1) * (other.q.beta - c.q.beta);
    c.load.force *= 1 + std::min(by, 1.0) * uniform(random_, -1, 0.5);
    return c;
  }

  const Attack& attack_;
  Random& random_;
  Tally& tally_;
  const Settings settings_{};
  std::string name_;
  int number_ = 0;
  bool moved_ = false, thorough_ = false;
  std::optional<Known<N>> known_;
};

}  // namespace ctcr::test
