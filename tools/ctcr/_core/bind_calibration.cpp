// The paper's calibration procedures: numpy arrays in, read-only results out, SI units. Refused input is a ValueError.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <ctcr/calibration/procedures/cantilever.hpp>
#include <ctcr/calibration/procedures/home.hpp>
#include <ctcr/calibration/procedures/registration.hpp>
#include <ctcr/calibration/procedures/rotation_offset.hpp>
#include <ctcr/calibration/procedures/tube_shape.hpp>

namespace nb = nanobind;
using namespace nb::literals;

namespace ctcr::python {
namespace {

template <class T, class... Shape>
using Array = nb::ndarray<nb::numpy, T, nb::c_contig, nb::device::cpu, Shape...>;
using Vector = Array<const double, nb::ndim<1>>;
using Signs = Array<const std::int8_t, nb::ndim<1>>;
using Triple = Array<const double, nb::shape<3>>;
using Triples = Array<const double, nb::shape<-1, 3>>;
using Pairs = Array<const double, nb::shape<-1, 2>>;
using Transform = Array<const double, nb::shape<4, 4>>;
using Rows3 = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Matrix4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
using Matrix6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

/// A notice of any procedure, as Python sees it.
struct AnyNotice {
  std::string kind;
  double value, limit;
  std::string text;
};

template <class Result>
std::vector<AnyNotice> notices_of(const Result& result) {
  std::vector<AnyNotice> all;
  for (const auto& notice : result.notices)
    all.push_back({to_string(notice.kind), notice.value, notice.limit, notice.text});
  return all;
}

Vec3 row(const Triples& array, std::size_t i) { return {array(i, 0), array(i, 1), array(i, 2)}; }
std::optional<Vec3> optional_vector(const std::optional<Triple>& array) {
  return array ? std::optional<Vec3>(Vec3((*array)(0), (*array)(1), (*array)(2))) : std::nullopt;
}

Pose pose_of(const Transform& T) {
  Pose pose;
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index j = 0; j < 3; ++j) pose.rotation(i, j) = T(i, j);
    pose.position[i] = T(i, 3);
  }
  require((pose.rotation * pose.rotation.transpose() - Mat3::Identity()).norm() < 1e-6 &&
              pose.rotation.determinant() > 0 && pose.position.allFinite(),
          "T_ref must be a rigid transform: rotation in its upper left 3 x 3, position [m] in its last column");
  return pose;
}

Matrix4 matrix_of(const Pose& pose) {
  Matrix4 T = Matrix4::Identity();
  T.topLeftCorner<3, 3>() = pose.rotation;
  T.topRightCorner<3, 1>() = pose.position;
  return T;
}

Rows3 rows_of(const std::vector<Vec3>& vectors) {
  Rows3 rows(Eigen::Index(vectors.size()), 3);
  for (Eigen::Index i = 0; i < rows.rows(); ++i) rows.row(i) = vectors[std::size_t(i)];
  return rows;
}

/// A number of every tube as an array.
template <double HomeOffset::* field>
Eigen::VectorXd of_tubes(const Home& home) {
  Eigen::VectorXd values(Eigen::Index(home.tubes.size()));
  for (Eigen::Index i = 0; i < values.size(); ++i) values[i] = home.tubes[std::size_t(i)].*field;
  return values;
}

template <class T>
Eigen::VectorXd array_of(const std::vector<T>& values) {
  Eigen::VectorXd array(Eigen::Index(values.size()));
  for (Eigen::Index i = 0; i < array.size(); ++i) array[i] = values[std::size_t(i)];
  return array;
}

Noise position_noise(double jitter, double field_error, double field_length) {
  require(jitter >= 0 && field_error >= 0 && field_length > 0,
          "jitter and field error must not be negative, the field's length must be positive [m]");
  return {.position_jitter = jitter, .position_field = field_error, .correlation_length = field_length};
}

