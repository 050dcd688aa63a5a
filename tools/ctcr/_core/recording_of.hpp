#pragma once
// Recordings of a robot of N tubes behind AnyRecording.
#include <algorithm>
#include <ctcr/calibration/identification/recording.hpp>
#include <ctcr/friction/frictionless_torsion.hpp>
#include <stdexcept>

#include "any_recording.hpp"
#include "systems_of.hpp"

namespace ctcr::python {

/// Whether any of the effects that `chosen` takes acts, or is asked for.
template <int N>
bool any_effect(const Table& table, const auto& chosen) {
  bool found = false;
  typename AllEffects::On<N>{}.for_each([&](const auto& effect, int first) {
    if (!chosen(effect)) return;
    for (int k = 0; k < effect.count; ++k)
      found = found || table.effects[first + k] != effect.values[std::size_t(k)] ||
              std::ranges::count(table.free, ParameterVector<N>::count + first + k) > 0;
  });
  return found;
}

template <int N>
std::vector<RecordedRow<N>> rows_of(const Table& table) {
  const System<N> plain = system_of<N>(table.parameters, table.sensor_tube, table.steps);
  const Transmission<N>& transmission = plain.transmission;
  std::vector<RecordedRow<N>> rows(std::size_t(table.beta.rows()));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto k = Eigen::Index(i);
    rows[i].theta = motor_angles(transmission, {table.beta.row(k).transpose(), table.alpha.row(k).transpose()});
    rows[i].load.force = table.force.row(k).transpose();
    rows[i].at = {table.time[k], table.part[k], table.run[k], table.centre};
  }
  if (!rows.empty()) rows.front().from_home = table.from_home;
  if (any_effect<N>(table, [](const auto& effect) { return requires { effect.depends_on_torsion; }; }))
    set_frictionless_torsion<N>(plain, rows);
  return rows;
}

inline std::vector<Pose> measured_of(const Table& table) {
  std::vector<Pose> poses(std::size_t(table.position.rows()));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto q = table.quaternion.row(Eigen::Index(i));
    poses[i].position = table.position.row(Eigen::Index(i)).transpose();
    poses[i].rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  }
  return poses;
}

template <int N>
Profiles<N> profiles_of(const Table& table) {
  Profiles<N> out;
  const auto tubes = system_of<N>(table.parameters, table.sensor_tube, table.steps).model.robot().tubes;
  for (std::size_t i = 0; i < std::size_t(N) && table.profiles.rows() > 1; ++i) {
    out.length[i] = tubes[i].length;
    for (Eigen::Index k = 0; k < table.profiles.rows(); ++k) {
      const auto node = table.profiles.row(k).template segment<3>(3 * Eigen::Index(i));
      out.nodes[i].push_back({{node[0], node[1]}, node[2]});
    }
  }
  return out;
}

/// A recording of a robot of N tubes with any effects.
template <int N>
class RecordingOfTubes : public AnyRecording {
public:
  [[nodiscard]] virtual const std::vector<NearestEquilibrium<N>>& equilibria() const = 0;
};

/// @tparam Fx  AllEffects, or Standard: a tenth of the work
template <int N, class Fx>
class RecordingOf final : public RecordingOfTubes<N> {
public:
  explicit RecordingOf(const Table& table)
    : pool_(table.threads),
      profiles_(profiles_of<N>(table)),
      recording_(system(table, profiles_), rows_of<N>(table), measured_of(table), table.free, pool_) {
    recording_.solve_friction(recording_.nominal());
  }

  bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) override {
    return recording_(x, residual, jacobian);
  }
  double solve_friction(const Eigen::VectorXd& x) override { return recording_.solve_friction(x); }
  bool friction_is_solved() const override { return recording_.friction_is_solved(); }
  void begin_at(const AnyRecording& other) override {
    if (const auto* like = dynamic_cast<const RecordingOf*>(&other)) recording_.begin_at(like->recording_);
    if (const auto* same = dynamic_cast<const RecordingOfTubes<N>*>(&other)) recording_.begin_in(same->equilibria());
  }
  const std::vector<NearestEquilibrium<N>>& equilibria() const override { return recording_.equilibria(); }
  Eigen::VectorXd nominal() const override { return recording_.nominal(); }
  const std::vector<int>& unsolved() const override { return recording_.unsolved(); }
  const std::vector<bool>& active() const override { return recording_.active(); }
  void activate(const std::vector<bool>& rows) override {
    if (Eigen::Index(rows.size()) != recording_.size()) throw std::invalid_argument("activate needs one flag a row");
    recording_.activate(rows);
  }
  void predicted(RowMajor& position, RowMajor& quaternion) const override {
    const auto count = recording_.size();
    position.setConstant(count, 3, std::numeric_limits<double>::quiet_NaN());
    quaternion.setConstant(count, 4, std::numeric_limits<double>::quiet_NaN());
    std::vector<bool> solved = recording_.active();
    for (const int i : recording_.unsolved()) solved[std::size_t(i)] = false;
    for (Eigen::Index i = 0; i < count; ++i) {
      if (!solved[std::size_t(i)]) continue;
      const Pose& pose = recording_.predicted()[std::size_t(i)];
      position.row(i) = pose.position.transpose();
      quaternion.row(i) = ctcr::python::quaternion(pose.rotation);
    }
  }

