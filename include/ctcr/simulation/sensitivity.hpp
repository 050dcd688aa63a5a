#pragma once
// What wrong parameters do to the predicted tip, over random configurations: sums, not samples, so that memory does not
// grow with their number.
#include <array>
#include <cmath>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "ctcr/mechanics/neighbours.hpp"
#include "ctcr/system/parameters.hpp"

namespace ctcr {

/// Distances [m] between two predictions.
struct DistanceStatistics {
  static constexpr int bins = 240;                       ///< of equal width in the logarithm
  static constexpr double smallest = 1e-7, largest = 1;  ///< [m]: what lies beyond counts in the first and last bin

  std::int64_t count = 0, unsolved = 0;
  double sum = 0, sum_of_squares = 0, maximum = 0;
  std::array<std::int64_t, bins> histogram{};

  void add(double distance) noexcept {
    ++count;
    sum += distance;
    sum_of_squares += distance * distance;
    maximum = std::max(maximum, distance);
    const double part = std::log(std::max(distance, smallest) / smallest) / std::log(largest / smallest);
    ++histogram[std::size_t(std::min(int(part * bins), bins - 1))];
  }
};

/// Joints uniform over the range that the order of the tubes allows, and a tip force of uniform size and
/// direction. Ref: Boyer et al., Section II; Burgner-Kahrs et al. 2014.
template <int N, class Random>
void draw_configuration(const Robot<N>& robot, double most_force, Random& random, Joints<N>& q,
                        TipLoad& load) noexcept {
  std::uniform_real_distribution<double> uniform;
  do
    for (int i = 0; i < N; ++i) q.beta[i] = -robot.tubes[std::size_t(i)].length * uniform(random);
  while (check_joints(robot, q, 0) != Status::ok);
  for (int i = 0; i < N; ++i) q.alpha[i] = std::numbers::pi * (2 * uniform(random) - 1);
  const double z = 2 * uniform(random) - 1, turn = 2 * std::numbers::pi * uniform(random),
               across = std::sqrt(1 - z * z);
  load = {most_force * uniform(random) * Vec3(across * std::cos(turn), across * std::sin(turn), z), Vec3::Zero()};
}

/// Parameters that vary, each as a whole system.
template <int N>
struct Variations {
  System<N> nominal;
  std::vector<System<N>> systems;  ///< one at a time; neighbours 2k, 2k + 1 are the two ends of one parameter
  Eigen::VectorXd low, high;       ///< as SystemParameters<N, Standard>: of what varies together
  double most_force = 0;           ///< at the tip [N]
};

namespace detail {

/// Joints at which the tubes of `robot` can be: what a wrong length or offset puts out of order moves to the next place.
template <int N>
void put_in_order(const Robot<N>& robot, Joints<N>& q) noexcept {
  double base = 0, tip = 0;
  for (int i = N - 1; i >= 0; --i) {
    const double length = robot.tubes[std::size_t(i)].length;
    base = q.beta[i] = std::max(std::min(q.beta[i], base), tip - length);
    tip = length + base;
  }
}

/// Whether two systems differ in their sensor alone, so that their tips are the same.
template <int N>
bool same_tips(const System<N>& a, const System<N>& b) {
  using P = SystemParameters<N, Standard>;
  const auto count = P::Robot::index(Parameter::tracker_position);
  return P::values(a).head(count) == P::values(b).head(count);
}

/// Tips of systems around a solved one, four at a time where that goes, else each by Newton's method.
template <int N, Loading L>
class TipDistances {
public:
  std::int64_t evaluations = 0;

  /// @param found, ws  the nominal system's solution at `q` under `load`; they must outlive this
  TipDistances(const System<N>& nominal, const Joints<N>& q, const TipLoad& load, const Solution<N>& found,
               const Workspace<N>& ws, const Settings& settings) noexcept
    : nominal_(nominal),
      theta_(motor_angles(nominal.transmission, q)),
      load_(load),
      found_(found),
      ws_(ws),
      settings_(settings),
      right_(reading(nominal.sensor, found.tube_tips).position),
      here_(nominal.model.coefficients(), q),
      around_(here_, load.force, found, ws.guess, nominal.sensor.tube, ws.steps) {}

  /// Of a system whose tip is where the nominal one's is.
  void add_known(const System<N>& system, DistanceStatistics& out) const noexcept {
    out.add((reading(system.sensor, found_.tube_tips).position - right_).norm());
  }

  /// `system` must outlive finish().
  void add(const System<N>& system, DistanceStatistics& out) noexcept {
    Joints<N> q = joints(system.transmission, theta_);
    put_in_order(system.model.robot(), q);
    const Waiting one{{system.model.coefficients(), q}, &system, &out};
    if (!one.robot.comparable(here_)) return solve({one, one, one, one}, 1);
    waiting_[std::size_t(count_++)] = one;
    if (count_ == lane_count) finish();
  }

