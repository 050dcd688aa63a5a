"""The robot of the paper's Table II, without its transmission and tracker."""

from ctcr.robot.description import Actuation, Robot, Tracker, Tube, Uncertainty


def table_ii():
    """The robot of the paper's Table II."""

    def tube(inner: float, outer: float, length: float, curvature: float) -> Tube:
        return Tube(
            youngs_modulus_GPa=58.0,
            poisson_ratio=0.3,
            density_kg_m3=6450.0,
            inner_diameter_mm=inner,
            outer_diameter_mm=outer,
            length_mm=length,
            curved_length_mm=50.0,
            curvature_per_m=curvature,
        )

    return Robot(
        name="Table II",
        gravity=None,
        tubes=[tube(1.3, 1.52, 463.0, 10.0), tube(1.62, 1.8, 330.5, 5.0), tube(2.03, 2.35, 199.0, 7.0)],
        actuation=Actuation.model_construct(),
        tracker=Tracker.model_construct(sensor_on_tube=1),
        uncertainty=Uncertainty.model_construct(),
    )
