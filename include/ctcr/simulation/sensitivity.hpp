#pragma once
// What wrong parameters do to the predicted tip, over random configurations: sums, not samples, so that memory does not
// grow with their number.
#include <array>
#include <cmath>
#include <random>
#include <span>
#include <vector>

#include "ctcr/pipeline/parameters.hpp"

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
    const double place = std::log(std::max(distance, smallest) / smallest) / std::log(largest / smallest);
    ++histogram[std::size_t(std::min(int(place * bins), bins - 1))];
  }
};

/// Joints anywhere in their range, uniform over what the order of the tubes allows, and a tip force of uniform size and
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

/// The guess as far from `middle` as `end` is, to the other side.
template <int N>
TipGuess<N> opposite(const TipGuess<N>& middle, const TipGuess<N>& end) noexcept {
  return {middle.rotation * end.rotation.transpose() * middle.rotation, 2 * middle.psi - end.psi};
}

}  // namespace detail

/// Tip errors over one block of configurations: of each system, and last of all parameters together, drawn anew and
/// uniformly for each configuration. A varied tube that cannot be where the joints put it is moved to where it can.
/// Tips are solved to 3e-5 rad of the base angles, some micrometres; means are then good to 0.02 %.
/// @param block  its number decides the random configurations, with `seed`
/// @param out    systems.size() + 1 statistics, added to
/// @return evaluations of the model that were used. Real time: no; does not allocate but for the parameters drawn.
template <int N>
std::int64_t tip_sensitivity(const Variations<N>& v, std::uint64_t seed, std::uint64_t block, int configurations,
                             std::span<DistanceStatistics> out) {
  using P = SystemParameters<N, Standard>;
  const Settings settings{.max_iterations = 50, .tolerance = 3e-5, .steps = v.nominal.settings.steps};
  std::vector<bool> known;
  for (const System<N>& system : v.systems) known.push_back(detail::same_tips(v.nominal, system));
  std::seed_seq mixed{seed, seed >> 32, block, block >> 32};
  std::mt19937_64 random(mixed);
  std::uniform_real_distribution<double> uniform;
  Workspace<N> nominal, ws;
  Solution<N> exact, solution;
  Joints<N> q;
  TipLoad load;
  std::int64_t evaluations = 0;
  for (int k = 0; k < configurations; ++k) {
    draw_configuration(v.nominal.model.robot(), v.most_force, random, q, load);
    nominal.reset();
    const Status status = solve<Derivatives::jacobian>(v.nominal.model, q, load, nominal, exact, settings);
    evaluations += exact.iterations;
    const MotorAngles<N> theta = motor_angles(v.nominal.transmission, q);
    const Vec3 right = reading(v.nominal.sensor, exact.tube_tips).position;
    const auto compare = [&](const System<N>& system, const Solution<N>& answer, Status found, auto& statistics) {
      if (status == Status::ok && found == Status::ok)
        statistics.add((reading(system.sensor, answer.tube_tips).position - right).norm());
      else
        ++statistics.unsolved;
    };
    const auto solved = [&](const System<N>& system) {
      Joints<N> there = joints(system.transmission, theta);
      detail::put_in_order(system.model.robot(), there);
      const Status found = solve(system.model, there, load, ws, solution, settings);
      evaluations += solution.iterations;
      return found;
    };
    for (std::size_t i = 0; i < v.systems.size(); ++i) {
      if (known[i]) {
        compare(v.systems[i], exact, status, out[i]);
        continue;
      }
      const bool other_end = i % 2 == 1 && ws.warm;
      const TipGuess<N> first_end = ws.guess;
      ws = nominal;
      if (other_end) {
        ws.guess = detail::opposite<N>(nominal.guess, first_end);
        ws.knows_joints = false;
      }
      compare(v.systems[i], solution, solved(v.systems[i]), out[i]);
    }
    Eigen::VectorXd x = v.low;
    for (Eigen::Index i = 0; i < x.size(); ++i) x[i] += uniform(random) * (v.high[i] - v.low[i]);
    ws = nominal;
    const System<N> together = P::with_values(v.nominal, x);
    compare(together, solution, solved(together), out.back());
  }
  return evaluations;
}

}  // namespace ctcr