  void finish() noexcept {
    for (int i = count_; count_ > 0 && i < lane_count; ++i) waiting_[std::size_t(i)] = waiting_[0];
    solve(waiting_, std::exchange(count_, 0));
  }

private:
  struct Waiting {
    Neighbour<N> robot;
    const System<N>* system = nullptr;
    DistanceStatistics* out = nullptr;
  };

  /// The first `count` of four; the others are there to fill up.
  void solve(const std::array<Waiting, lane_count>& four, int count) noexcept {
    if (count == 0) return;
    const auto tips = around_.solve({four[0].robot, four[1].robot, four[2].robot, four[3].robot});
    for (std::size_t i = 0; i < std::size_t(count); ++i) {
      evaluations += tips[i].evaluations;
      const PoseSensor& sensor = four[i].system->sensor;
      const Pose tip{Mat3::Identity(), tips[i].position};  // no rotation is known of it
      if (tips[i].solved && sensor.T_tip_sensor.position.isZero(0))
        four[i].out->add((seat(sensor, tip).position - right_).norm());
      else
        add_alone(*four[i].system, four[i].robot.q, *four[i].out);
    }
  }

  void add_alone(const System<N>& system, const Joints<N>& q, DistanceStatistics& out) noexcept {
    Workspace<N> ws = ws_;
    Solution<N> solution;
    Settings same = settings_;  // as many steps as the nominal one, so that errors of integration cancel
    same.steps = ws.steps.times;
    same.accuracy = 1;  // never more
    const Status status = ctcr::solve(system.model, q, load_, ws, solution, same);
    evaluations += solution.iterations;
    if (status == Status::ok)
      out.add((reading(system.sensor, solution.tube_tips).position - right_).norm());
    else
      ++out.unsolved;
  }

  const System<N>& nominal_;
  MotorAngles<N> theta_;
  TipLoad load_;
  const Solution<N>& found_;
  const Workspace<N>& ws_;
  const Settings& settings_;
  Vec3 right_;
  Neighbour<N> here_;
  Neighbours<N, L> around_;
  std::array<Waiting, lane_count> waiting_;
  int count_ = 0;
};

template <Loading L, int N>
std::int64_t tip_sensitivity(const Variations<N>& v, std::uint64_t seed, std::uint64_t block, int configurations,
                             std::span<DistanceStatistics> out) {
  using P = SystemParameters<N, Standard>;
  const Settings settings{.tolerance = 1e-8, .steps = v.nominal.settings.steps};
  std::vector<bool> known;
  for (const System<N>& system : v.systems) known.push_back(same_tips(v.nominal, system));
  std::seed_seq mixed{seed, seed >> 32, block, block >> 32};
  std::mt19937_64 random(mixed);
  std::uniform_real_distribution<double> uniform;
  Workspace<N> ws;
  Solution<N> exact;
  Joints<N> q;
  TipLoad load;
  std::int64_t evaluations = 0;
  for (int k = 0; k < configurations; ++k) {
    draw_configuration(v.nominal.model.robot(), v.most_force, random, q, load);
    Eigen::VectorXd x = v.low;
    for (Eigen::Index i = 0; i < x.size(); ++i) x[i] += uniform(random) * (v.high[i] - v.low[i]);
    ws.reset();
    const Status status = solve(v.nominal.model, q, load, ws, exact, settings);
    evaluations += exact.iterations;
    if (status != Status::ok) {
      for (DistanceStatistics& one : out) ++one.unsolved;
      continue;
    }
    const System<N> together = P::with_values(v.nominal, x);
    TipDistances<N, L> distances(v.nominal, q, load, exact, ws, settings);
    for (std::size_t i = 0; i < v.systems.size(); ++i)
      if (known[i])
        distances.add_known(v.systems[i], out[i]);
      else
        distances.add(v.systems[i], out[i]);
    distances.add(together, out.back());
    distances.finish();
    evaluations += distances.evaluations;
  }
  return evaluations;
}

}  // namespace detail

/// Tip errors over one block of configurations: of each system, and last of all parameters together, drawn anew and
/// uniformly for each configuration. A varied tube that cannot be where the joints put it is moved to where it can.
/// Tips are good to 1e-7 m (forces up to 0.3 N); where several equilibria are stable, any of them counts.
/// @param block  its number decides the random configurations, with `seed`
/// @param out    systems.size() + 1 statistics, added to
/// @return evaluations of the model that were used. Real time: no; does not allocate but for the parameters drawn.
template <int N>
std::int64_t tip_sensitivity(const Variations<N>& v, std::uint64_t seed, std::uint64_t block, int configurations,
                             std::span<DistanceStatistics> out) {
  const auto weighs = [](const System<N>& system) { return !system.model.robot().gravity.isZero(0.0); };
  if (weighs(v.nominal) || std::any_of(v.systems.begin(), v.systems.end(), weighs))
    return detail::tip_sensitivity<Loading::weight>(v, seed, block, configurations, out);
  if (v.most_force > 0) return detail::tip_sensitivity<Loading::force>(v, seed, block, configurations, out);
  return detail::tip_sensitivity<Loading::none>(v, seed, block, configurations, out);
}

}  // namespace ctcr