RotationOffset rotation_offset_of(const Vector& motor_angle, const Triples& position, double ratio,
                                  const std::optional<Signs>& direction, const std::optional<Transform>& T_ref,
                                  const std::optional<Triple>& centre, const std::optional<double>& radius,
                                  const std::optional<Triple>& normal, double bend_angle, double jitter,
                                  double field_error, double field_length, double wanted_sd) {
  const std::size_t count = motor_angle.shape(0);
  require(position.shape(0) == count && (!direction || direction->shape(0) == count),
          "motor_angle, position and direction need the same number of rows");
  std::vector<TurnReading> readings;
  for (std::size_t i = 0; i < count; ++i)
    readings.push_back({motor_angle(i), row(position, i), direction ? (*direction)(i) : 0});
  RotationOffsetOptions options{.ratio = ratio,
                                .known = {optional_vector(centre), radius, optional_vector(normal)},
                                .bend_angle = bend_angle,
                                .noise = position_noise(jitter, field_error, field_length),
                                .wanted_sd = wanted_sd};
  if (T_ref) options.T_tracker_base = pose_of(*T_ref);
  const nb::gil_scoped_release released;
  return fit_rotation_offset(readings, options);
}

/// A registration with what belongs to the call.
struct BoundRegistration {
  Registration result;
  std::vector<std::string> names;
  std::vector<double> counts, target_errors;
};

BoundRegistration registration_of(const std::vector<std::string>& names, const Triples& cad,
                                  const std::vector<std::string>& reading_names, const Triples& readings,
                                  const std::optional<Triples>& targets, double jitter, double placement_sd,
                                  double field_error, double field_length, double loss_scale) {
  require(cad.shape(0) == names.size(), "names and cad need the same number of rows");
  require(readings.shape(0) == reading_names.size(), "reading_names and readings need the same number of rows");
  require(placement_sd >= 0 && loss_scale >= 0, "placement_sd and loss_scale must not be negative [m]");
  std::vector<Fiducial> points;
  for (std::size_t i = 0; i < names.size(); ++i) points.push_back({names[i], row(cad, i)});
  for (std::size_t i = 0; i < reading_names.size(); ++i) {
    const auto point =
        std::find_if(points.begin(), points.end(), [&](const Fiducial& p) { return p.name == reading_names[i]; });
    require(point != points.end(), "reading %zu is of '%s', which no point of the CAD is named", i + 1,
            reading_names[i].c_str());
    point->readings.push_back(row(readings, i));
  }
  BoundRegistration bound{.result = register_points(points, {.noise = position_noise(jitter, field_error, field_length),
                                                             .placement_sd = placement_sd,
                                                             .loss_scale = loss_scale}),
                          .names = names,
                          .counts = {},
                          .target_errors = {}};
  for (const Fiducial& point : points) bound.counts.push_back(double(point.readings.size()));
  for (std::size_t i = 0; targets && i < targets->shape(0); ++i)
    bound.target_errors.push_back(bound.result.target_error(row(*targets, i)));
  return bound;
}

Cantilever cantilever_of(const Vector& load, const Vector& deflection, const Vector& free_length,
                         const std::optional<Vector>& load_distance, double inner_diameter, double outer_diameter,
                         double deflection_sd, double free_length_sd, double diameter_sd, bool fit_zero) {
  const std::size_t count = load.shape(0);
  require(deflection.shape(0) == count && free_length.shape(0) == count &&
              (!load_distance || load_distance->shape(0) == count),
          "load, deflection, free_length and load_distance need the same number of rows");
  std::vector<Deflection> rows;
  for (std::size_t i = 0; i < count; ++i)
    rows.push_back({load(i), deflection(i), free_length(i), load_distance ? (*load_distance)(i) : 0});
  return fit_cantilever(rows, {.inner_diameter = inner_diameter,
                               .outer_diameter = outer_diameter,
                               .deflection_sd = deflection_sd,
                               .free_length_sd = free_length_sd,
                               .diameter_sd = diameter_sd,
                               .fit_zero = fit_zero});
}

TubeShapeFit tube_shape_of(const Pairs& points, const std::optional<double>& scale, double scale_sd,
                           const std::optional<Array<const double, nb::shape<2, 2>>>& reference,
                           const std::optional<double>& reference_length, double point_sd) {
  require(scale.has_value() != (reference.has_value() && reference_length.has_value()),
          "give either the scale [m per unit], or two reference points and the distance between them [m]");
  TubeShapeOptions options{.scale_sd = scale_sd, .point_sd = point_sd};
  if (scale) {
    options.scale = *scale;
  } else {
    const auto& r = *reference;
    options.scale = picture_scale({r(0, 0), r(0, 1)}, {r(1, 0), r(1, 1)}, *reference_length);
  }
  std::vector<Eigen::Vector2d> all;
  for (std::size_t i = 0; i < points.shape(0); ++i) all.emplace_back(points(i, 0), points(i, 1));
  const nb::gil_scoped_release released;
  return fit_tube_shape(all, options);
}

