"""Effects fitted to measurements together with the calibration."""

from dataclasses import replace
from pathlib import Path

import ctcr
import numpy as np
import pytest
from ctcr.diagnose import add, terminal
from ctcr.effects import catalogue
from ctcr.fit.folds import held_out_rows
from ctcr.model import recording, simulation, table_poses
from ctcr.robot import robot_file
from ctcr.show import output

ROBOT = Path(__file__).parents[3] / "examples" / "robots" / "table2.yaml"
CALIBRATION = ["tubes.*.curvature", "actuation.home_rotation.*", "tracker.position.*"]


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROBOT)


@pytest.mark.parametrize(
    "given",
    [{"sensor_offset__x": "0.001"}, {"backlash_rotation": "0.01,0.02,0.01"}, {"anisotropy__along": "0.05,-0.05,0.05"}],
    ids=lambda given: next(iter(given)),
)
def test_hidden_effect(robot, plan, given, hidden):
    """Values are found within their uncertainty, and the error is judged on held-out runs."""
    true = hidden(robot, **given)
    (identity,) = true.effects
    made = simulation.simulate(true, plan, "jitter", seed=1)
    added = add.add(robot, made, [identity], free=CALIBRATION)
    value_of = catalogue.value_of(true)
    for name, found in added.parameters().items():
        assert abs(found["value"] - value_of[name]) < 3 * found["sd"] + 1e-12, name
    rms = added.rms("rms_mm")
    assert list(rms) == ["nominal", "calibrated", identity, "noise_floor"]
    assert rms[identity] < 0.7 * rms["calibrated"]
    locked = np.unique(made.run[held_out_rows(robot, made)])
    assert added.held_out == f"runs {', '.join(map(str, locked))}" and len(locked) == 2


def effects_to_find(robot, plan) -> dict[str, dict[str, float]]:
    """Effects whose start a search finds: a moment, a plane, a source of field beside the tracker."""
    tips = ctcr.Model(robot).predict(plan.beta, plan.alpha, plan.force).position
    read = table_poses.readings(robot, plan).position
    normal = np.array([np.cos(0.5) * np.cos(1.2), np.cos(0.5) * np.sin(1.2), np.sin(0.5)])
    metal = read.mean(axis=0) + 1.1 * np.ptp(read, axis=0).max() * np.array([0.6, -0.64, 0.48])
    return {
        "frame_jump": {"x": 4e-4, "y": -3e-4, "when": 0.371},
        "contact": {"stiffness": 20.0, "azimuth": 1.2, "elevation": 0.5, "distance": np.quantile(tips @ normal, 0.6)},
        "field_distortion": {"metal_volume": 1e-4} | dict(zip(("metal_x", "metal_y", "metal_z"), metal, strict=True)),
    }


@pytest.mark.parametrize("identity", ["frame_jump", "contact", "field_distortion"])
def test_search(robot, plan, identity):
    """The moment of a jump, the plane of a contact and the position of metal need not be given."""
    given = {f"effects.{identity}.{name}": x for name, x in effects_to_find(robot, plan)[identity].items()}
    made = simulation.simulate(catalogue.with_values(robot, [identity], given), plan, "jitter", seed=1)
    added = add.add(robot, made, [identity], free=CALIBRATION)
    rms = added.rms("rms_mm")
    assert rms["calibrated"] > 1.5 * rms["noise_floor"]
    assert rms[identity] < 1.25 * rms["noise_floor"]
    if identity == "frame_jump":
        part = recording.session_part(made)
        np.testing.assert_array_equal(part > added.robot.effects["frame_jump"]["when"], part > 0.371)


def test_given_start(robot, plan, hidden):
    """A fit that starts where a diagnosis ended converges to the same values; errors without the effect stay."""
    true = hidden(robot, softening__gamma="0.004,0.004,0.004", softening__sharpness="5")
    made = simulation.simulate(true, plan, "jitter", seed=1)
    there = {name: value for name, value in catalogue.value_of(true).items() if ".softening." in name}
    alone, begun = (add.add(robot, made, ["softening"], start=start, free=CALIBRATION) for start in (None, there))
    for name in ("nominal", "calibrated"):
        assert begun.rms("rms_mm")[name] == pytest.approx(alone.rms("rms_mm")[name], rel=1e-9)
    for name, found in begun.parameters().items():
        assert abs(found["value"] - alone.parameters()[name]["value"]) < 0.5 * found["sd"], name


def test_notices(robot, plan):
    """A notice names an effect that the data do not determine; a single run is judged on blocks of time."""
    timeless = replace(simulation.simulate(robot, plan, "jitter"), t=np.full(len(plan), np.nan))
    one_run = replace(timeless, run=0 * plan.run)
    added = add.add(robot, one_run, ["delay"], free=["tracker.position.*"])
    assert any("do not determine delay" in notice for notice in added.notices)
    assert added.held_out == "one of every four blocks of time" and np.isfinite(added.rms("rms_mm")["delay"])


def test_no_smaller_held_out_error(robot, plan, hidden):
    """An effect with which held-out runs are predicted no better is named with both errors, and only such a one."""
    made = simulation.simulate(hidden(robot, backlash_rotation="0.02,0.02,0.02"), plan, "jitter", seed=1)
    ids = ["backlash_rotation", "field_distortion", "creep"]
    added = add.add(robot, made, ids, free=CALIBRATION)
    rms = list(added.rms("rms_mm").values())[1:]
    worse = [k for k, identity in enumerate(ids) if rms[k + 1] >= rms[k]]
    assert worse and 0 not in worse
    for k, identity in enumerate(ids):
        text = f"{identity} does not lower the error on held-out readings: {rms[k]:.3f} mm without it, {rms[k + 1]:.3f}"
        assert any(notice.startswith(text) for notice in added.notices) == (k in worse)


def test_fitted_on_terminal(capsys):
    """All parameters of a small effect are shown; of a field of many terms the clearest, and how many are not."""
    field = catalogue.get("field_distortion", 3)
    many = [(name, 1e-4 * (k % 7), 1e-4) for k, name in enumerate(field.names())]
    console = output.console(None)
    terminal.show_fitted(console, 3, [("tracker.position.x", 0.1, 0.1), ("effects.delay.delay", 0.0606, 0.0015), *many])
    out = capsys.readouterr().out
    assert "Fitted: delay (SI)" in out and "0.0606" in out and "tracker" not in out.split("Fitted: field")[0]
    told = [line.split()[0] for line in out.split("Fitted: field_distortion")[1].splitlines() if line.strip()]
    names = [p.name for p in field.parameters]
    shown = [name for name in names if name in told]
    assert {"metal_volume", "metal_x", "coils_z", "scale"} < set(shown) and len(shown) < 25
    assert f"and {len(names) - len(shown)} coefficients" in out
