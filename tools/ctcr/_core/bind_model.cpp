// Model: poses and shapes of a robot. Use ctcr.model, which names and shapes the arrays.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <tuple>

#include "any_model.hpp"
#include "with_tubes.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {
namespace {

std::shared_ptr<AnyModel> new_model(int tubes, const Eigen::VectorXd& parameters,
                                    const std::optional<Eigen::VectorXd>& effects) {
  return with_tubes(tubes, [&](auto n) { return make_model<n>(parameters, effects.value_or(Eigen::VectorXd())); });
}

Configurations configurations(RowMajor beta, RowMajor alpha, std::optional<RowMajor> force,
                              std::optional<RowMajor> moment) {
  return {std::move(beta), std::move(alpha), std::move(force).value_or(RowMajor()),
          std::move(moment).value_or(RowMajor())};
}

auto predict(const AnyModel& model, RowMajor beta, RowMajor alpha, std::optional<RowMajor> force,
             std::optional<RowMajor> moment, Integrator integrator, int steps, int tip_of, int threads,
             bool derivatives, std::vector<int> by_parameters) {
  Poses p;
  {
    const nb::gil_scoped_release released;
    p = model.predict(configurations(std::move(beta), std::move(alpha), std::move(force), std::move(moment)),
                      {integrator, steps, tip_of, threads, derivatives, std::move(by_parameters)});
  }
  return std::tuple(std::move(p.position), std::move(p.quaternion), std::move(p.status), std::move(p.stability),
                    std::move(p.jacobian), std::move(p.compliance), std::move(p.by_parameters));
}

auto arrays_of(ShapeArrays s) {
  return std::tuple(s.status, s.stability, std::move(s.arc_length), std::move(s.position), std::move(s.quaternion),
                    std::move(s.force), std::move(s.moment), std::move(s.tube_angle), std::move(s.tube_curvature),
                    std::move(s.tube_moment));
}

auto shapes(const AnyModel& model, RowMajor beta, RowMajor alpha, std::optional<RowMajor> force,
            std::optional<RowMajor> moment, int points, int steps, bool all) {
  if (points < 2) throw std::invalid_argument("points must be at least 2");
  const Configurations row = configurations(std::move(beta), std::move(alpha), std::move(force), std::move(moment));
  std::vector<decltype(arrays_of(ShapeArrays{}))> found;
  for (ShapeArrays& one : model.shapes(row, points, steps, all)) found.push_back(arrays_of(std::move(one)));
  return found;
}

}  // namespace

void bind_calibration(nb::module_& m);
void bind_identify(nb::module_& m);
void bind_effects(nb::module_& m);
void bind_control(nb::module_& m);
void bind_recording(nb::module_& m);

}  // namespace ctcr::python

NB_MODULE(_core, m) {
  using namespace ctcr::python;
  using ctcr::Status;
  m.doc() =
      "The compiled library: arrays of SI values in and out. Use the packages of ctcr, which name and check them.";
  m.attr("TUBES") = nb::tuple(nb::cast(modelled_tubes));

  nb::enum_<Status>(m, "Status", nb::is_arithmetic(), "What came of a solution; see status_text.")
      .value("ok", Status::ok)
      .value("joints_out_of_order", Status::joints_out_of_order)
      .value("tip_behind_plate", Status::tip_behind_plate)
      .value("not_converged", Status::not_converged)
      .value("singular", Status::singular)
      .value("unstable", Status::unstable)
      .value("inaccurate", Status::inaccurate)
      .value("needs_solve", Status::needs_solve)
      .value("not_finite", Status::not_finite)
      .value("invalid_robot", Status::invalid_robot)
      .value("invalid_settings", Status::invalid_settings);
  nb::enum_<Integrator>(m, "Integrator", "Schemes of integration along the robot.")
      .value("standard", Integrator::standard)
      .value("ssp_rk3", Integrator::ssp_rk3)
      .value("classical_rk4", Integrator::classical_rk4)
      .value("prince_dormand8", Integrator::prince_dormand8);
  m.def("status_text", [](Status status) { return ctcr::to_string(status); }, "status"_a, "A status in plain words.");

  nb::class_<AnyModel>(m, "Model", "Kinetostatic model of 1 to 4 tubes; SI units, innermost tube first.")
      .def(nb::new_(&new_model), "tubes"_a, "parameters"_a, "effects"_a.none() = nb::none(),
           "`parameters`: those of robot_parameters() that are of tubes and gravity; `effects`: values of "
           "effect_parameters(), None: the "
           "standard model.")
      .def("predict", &predict, nb::kw_only(), "beta"_a, "alpha"_a, "force"_a.none() = nb::none(),
           "moment"_a.none() = nb::none(), "integrator"_a = Integrator::standard, "steps"_a = 1, "tip_of"_a = 0,
           "threads"_a = 0, "derivatives"_a = false, "by_parameters"_a = std::vector<int>{},
           "Poses of the tip of tube `tip_of` (0: innermost) at M configurations, NaN where not solved.\n\n"
           "beta, alpha (M, N) [m], [rad]; force, moment (M, 3) at the robot tip [N], [N m], base frame. Returns "
           "(position (M, 3) [m], quaternion (M, 4) w first, status (M,), stability (M,), jacobian (M, 6 * 2N), "
           "compliance (M, 36), by_parameters (M, 6 * P)), the last three empty without `derivatives`. "
           "`by_parameters`: numbers of parameters of tubes, gravity and, after those of the robot, effects. Releases "
           "the GIL. Raises ValueError where the arrays do not fit.")
      .def("shapes", &shapes, nb::kw_only(), "beta"_a, "alpha"_a, "force"_a.none() = nb::none(),
           "moment"_a.none() = nb::none(), "points"_a, "steps"_a = 1, "all"_a = false,
           "The shape at one configuration, arrays of one row as for predict(), at K arc lengths: `points` uniform "
           "ones and every breakpoint. With `all` those of every stable equilibrium that is found, which may be "
           "none.\n\n"
           "Returns a list of (status, stability, arc_length (K,), position (K, 3), quaternion (K, 4), internal force "
           "and moment (K, 3), tube_angle (N, K), tube_curvature and tube_moment (N, 3K)). Raises ValueError where "
           "the arrays do not fit.");
  bind_calibration(m);
  bind_identify(m);
  bind_recording(m);
  bind_effects(m);
  bind_control(m);
}