void bind_rotation_offset(nb::module_& m) {
  nb::class_<RotationOffset>(m, "RotationOffset", "The rotation offset of a tube and the circle it was found on.")
      .def_ro("offset", &RotationOffset::offset, "alpha = ratio * motor_angle + offset [rad]")
      .def_ro("offset_sd", &RotationOffset::offset_sd)
      .def_ro("offset_forward", &RotationOffset::forward)
      .def_ro("offset_forward_sd", &RotationOffset::forward_sd)
      .def_ro("offset_backward", &RotationOffset::backward)
      .def_ro("offset_backward_sd", &RotationOffset::backward_sd)
      .def_ro("direction_difference", &RotationOffset::difference, "forward - backward [rad]")
      .def_ro("direction_difference_sd", &RotationOffset::difference_sd)
      .def_ro("radius", &RotationOffset::radius, "[m]")
      .def_ro("radius_sd", &RotationOffset::radius_sd)
      .def_ro("centre", &RotationOffset::centre, "[m], base frame, or tracker frame without T_ref")
      .def_ro("centre_sd", &RotationOffset::centre_sd)
      .def_ro("normal", &RotationOffset::normal)
      .def_ro("tilt_sd", &RotationOffset::tilt_sd, "of the normal [rad]")
      .def_ro("zero_axis", &RotationOffset::zero_axis, "where the tube's x axis points at alpha = 0")
      .def_ro("in_base_frame", &RotationOffset::in_base_frame)
      .def_ro("rms", &RotationOffset::rms, "[m]")
      .def_ro("radial_rms", &RotationOffset::radial_rms)
      .def_ro("tangential_rms", &RotationOffset::tangential_rms)
      .def_ro("out_of_plane_rms", &RotationOffset::out_of_plane_rms)
      .def_ro("noise_sd", &RotationOffset::noise_sd, "per axis [m]")
      .def_ro("arc", &RotationOffset::arc, "covered by readings [rad]")
      .def_ro("outliers", &RotationOffset::outliers)
      .def_prop_ro("used", [](const RotationOffset& r) { return r.residuals.size() - r.outliers.size(); })
      .def_prop_ro(
          "residuals", [](const RotationOffset& r) { return rows_of(r.residuals); }, "measured - circle [m]")
      .def_prop_ro("notices", &notices_of<RotationOffset>);
  const RotationOffsetOptions usual;
  m.def("fit_rotation_offset", &rotation_offset_of, nb::kw_only(), "motor_angle"_a.noconvert(),
        "position"_a.noconvert(), "ratio"_a, "direction"_a.noconvert().none() = nb::none(),
        "T_ref"_a.noconvert().none() = nb::none(), "centre"_a.noconvert().none() = nb::none(),
        "radius"_a.none() = nb::none(), "normal"_a.noconvert().none() = nb::none(), "bend_angle"_a = usual.bend_angle,
        "jitter"_a = 0.0, "field_error"_a = 0.0, "field_length"_a = 0.1, "wanted_sd"_a = usual.wanted_sd,
        "Rotation offset of a tube that turns alone, from its motor angle [rad] and tip [m], tracker frame.");
}

