"""Facts of effects for a compiled module that was built before it had them. Delete this file with the next build."""

from types import SimpleNamespace

from ctcr import _core

_SOURCE = ("metal_volume", "metal_x", "metal_y", "metal_z", "coils_x", "coils_y", "coils_z")
_VARIANTS = {
    "friction": [["coefficient"], ["torque_per_length"]],
    "tip_load": [["mass"], ["force_x", "force_y", "force_z"]],
    "precurvature_profile": [["linear"], ["quadratic"], ["linear", "quadratic"], ["linear", "quadratic", "cubic"]],
    "straight_curvature": [["bend_x"], ["bend_x", "bend_y"]],
    "sensor_offset": [["x", "y", "z"], ["x", "y", "z", "turn_x", "turn_y", "turn_z"]],
}
_STARTS = {"friction": [{"law": 1.0, "slip_angle": 0.03}, {"insertion": 0.0}], "delay": [{"spread": 0.5}]}
_QUANTITIES = {"delay.delay": "lag", "frame_jump.when": "moment"}
_QUANTITIES |= {f"contact.{name}": "surface" for name in ("distance", "azimuth", "elevation")}
_QUANTITIES |= {f"tip_load.force_{axis}": "tip_force" for axis in "xyz"}
_QUANTITIES |= {f"field_distortion.{name}": "source" for name in _SOURCE}
_READING = ("sensor_offset", "field_distortion", "frame_drift", "frame_jump")


def _with(item, **facts):
    kept = {name: getattr(item, name) for name in dir(item) if not name.startswith("_")}
    return SimpleNamespace(**kept | facts)


if not hasattr(_core.CatalogueEntry, "variants"):
    _parameters, _catalogue = _core.effect_parameters, _core.effect_catalogue

    def parameters(tubes):
        return [_with(p, quantity=_QUANTITIES.get(f"{p.effect}.{p.name}", "other")) for p in _parameters(tubes)]

    def entries():
        amplitudes: dict[str, list[str]] = {}
        for p in _parameters(1):
            if p.kind == "strength":
                amplitudes.setdefault(p.effect, []).append(p.name)
        of_field = [p.name for p in _parameters(1) if p.effect == "field_distortion" and p.name not in _SOURCE]
        field = [["scale"], amplitudes["field_distortion"], list(_SOURCE), of_field]
        known = _VARIANTS | {"field_distortion": field}
        return [
            _with(
                e,
                acts_on=["reading"] if e.id in _READING else ["rod"],
                variants=known.get(e.id, [amplitudes[e.id]]),
                starts=_STARTS.get(e.id, []),
            )
            for e in _catalogue()
        ]

    _core.effect_parameters, _core.effect_catalogue = parameters, entries
