// Model: numpy arrays in and out. Arrays are taken as they are (float64, C-contiguous) or refused; ctcr.model converts.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>

#include <ctcr/core/status.hpp>
#include <ctcr/robot/parameters.hpp>
#include <optional>
#include <string>
#include <vector>

#include "any_model.hpp"
#include "with_tubes.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {
namespace {

template <class T, class... Shape>
using Array = nb::ndarray<nb::numpy, T, nb::c_contig, nb::device::cpu, Shape...>;
using Vector = Array<const double, nb::ndim<1>>;
using Matrix = Array<const double, nb::ndim<2>>;
using Triple = Array<const double, nb::shape<3>>;
using Triples = Array<const double, nb::shape<-1, 3>>;

constexpr int max_tubes = 4;
constexpr std::size_t tube_parameters = ParameterVector<2>::robot_count - ParameterVector<1>::robot_count;

void require(bool condition, const std::string& message) {
  if (!condition) throw nb::value_error(message.c_str());
}

/// The model with the number of tubes that the arrays must have.
class BoundModel {
public:
  BoundModel(const Vector& youngs_modulus, const Vector& poisson_ratio, const Vector& density,
             const Vector& inner_diameter, const Vector& outer_diameter, const Vector& length,
             const Vector& curved_length, const Vector& curvature, const Vector& bending_stiffness,
             const Triple& gravity)
    : tubes_(youngs_modulus.shape(0)) {
    for (const Vector* property : {&poisson_ratio, &density, &inner_diameter, &outer_diameter, &length, &curved_length,
                                   &curvature, &bending_stiffness})
      require(property->shape(0) == tubes_, "every tube property needs one value a tube");
    std::vector<Tube> tubes;
    for (std::size_t i = 0; i < tubes_; ++i)
      tubes.push_back({.youngs_modulus = youngs_modulus(i),
                       .poisson_ratio = poisson_ratio(i),
                       .density = density(i),
                       .inner_diameter = inner_diameter(i),
                       .outer_diameter = outer_diameter(i),
                       .length = length(i),
                       .curved_length = curved_length(i),
                       .curvature = curvature(i),
                       .bending_stiffness = bending_stiffness(i)});
    model_ = with_tubes(std::ptrdiff_t(tubes_),
                        [&](auto n) { return make_model<n>(tubes, Vec3(gravity(0), gravity(1), gravity(2))); });
  }

  void predict(const Matrix& beta, const Matrix& alpha, const std::optional<Triples>& force,
               const std::optional<Triples>& moment, const Array<double, nb::shape<-1, 3>>& position,
               const Array<double, nb::shape<-1, 4>>& quaternion, const Array<std::uint8_t, nb::ndim<1>>& status,
               const Array<double, nb::ndim<1>>& stability,
               const std::optional<Array<double, nb::shape<-1, 6, -1>>>& jacobian,
               const std::optional<Array<double, nb::shape<-1, 6, 6>>>& compliance,
               const std::optional<Array<double, nb::shape<-1, 6, -1>>>& by_parameters, Integrator integrator,
               int steps, int tip_of, int threads) const {
    const std::size_t count = beta.shape(0);
    require(beta.shape(1) == tubes_ && alpha.shape(1) == tubes_, "beta and alpha need one column a tube");
    require(!jacobian || jacobian->shape(2) == 2 * tubes_, "jacobian needs two columns a tube");
    require(jacobian.has_value() == compliance.has_value(), "jacobian and compliance come together");
    require(!by_parameters || jacobian, "by_parameters comes with jacobian and compliance");
    require(!by_parameters || by_parameters->shape(2) == tubes_ * tube_parameters + 3,
            "by_parameters needs a column for each parameter of the tubes and of gravity");
    require(!jacobian || integrator == Integrator::standard, "derivatives need the default integrator");
    require(alpha.shape(0) == count && (!force || force->shape(0) == count) && (!moment || moment->shape(0) == count) &&
                position.shape(0) == count && quaternion.shape(0) == count && status.shape(0) == count &&
                stability.shape(0) == count && (!jacobian || jacobian->shape(0) == count) &&
                (!compliance || compliance->shape(0) == count) && (!by_parameters || by_parameters->shape(0) == count),
            "all arrays need the same number of rows");
    require(tip_of >= 0 && std::size_t(tip_of) < tubes_, "tip_of is the number of a tube, from 0");
    require(steps >= 1, "steps must be at least 1");
    const Rows rows{std::ptrdiff_t(count), beta.data(), alpha.data(), force ? force->data() : nullptr,
                    moment ? moment->data() : nullptr};
    const Answers answers{position.data(),
                          quaternion.data(),
                          status.data(),
                          stability.data(),
                          jacobian ? jacobian->data() : nullptr,
                          compliance ? compliance->data() : nullptr,
                          by_parameters ? by_parameters->data() : nullptr};
    const nb::gil_scoped_release released;
    model_->predict(rows, answers, {.integrator = integrator, .steps = steps, .tip_of = tip_of, .threads = threads});
  }