void bind_registration(nb::module_& m) {
  nb::class_<BoundRegistration>(m, "Registration", "T_ref from named points, and how well it is known.")
      .def_prop_ro("T_ref", [](const BoundRegistration& r) { return matrix_of(r.result.T_tracker_base); })
      .def_prop_ro(
          "covariance", [](const BoundRegistration& r) { return Matrix6(r.result.covariance); },
          "of the base frame's origin [m] and its rotation about it [rad], tracker axes")
      .def_prop_ro(
          "position_sd",
          [](const BoundRegistration& r) -> Vec3 { return r.result.covariance.diagonal().head<3>().cwiseSqrt(); })
      .def_prop_ro(
          "rotation_sd",
          [](const BoundRegistration& r) -> Vec3 { return r.result.covariance.diagonal().tail<3>().cwiseSqrt(); })
      .def_prop_ro(
          "fre", [](const BoundRegistration& r) { return r.result.fre; }, "RMS of the points used [m]")
      .def_prop_ro(
          "fle", [](const BoundRegistration& r) { return r.result.fle; }, "sd of a point per axis [m]")
      .def_prop_ro("degrees_of_freedom", [](const BoundRegistration& r) { return r.result.degrees_of_freedom; })
      .def_prop_ro("repeatability_sd", [](const BoundRegistration& r) { return r.result.repeatability_sd; })
      .def_prop_ro(
          "residuals", [](const BoundRegistration& r) { return rows_of(r.result.residuals); },
          "mean reading - T_ref cad [m], tracker axes")
      .def_prop_ro("outliers", [](const BoundRegistration& r) { return r.result.outliers; })
      .def_prop_ro(
          "tre", [](const BoundRegistration& r) { return array_of(r.target_errors); },
          "expected RMS error at each target [m]")
      .def_prop_ro(
          "counts", [](const BoundRegistration& r) { return array_of(r.counts); }, "readings of each point")
      .def_ro("names", &BoundRegistration::names)
      .def_prop_ro("notices", [](const BoundRegistration& r) { return notices_of(r.result); });
  m.def("register_points", &registration_of, nb::kw_only(), "names"_a, "cad"_a.noconvert(), "reading_names"_a,
        "readings"_a.noconvert(), "targets"_a.noconvert().none() = nb::none(), "jitter"_a = 0.0, "placement_sd"_a = 0.0,
        "field_error"_a = 0.0, "field_length"_a = 0.1, "loss_scale"_a = 0.0,
        "T_ref from CAD positions in the base frame and probe readings in the tracker frame [m].");
}

void bind_home(nb::module_& m) {
  nb::class_<TubeHome>(m, "TubeHome", "What was measured of one tube at home.")
      .def(
          "__init__",
          [](TubeHome* tube, double home_angle, std::vector<double> distances, std::vector<double> flush_angles,
             std::vector<double> lengths) {
            new (tube) TubeHome{home_angle, std::move(distances), std::move(flush_angles), std::move(lengths)};
          },
          nb::kw_only(), "home_angle"_a = 0.0, "distances"_a = std::vector<double>{},
          "flush_angles"_a = std::vector<double>{}, "lengths"_a = std::vector<double>{})
      .def_ro("home_angle", &TubeHome::home_angle)
      .def_ro("distances", &TubeHome::distances)
      .def_ro("flush_angles", &TubeHome::flush_angles)
      .def_ro("lengths", &TubeHome::lengths);
  nb::class_<Home>(m, "HomeOffsets", "Translational offsets and effective lengths, innermost tube first [m].")
      .def_prop_ro("offset", &of_tubes<&HomeOffset::offset>)
      .def_prop_ro("offset_sd", &of_tubes<&HomeOffset::offset_sd>)
      .def_prop_ro("length", &of_tubes<&HomeOffset::length>)
      .def_prop_ro("length_sd", &of_tubes<&HomeOffset::length_sd>)
      .def_prop_ro("correlation", &of_tubes<&HomeOffset::correlation>)
      .def_prop_ro("deployed", &of_tubes<&HomeOffset::deployed>)
      .def_prop_ro("deployed_sd", &of_tubes<&HomeOffset::deployed_sd>)
      .def_prop_ro("notices", &notices_of<Home>);
  const HomeOptions usual;
  m.def(
      "home_offsets",
      [](double translation_ratio, const std::vector<TubeHome>& tubes, double distance_sd, double flush_sd,
         double length_sd) { return home_offsets(tubes, {translation_ratio, distance_sd, flush_sd, length_sd}); },
      nb::kw_only(), "translation_ratio"_a, "tubes"_a, "distance_sd"_a = usual.distance_sd,
      "flush_sd"_a = usual.flush_sd, "length_sd"_a = usual.length_sd,
      "Translational offsets and effective lengths; translation_ratio in m/rad.");
}

