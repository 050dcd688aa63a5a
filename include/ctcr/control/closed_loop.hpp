#pragma once
// A controller at work on a device along a path: what a real-time loop does, without its clock.
#include "ctcr/control/controller.hpp"

namespace ctcr {

/// One period of a closed loop.
template <int N, class Tasks>
struct LoopRow {
  double time = 0;  ///< [s]
  Measurement<N> measured{};
  Reference reference{};
  MotorAngles<N> velocity{};  ///< told to the motors [rad/s]
  ControlReport<Tasks> report{};
};

/// Runs from time 0 to the path's end.
/// @param path    has at(time) -> Reference and duration(), and may have check()
/// @param record  record(row) after each period; return false to stop
/// @return ok; invalid_settings: the period is not > 0, or the path is none or has no end; or the first status of the device
///         that is not ok. Real time: as path, device and record.
template <int N, class Tasks, class Fx, Device<N> D, class Path, class Record>
Status run(Controller<N, Tasks, Fx>& controller, D& device, const Path& path, double period, const TipLoad& load,
           const Record& record) noexcept {
  const double periods = path.duration() / period + 0.5;
  if (!(period > 0 && periods < 1e15)) return Status::invalid_settings;
  if constexpr (requires { path.check(); })
    if (path.check() != Status::ok) return path.check();
  for (long k = 0; k <= static_cast<long>(periods); ++k) {
    LoopRow<N, Tasks> row{.time = double(k) * period};
    Status status = device.measure(row.measured);
    if (status != Status::ok) return status;
    row.reference = path.at(row.time);
    row.report = controller.advance(row.measured, row.reference, load, row.velocity);
    if (!record(static_cast<const LoopRow<N, Tasks>&>(row))) return Status::ok;
    status = device.move(row.velocity, period);
    if (status != Status::ok) return status;
  }
  return Status::ok;
}

}  // namespace ctcr
