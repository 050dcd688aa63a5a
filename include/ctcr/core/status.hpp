#pragma once
// What a real-time function can answer. Outputs are defined whatever the status.
#include <cstdint>

namespace ctcr {

enum class [[nodiscard]] Status : std::uint8_t {
  ok,                   ///< the outputs solve the model to the asked tolerance
  joints_out_of_order,  ///< an outer tube is grasped behind, or reaches beyond, an inner one; or beta > 0
  tip_behind_plate,     ///< a tube's tip is behind the front plate
  not_converged,        ///< no equilibrium found; the outputs are the best iterate
  singular,             ///< solved, but about to snap: near a bifurcation derivatives are unbounded
  unstable,             ///< solved, but the equilibrium found is unstable: no robot rests there
  inaccurate,           ///< solved, but integration errs by more than the asked accuracy in the most steps allowed
  needs_solve,          ///< a control step has spent its evaluations: solve() has to be asked
  not_finite,           ///< an input or a result is NaN, infinite or too large to compute with
  invalid_robot,        ///< the robot cannot exist, see check_robot(); nothing is computed
  invalid_settings,     ///< a limit, weight, period or other setting means nothing; nothing is computed
};

/// Whether the outputs solve the model; where it is about to snap they do, too. Real time: yes.
constexpr bool has_equilibrium(Status status) noexcept { return status == Status::ok || status == Status::singular; }

/// Whether the outputs describe a robot, in equilibrium or not: neither input nor result was refused. Real time: yes.
constexpr bool was_computed(Status status) noexcept {
  return has_equilibrium(status) || status == Status::not_converged || status == Status::unstable ||
         status == Status::inaccurate;
}

/// Plain-words name of a status. Real time: yes.
constexpr const char* to_string(Status status) noexcept {
  switch (status) {
    case Status::ok: return "ok";
    case Status::joints_out_of_order: return "joints out of order";
    case Status::tip_behind_plate: return "tip behind the plate";
    case Status::not_converged: return "not converged";
    case Status::singular: return "singular: near a bifurcation";
    case Status::unstable: return "unstable equilibrium";
    case Status::inaccurate: return "inaccurate: integration errs by more than asked";
    case Status::needs_solve: return "needs solve: the control step has spent its evaluations";
    case Status::not_finite: return "not finite";
    case Status::invalid_robot: return "invalid robot";
    case Status::invalid_settings: return "invalid settings";
  }
  return "unknown";
}

}  // namespace ctcr
