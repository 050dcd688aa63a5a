#pragma once
// Recordings of a robot of N tubes behind AnyRecording. Each N is compiled in a file of its own.
#include <ctcr/calibration/recording.hpp>
#include <ctcr/effects/catalogue.hpp>
#include <ctcr/effects/profile_table.hpp>

#include "any_recording.hpp"
#include "readings_of.hpp"

namespace ctcr::python {

/// The catalogue, and what effects that are written in Python do along the tubes.
template <class>
struct WithProfiles;
template <template <int, class> class... E>
struct WithProfiles<EffectList<E...>> {
  using type = EffectList<E..., ProfileTable>;
};

template <int N>
class RecordingOf final : public AnyRecording {
  using Fx = WithProfiles<Catalogue>::type;

public:
  explicit RecordingOf(const RecordedTable& table)
    : pool_(table.threads),
      profiles_(profiles(table)),
      recording_(system(table, profiles_), rows(table), measured(table), table.free, pool_) {}

  bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) override {
    return recording_(x, residual, jacobian);
  }
  Eigen::VectorXd nominal() const override { return recording_.nominal(); }
  const std::vector<int>& unsolved() const override { return recording_.unsolved(); }
  const std::vector<bool>& active() const override { return recording_.active(); }
  void activate(const std::vector<bool>& rows) override { recording_.activate(rows); }
  void predicted(RowMajor& position, RowMajor& quaternion) const override {
    const auto count = recording_.size();
    position.resize(count, 3);
    quaternion.resize(count, 4);
    for (Eigen::Index i = 0; i < count; ++i) {
      const Pose& pose = recording_.predicted()[std::size_t(i)];
      const Eigen::Quaterniond q(pose.rotation);
      position.row(i) = pose.position.transpose();
      quaternion.row(i) = (q.w() < 0 ? -1.0 : 1.0) * Eigen::RowVector4d(q.w(), q.x(), q.y(), q.z());
    }
    for (const int i : recording_.unsolved()) clear(position, quaternion, i);
    for (Eigen::Index i = 0; i < count; ++i)
      if (!recording_.active()[std::size_t(i)]) clear(position, quaternion, i);
  }

private:
  static void clear(RowMajor& position, RowMajor& quaternion, Eigen::Index i) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    position.row(i).setConstant(nan);
    quaternion.row(i).setConstant(nan);
  }

  static Profiles<N> profiles(const RecordedTable& table) {
    Profiles<N> out;
    const auto tubes = system_of<N>(table).model.robot().tubes;
    for (std::size_t i = 0; i < std::size_t(N) && table.profiles.rows() > 1; ++i) {
      out.length[i] = tubes[i].length;
      for (Eigen::Index k = 0; k < table.profiles.rows(); ++k) {
        const auto node = table.profiles.row(k).template segment<3>(3 * Eigen::Index(i));
        out.nodes[i].push_back({{node[0], node[1]}, node[2]});
      }
    }
    return out;
  }
  static System<N, Fx> system(const RecordedTable& table, const Profiles<N>& profiles) {
    const System<N> plain = system_of<N>(table);
    typename Fx::On<N> effects;
    effects.for_each([&](auto& effect, int first) {
      for (std::size_t k = 0; k < effect.values.size(); ++k) effect.values[k] = table.effects[first + Eigen::Index(k)];
      if constexpr (requires { effect.profiles; }) effect.profiles = &profiles;
    });
    return {plain.transmission, Model<N, Fx>(plain.model.robot(), effects), plain.sensor, plain.settings};
  }
  static std::vector<RecordedRow<N>> rows(const RecordedTable& table) {
    const std::vector<Reading<N>> plain = rows_of<N>(table);
    const Transmission<N> transmission = system_of<N>(table).transmission;
    std::vector<RecordedRow<N>> rows(plain.size());
    for (std::size_t i = 0; i < plain.size(); ++i) {
      const auto k = Eigen::Index(i);
      rows[i] = {motor_angles(transmission, plain[i].q),
                 plain[i].load,
                 {table.time[k], table.part[k], table.run[k], table.centre}};
    }
    return rows;
  }
  static std::vector<Pose> measured(const RecordedTable& table) {
    std::vector<Pose> poses;
    for (const Reading<N>& reading : rows_of<N>(table)) poses.push_back(reading.measured);
    return poses;
  }

  ThreadPool pool_;
  Profiles<N> profiles_;
  Recording<N, Fx> recording_;
};

template <int N>
std::unique_ptr<AnyRecording> make_recording(const RecordedTable& table) {
  return std::make_unique<RecordingOf<N>>(table);
}

template <int N>
std::vector<CatalogueParameter> catalogue_parameters() {
  std::vector<CatalogueParameter> out;
  typename Catalogue::On<N>{}.for_each([&](const auto& effect, int first) {
    for (int k = 0; k < int(effect.parameters.size()); ++k) {
      const EffectParameter& p = effect.parameters[std::size_t(k)];
      out.push_back({std::string(effect.info.id), std::string(p.name), std::string(p.unit), std::string(p.meaning),
                     p.neutral, p.sigma, p.soft_low, p.soft_high, p.hard_low, p.hard_high, p.per_tube,
                     p.role == Role::shape, first + effect.place(k)});
    }
  });
  return out;
}

template <int N>
std::vector<std::string> system_parameter_names() {
  using P = SystemParameters<N, Catalogue>;
  std::vector<std::string> names;
  for (int i = 0; i < P::count; ++i) names.push_back(P::name(i));
  return names;
}

}  // namespace ctcr::python

#define CTCR_RECORDING_OF(N)                                                                      \
  template std::unique_ptr<ctcr::python::AnyRecording> ctcr::python::make_recording<N>(           \
      const ctcr::python::RecordedTable&);                                                        \
  template std::vector<ctcr::python::CatalogueParameter> ctcr::python::catalogue_parameters<N>(); \
  template std::vector<std::string> ctcr::python::system_parameter_names<N>();
