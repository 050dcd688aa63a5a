#pragma once
// Readings of a robot of N tubes behind AnyReadings. Each N is compiled in a file of its own.
#include <ctcr/calibration/readings.hpp>

#include "any_readings.hpp"

namespace ctcr::python {

template <int N>
System<N> system_of(const Table& table) {
  using P = ParameterVector<N>;
  const auto value = [&](Parameter kind, int i = 0) { return table.parameters[P::index(kind, i)]; };
  Robot<N> robot;
  Transmission<N> transmission{value(Parameter::translation_ratio), value(Parameter::rotation_ratio), {}, {}};
  PoseSensor sensor{{}, table.sensor_tube};
  Vec3 turn;
  for (int i = 0; i < N; ++i) {
    for (int k = 0; k < int(parameter_kinds.size()); ++k)
      if (const auto field = P::info(Parameter(k)).field) robot.tubes[std::size_t(i)].*field = value(Parameter(k), i);
    transmission.home_translation[i] = value(Parameter::home_translation, i);
    transmission.home_rotation[i] = value(Parameter::home_rotation, i);
  }
  for (int i = 0; i < 3; ++i) {
    robot.gravity[i] = value(Parameter::gravity, i);
    sensor.T_tracker_base.position[i] = value(Parameter::tracker_position, i);
    turn[i] = value(Parameter::tracker_rotation, i);
  }
  sensor.T_tracker_base.rotation = rotation_matrix(turn);
  return {transmission, Model<N>(robot), sensor, Settings{.steps = table.steps}};
}

template <int N>
std::vector<Reading<N>> rows_of(const Table& table) {
  std::vector<Reading<N>> rows(std::size_t(table.beta.rows()));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto at = Eigen::Index(i);
    const auto q = table.quaternion.row(at);
    rows[i].q = {table.beta.row(at).transpose(), table.alpha.row(at).transpose()};
    rows[i].load.force = table.force.row(at).transpose();
    rows[i].measured.position = table.position.row(at).transpose();
    rows[i].measured.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  }
  return rows;
}

template <int N>
class ReadingsOf final : public AnyReadings {
public:
  explicit ReadingsOf(const Table& table)
    : pool_(table.threads), readings_(system_of<N>(table), rows_of<N>(table), table.free, pool_) {}

  bool operator()(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) override {
    return readings_(x, residual, jacobian);
  }
  Eigen::VectorXd nominal() const override { return readings_.nominal(); }
  const std::vector<int>& unsolved() const override { return readings_.unsolved(); }
  const std::vector<bool>& active() const override { return readings_.active(); }
  void activate(const std::vector<bool>& rows) override { readings_.activate(rows); }

private:
  ThreadPool pool_;
  Readings<N> readings_;
};

template <int N>
std::unique_ptr<AnyReadings> make_readings(const Table& table) {
  return std::make_unique<ReadingsOf<N>>(table);
}

template <int N>
ParameterNames parameter_names() {
  ParameterNames out;
  for (int i = 0; i < ParameterVector<N>::count; ++i) {
    out.names.emplace_back(std::string_view(ParameterVector<N>::name(i)));
    out.units.emplace_back(ParameterVector<N>::info(ParameterVector<N>::entry(i).kind).unit);
  }
  return out;
}

}  // namespace ctcr::python

#define CTCR_READINGS_OF(N)                                                                                       \
  template std::unique_ptr<ctcr::python::AnyReadings> ctcr::python::make_readings<N>(const ctcr::python::Table&); \
  template ctcr::python::ParameterNames ctcr::python::parameter_names<N>();