private:
  static System<N, Fx> system(const Table& table, const Profiles<N>& profiles) {
    const System<N> plain = system_of<N>(table.parameters, table.sensor_tube, table.steps);
    if constexpr (Fx::none)
      return plain;
    else
      return with_effects<N>(plain, table.effects, &profiles);
  }

  ThreadPool pool_;
  Profiles<N> profiles_;
  Recording<N, Fx> recording_;
};

template <int N>
void check(const Table& table) {
  constexpr int parameters = SystemParameters<N, Catalogue>::count;
  const Eigen::Index rows = table.beta.rows();
  const auto is = [](const auto& matrix, Eigen::Index height, Eigen::Index width) {
    return matrix.rows() == height && matrix.cols() == width;
  };
  const bool fits =
      is(table.beta, rows, N) && is(table.alpha, rows, N) && is(table.force, rows, 3) && is(table.position, rows, 3) &&
      is(table.quaternion, rows, 4) && table.time.size() == rows && table.part.size() == rows &&
      table.run.size() == rows && table.parameters.size() == ParameterVector<N>::count &&
      table.effects.size() == Catalogue::On<N>::count && table.sensor_tube >= 0 && table.sensor_tube < N &&
      table.steps >= 1 && (table.profiles.size() == 0 || table.profiles.cols() == 3 * N);
  const bool known = std::ranges::all_of(table.free, [](int index) { return index >= 0 && index < parameters; });
  if (!fits || !known) throw std::invalid_argument("the arrays of a recording do not fit together");
}

template <int N>
std::unique_ptr<AnyRecording> make_recording(const Table& table) {
  check<N>(table);
  const bool plain = table.profiles.size() == 0 && !any_effect<N>(table, [](const auto&) { return true; });
  if (plain) return std::make_unique<RecordingOf<N, Standard>>(table);
  return std::make_unique<RecordingOf<N, AllEffects>>(table);
}

template <int N>
std::vector<ParameterInfo> robot_parameters() {
  using P = ParameterVector<N>;
  std::vector<ParameterInfo> out;
  for (int k = 0; k < P::count; ++k) {
    const auto [kind, i] = P::entry(k);
    const ParameterKind& info = P::info(kind);
    out.push_back({std::string(std::string_view(P::name(k))), std::string(info.name), std::string(info.unit), i,
                   info.lowest, info.highest});
  }
  return out;
}

template <int N>
std::vector<CatalogueParameter> catalogue_parameters() {
  constexpr std::array kinds{"amplitude", "detail", "shape", "choice"};  // as Role
  constexpr std::array quantities{"other",   "tip_force", "lag",         "moment",
                                  "surface", "source",    "screw_pitch", "gear_ratio"};  // as Quantity
  std::vector<CatalogueParameter> out;
  typename Catalogue::On<N>{}.for_each([&](const auto& effect, int first) {
    for (int k = 0; k < int(effect.parameters.size()); ++k) {
      const EffectParameter& p = effect.parameters[std::size_t(k)];
      out.push_back({std::string(effect.info.id), std::string(p.name), std::string(p.unit), std::string(p.meaning),
                     p.neutral, p.sigma, p.soft.low, p.soft.high, p.hard.low, p.hard.high, p.per_tube,
                     kinds[std::size_t(p.role)], quantities[std::size_t(p.quantity)], first + effect.index(k)});
    }
  });
  return out;
}

}  // namespace ctcr::python

#define CTCR_INSTANTIATE_RECORDING(N)                                                                               \
  template std::unique_ptr<ctcr::python::AnyRecording> ctcr::python::make_recording<N>(const ctcr::python::Table&); \
  template std::vector<ctcr::python::ParameterInfo> ctcr::python::robot_parameters<N>();                            \
  template std::vector<ctcr::python::CatalogueParameter> ctcr::python::catalogue_parameters<N>();
