"""The robot of the paper's Table II, without its transmission and tracker."""

from ctcr.robot.description import Actuation, Robot, Tracker, Tube, Uncertainty


def table_ii() -> Robot:
    """The robot of the paper's Table II."""
    common = {"youngs_modulus_GPa": 58.0, "poisson_ratio": 0.3, "density_kg_m3": 6450.0, "curved_length_mm": 50.0}
    names = ("inner_diameter_mm", "outer_diameter_mm", "length_mm", "curvature_per_m")
    values = ((1.3, 1.52, 463.0, 10.0), (1.62, 1.8, 330.5, 5.0), (2.03, 2.35, 199.0, 7.0))
    return Robot(
        name="Table II",
        gravity=None,
        tubes=[Tube(**common, **dict(zip(names, tube, strict=True))) for tube in values],
        actuation=Actuation.model_construct(),
        tracker=Tracker.model_construct(sensor_on_tube=1),
        uncertainty=Uncertainty.model_construct(),
    )