void bind_cantilever(nb::module_& m) {
  nb::class_<Cantilever>(m, "Cantilever", "Young's modulus of a clamped tube.")
      .def_ro("youngs_modulus", &Cantilever::youngs_modulus, "[Pa]")
      .def_ro("youngs_modulus_sd", &Cantilever::youngs_modulus_sd)
      .def_ro("bending_stiffness", &Cantilever::bending_stiffness, "[N m^2]")
      .def_ro("bending_stiffness_sd", &Cantilever::bending_stiffness_sd)
      .def_ro("zero", &Cantilever::zero, "[m]")
      .def_ro("zero_sd", &Cantilever::zero_sd)
      .def_ro("rms", &Cantilever::rms, "[m]")
      .def_prop_ro(
          "residuals", [](const Cantilever& c) { return array_of(c.residuals); }, "[m]")
      .def_prop_ro(
          "slope_angle", [](const Cantilever& c) { return array_of(c.end_angle); }, "at the end [rad]")
      .def_prop_ro(
          "row_modulus", [](const Cantilever& c) { return array_of(c.row_modulus); }, "of each row alone [Pa]")
      .def_prop_ro("notices", &notices_of<Cantilever>);
  m.def("fit_cantilever", &cantilever_of, nb::kw_only(), "load"_a.noconvert(), "deflection"_a.noconvert(),
        "free_length"_a.noconvert(), "load_distance"_a.noconvert().none() = nb::none(), "inner_diameter"_a,
        "outer_diameter"_a, "deflection_sd"_a = 0.0, "free_length_sd"_a = 0.0, "diameter_sd"_a = 0.0,
        "fit_zero"_a = false, "Young's modulus from loads [N] and deflections [m] of a clamped tube.");
}

void bind_tube_shape(nb::module_& m) {
  nb::class_<TubeShapeFit>(m, "TubeShapeFit", "A straight line and an arc fitted to points of a tube.")
      .def_ro("curvature", &TubeShapeFit::curvature, "[1/m]")
      .def_ro("curvature_sd", &TubeShapeFit::curvature_sd)
      .def_ro("curved_length", &TubeShapeFit::curved_length, "[m]")
      .def_ro("curved_length_sd", &TubeShapeFit::curved_length_sd)
      .def_ro("correlation", &TubeShapeFit::correlation)
      .def_ro("straight_length", &TubeShapeFit::straight_length, "seen in the picture [m]")
      .def_prop_ro(
          "radius", [](const TubeShapeFit& t) { return 1 / t.curvature; }, "[m]")
      .def_ro("junction", &TubeShapeFit::junction, "unit of the points")
      .def_ro("heading", &TubeShapeFit::heading)
      .def_ro("tip", &TubeShapeFit::tip, "unit of the points")
      .def_ro("rms", &TubeShapeFit::rms, "[m]")
      .def_ro("noise_sd", &TubeShapeFit::noise_sd, "[m]")
      .def_prop_ro(
          "residuals", [](const TubeShapeFit& t) { return array_of(t.residuals); }, "[m]")
      .def_prop_ro(
          "arc_position", [](const TubeShapeFit& t) { return array_of(t.arc_position); }, "[m]")
      .def_ro("outliers", &TubeShapeFit::outliers)
      .def_prop_ro("notices", &notices_of<TubeShapeFit>);
  m.def("fit_tube_shape", &tube_shape_of, nb::kw_only(), "points"_a.noconvert(), "scale"_a.none() = nb::none(),
        "scale_sd"_a = 0.0, "reference"_a.noconvert().none() = nb::none(), "reference_length"_a.none() = nb::none(),
        "point_sd"_a = 0.0, "Curvature and curved length from points of a photo, in any order.");
}

}  // namespace

void bind_calibration(nb::module_& m) {
  nb::class_<AnyNotice>(m, "Notice", "Something that the user of a calibration should know.")
      .def_ro("kind", &AnyNotice::kind)
      .def_ro("value", &AnyNotice::value, "what it is about, SI")
      .def_ro("limit", &AnyNotice::limit, "what that was held against")
      .def_ro("text", &AnyNotice::text)
      .def("__repr__", [](const AnyNotice& n) { return "<" + n.kind + ": " + n.text + ">"; });
  bind_rotation_offset(m);
  bind_registration(m);
  bind_home(m);
  bind_cantilever(m);
  bind_tube_shape(m);
}

}  // namespace ctcr::python
