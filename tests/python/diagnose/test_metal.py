"""Metal beside the tracker: found with its place, in the axes and with the sign of the residual."""

from pathlib import Path

import numpy as np
import pytest
from ctcr import _core
from ctcr.diagnose import metal
from ctcr.diagnose.candidates import METAL, Candidate, candidates, forms
from ctcr.diagnose.engine import Engine
from ctcr.effects.catalogue import get
from ctcr.model import simulation
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file
from ctcr.table import measurements

DEMO = Path(__file__).parents[3] / "examples" / "data" / "demo"
STEM = "effects.field_distortion."
NAMES = tuple(STEM + name for name in METAL)


@pytest.fixture(scope="module")
def engine():
    robot = robot_file.load(DEMO / "robot.yaml")
    readings = measurements.load(DEMO / "measurements.csv", robot.n_tubes)
    readings = simulation.simulate(robot, readings, noise="none")
    rows = np.arange(len(readings)) % 3 > 0
    return Engine(robot, readings, noise_of_readings(robot, readings), rows, threads=1)


def found_from(engine, signal, jitter):
    """The piece that explains a residual (M, 6) best, against noise of sd `jitter` (6,)."""

    def worth(columns):
        column = (columns[:, :, 0] / jitter).ravel()
        square = 1 + column @ column
        return 0.5 * (column @ (signal / jitter).ravel()) ** 2 / square - 0.5 * np.log(square)

    [(candidate, columns)] = metal.piece(engine, Candidate("field_distortion", NAMES), worth)
    return np.array([dict(candidate.shape)[name] for name in NAMES[1:]]), columns


def test_derivatives(engine):
    """The piece is tried with the derivatives of the residual, in the right axes and with the right sign."""
    jitter = np.repeat([3e-5, 5e-4], 3)
    place, columns = found_from(engine, np.zeros((len(engine.measurements), 6)), jitter)
    table = engine.recording(NAMES)
    there = [table.residual(np.array([v, *place]))[0].reshape(-1, 6) for v in (-1e-7, 1e-7)]
    difference = (there[1] - there[0]) * (engine.priors(NAMES)[1][0] / 2e-7)
    size = np.abs(difference).max()
    np.testing.assert_allclose(columns[engine.rows, :, 0], difference[engine.rows], atol=1e-3 * size)
    assert (columns[~engine.rows] == 0).all() and size > 1e-6


@pytest.mark.parametrize("seed", range(6))
def test_search(engine, seed):
    """The global search finds a piece wherever it is beside the workspace."""
    rng = np.random.default_rng(seed)
    jitter = np.repeat([3e-5, 5e-4], 3)
    side = rng.standard_normal(3)
    reach = 0.06 + np.max((engine.positions - np.median(engine.positions, axis=0)) @ side) / np.linalg.norm(side)
    place = np.median(engine.positions, axis=0) + reach * side / np.linalg.norm(side)
    coils = rng.normal(0, 0.02, 3)
    signal = -3e-6 * _core.beside_metal(engine.positions - coils, place - coils)
    signal[~engine.rows] = 0
    found, columns = found_from(engine, signal, jitter)
    assert np.linalg.norm(found[:3] - place) < 0.015
    column, whole = (columns[:, :, 0] / jitter).ravel(), (signal / jitter).ravel()
    assert (column @ whole) ** 2 > 0.98 * (column @ column) * (whole @ whole)


def test_forms(engine):
    """A piece of metal enters alone; a field takes it up where its position was fitted before."""
    effect = get("field_distortion", engine.robot.n_tubes)
    fields = [c for c in candidates(engine.robot, engine.measurements)[0] if c.id == "field_distortion"]
    assert sum({*NAMES} <= {*candidate.names} for candidate in fields) == 1
    for candidate in fields:
        has_metal = {*NAMES} <= {*candidate.names}
        assert has_metal or not {*NAMES} & {*candidate.names}
        for aside in ((), NAMES):
            for form in forms(effect, candidate, aside):
                assert ({*NAMES} <= {*form.names}) == (has_metal or bool(aside))