  std::pair<Status, std::size_t> shape(
      const Vector& beta, const Vector& alpha, const Triple& force, const Triple& moment, std::size_t points, int steps,
      const Array<double, nb::ndim<1>>& arc_length, const Array<double, nb::shape<-1, 3>>& position,
      const Array<double, nb::shape<-1, 4>>& quaternion, const Array<double, nb::shape<-1, 3>>& internal_force,
      const Array<double, nb::shape<-1, 3>>& internal_moment, const Array<double, nb::ndim<2>>& tube_angle,
      const Array<double, nb::shape<-1, -1, 3>>& tube_curvature,
      const Array<double, nb::shape<-1, -1, 3>>& tube_moment) const {
    const std::size_t room = arc_length.shape(0);
    require(beta.shape(0) == tubes_ && alpha.shape(0) == tubes_, "beta and alpha need one value a tube");
    require(points >= 2 && room >= points + 2 * tubes_, "points must be at least 2, and arrays need room for 2N more");
    require(position.shape(0) == room && quaternion.shape(0) == room && internal_force.shape(0) == room &&
                internal_moment.shape(0) == room && tube_angle.shape(0) == tubes_ && tube_angle.shape(1) == room &&
                tube_curvature.shape(0) == tubes_ && tube_curvature.shape(1) == room &&
                tube_moment.shape(0) == tubes_ && tube_moment.shape(1) == room,
            "all arrays need the same number of places");
    require(steps >= 1, "steps must be at least 1");
    return model_->shape({1, beta.data(), alpha.data(), force.data(), moment.data()}, points, steps,
                         {room, arc_length.data(), position.data(), quaternion.data(), internal_force.data(),
                          internal_moment.data(), tube_angle.data(), tube_curvature.data(), tube_moment.data()});
  }

private:
  std::size_t tubes_;
  std::unique_ptr<AnyModel> model_;
};

}  // namespace
}  // namespace ctcr::python

namespace ctcr::python {
void bind_calibration(nb::module_& m);
void bind_identify(nb::module_& m);
void bind_effects(nb::module_& m);
void bind_control(nb::module_& m);
void bind_recording(nb::module_& m);
}  // namespace ctcr::python

NB_MODULE(_core, m) {
  using ctcr::Status;
  using ctcr::python::BoundModel;
  using ctcr::python::Integrator;
  m.doc() = "The compiled model. Use ctcr.model, which converts and checks.";
  m.attr("MAX_TUBES") = ctcr::python::max_tubes;

  nb::enum_<Status>(m, "Status", nb::is_arithmetic())
      .value("ok", Status::ok)
      .value("joints_out_of_order", Status::joints_out_of_order)
      .value("tip_behind_plate", Status::tip_behind_plate)
      .value("not_converged", Status::not_converged)
      .value("singular", Status::singular)
      .value("not_finite", Status::not_finite);
  nb::enum_<Integrator>(m, "Integrator")
      .value("standard", Integrator::standard)
      .value("ssp_rk3", Integrator::ssp_rk3)
      .value("classical_rk4", Integrator::classical_rk4)
      .value("prince_dormand8", Integrator::prince_dormand8);
  m.def("status_text", [](Status status) { return ctcr::to_string(status); }, "status"_a, "A status in plain words.");

  nb::class_<BoundModel>(m, "Model", "Kinetostatic model of 1 to 4 tubes; SI units, innermost tube first.")
      .def(nb::init<const ctcr::python::Vector&, const ctcr::python::Vector&, const ctcr::python::Vector&,
                    const ctcr::python::Vector&, const ctcr::python::Vector&, const ctcr::python::Vector&,
                    const ctcr::python::Vector&, const ctcr::python::Vector&, const ctcr::python::Vector&,
                    const ctcr::python::Triple&>(),
           nb::kw_only(), "youngs_modulus"_a.noconvert(), "poisson_ratio"_a.noconvert(), "density"_a.noconvert(),
           "inner_diameter"_a.noconvert(), "outer_diameter"_a.noconvert(), "length"_a.noconvert(),
           "curved_length"_a.noconvert(), "curvature"_a.noconvert(), "bending_stiffness"_a.noconvert(),
           "gravity"_a.noconvert())
      .def("predict", &BoundModel::predict, nb::kw_only(), "beta"_a.noconvert(), "alpha"_a.noconvert(),
           "force"_a.noconvert().none(), "moment"_a.noconvert().none(), "position"_a.noconvert(),
           "quaternion"_a.noconvert(), "status"_a.noconvert(), "stability"_a.noconvert(),
           "jacobian"_a.noconvert().none(), "compliance"_a.noconvert().none(),
           "by_parameters"_a.noconvert().none() = nb::none(), "integrator"_a = Integrator::standard, "steps"_a = 1,
           "tip_of"_a = 0, "threads"_a = 0,
           "Solves all rows and writes the answers into the given arrays. Releases the GIL.")
      .def("shape", &BoundModel::shape, nb::kw_only(), "beta"_a.noconvert(), "alpha"_a.noconvert(),
           "force"_a.noconvert(), "moment"_a.noconvert(), "points"_a, "steps"_a, "arc_length"_a.noconvert(),
           "position"_a.noconvert(), "quaternion"_a.noconvert(), "internal_force"_a.noconvert(),
           "internal_moment"_a.noconvert(), "tube_angle"_a.noconvert(), "tube_curvature"_a.noconvert(),
           "tube_moment"_a.noconvert(),
           "Writes the shape into the given arrays; returns the status and the number of places written.");
  ctcr::python::bind_calibration(m);
  ctcr::python::bind_identify(m);
  ctcr::python::bind_recording(m);
  ctcr::python::bind_effects(m);
  ctcr::python::bind_control(m);
}
