"""Where a candidate begins: a moment, a local source of field. Found by search, as no derivative leads there."""

from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ctcr import _core
from ctcr.diagnose import diagnose, starts
from ctcr.diagnose.candidates import Candidate, candidates, forms
from ctcr.diagnose.engine import Engine
from ctcr.effects.catalogue import get
from ctcr.fit.folds import groups, held_out_rows
from ctcr.model import recording, simulation
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file
from ctcr.table import measurements
from hidden_sessions import measured, measured_session, session

DEMO = Path(__file__).parents[3] / "examples" / "data" / "demo"
WHEN = "effects.frame_jump.when"
SOURCE = tuple(get("field_distortion").names_with("source"))  # volume, position, coils


@pytest.mark.parametrize("when", [0.30, 0.40])  # within a run that would be held out, and within one that would not
def test_jump(robot, when):
    """A frame that jumps within a run is followed to the row, and that run is not held out."""
    by = {"x": 8e-4, "y": -5e-4, "turn_y": 2e-3}
    hidden = {f"effects.frame_jump.{name}": value for name, value in by.items()}
    table = measured(robot, np.random.default_rng(7), hidden, fixed={WHEN: when})
    at = np.searchsorted(recording.session_part(table), when)
    run = table.run[at]
    assert table.run[at - 1] == run and held_out_rows(robot, table)[at] == (when == 0.30)
    result = diagnose(robot, table)
    assert [a.ids for a in result.accepted] == [["frame_jump"]]
    assert result.verdict.word == "identified"
    found = dict(result.accepted[0].best.candidate.shape)[WHEN]
    assert abs(np.searchsorted(recording.session_part(table), found) - at) <= 1
    assert not result.held_out[table.run == run].any() or when != 0.30
    assert result.rms_mm["with_effects"] < 1.15 * result.rms_mm["noise_floor"]


@pytest.mark.parametrize("shuffled", [False, True])
def test_moment(robot, shuffled):
    """The moment is found between the right fitted rows, whatever rows these are, and pays for the choice."""
    table, random = measured_session(robot), np.random.default_rng(3)
    if shuffled:
        order = random.permutation(len(table))
        table = replace(table, t=table.t[order], run=table.run[order])
    whole = Candidate("frame_jump", ("effects.frame_jump.x",))
    columns, group, part = np.ones((len(table), 6, 1)), groups(table), recording.session_part(table)
    np.testing.assert_allclose([part.min(), part.max()], [0, 1])
    for _ in range(60):
        fitted = ~np.isin(group, random.choice(np.unique(group)[1:-1], 3, replace=False))
        at = random.choice(np.sort(part[fitted])[5:-5])
        signal = (part >= at) * fitted + 0.05 * random.standard_normal(len(table))

        def gain(derivatives, fitted=fitted, signal=signal):
            a = np.column_stack([derivatives[fitted, 0, 0], np.ones(fitted.sum())])
            left = signal[fitted] - a @ np.linalg.lstsq(a, signal[fitted], rcond=None)[0]
            return float(np.var(signal[fitted]) * fitted.sum() - left @ left)

        [(found, derivatives)] = starts.best_moment(table, fitted, whole, WHEN, columns, gain)
        when = dict(found.shape)[WHEN]
        np.testing.assert_array_equal(part[fitted] > when, part[fitted] >= at)
        np.testing.assert_array_equal(derivatives[fitted, 0, 0], part[fitted] > when)
        assert found.penalty == pytest.approx(np.log(fitted.sum() - 1))


def test_rows_around(robot):
    """A moment may lie anywhere between two fitted rows."""
    table = session(robot, np.random.default_rng(0))
    part = recording.session_part(table)
    fitted = np.ones(len(table), bool)
    fitted[10:15] = False
    np.testing.assert_array_equal(np.flatnonzero(starts.rows_around(table, fitted, part[11] + 1e-6)), np.arange(10, 15))
    assert not starts.rows_around(table, fitted, 0.5 * (part[3] + part[4])).any()


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

    candidate, columns = starts._source(engine, Candidate("field_distortion", SOURCE), worth)
    return np.array([dict(candidate.shape)[name] for name in SOURCE[1:]]), columns


def test_source_derivatives(engine):
    """The piece is tried with the derivatives of the residual, in the right axes and with the right sign."""
    jitter = np.repeat([3e-5, 5e-4], 3)
    place, columns = found_from(engine, np.zeros((len(engine.measurements), 6)), jitter)
    table = engine.recording(SOURCE)
    there = [table.residual(np.array([v, *place]))[0].reshape(-1, 6) for v in (-1e-7, 1e-7)]
    difference = (there[1] - there[0]) * (engine.priors(SOURCE)[1][0] / 2e-7)
    size = np.abs(difference).max()
    np.testing.assert_allclose(columns[engine.rows, :, 0], difference[engine.rows], atol=1e-3 * size)
    assert (columns[~engine.rows] == 0).all() and size > 1e-6


@pytest.mark.parametrize("seed", range(6))
def test_source_search(engine, seed):
    """The global search finds a piece wherever it is beside the workspace."""
    rng = np.random.default_rng(seed)
    jitter = np.repeat([3e-5, 5e-4], 3)
    side = rng.standard_normal(3)
    reach = 0.06 + np.max((engine.positions - np.median(engine.positions, axis=0)) @ side) / np.linalg.norm(side)
    place = np.median(engine.positions, axis=0) + reach * side / np.linalg.norm(side)
    coils = rng.normal(0, 0.02, 3)
    signal = -3e-6 * _core.metal_distortion(engine.positions - coils, place - coils)
    signal[~engine.rows] = 0
    found, columns = found_from(engine, signal, jitter)
    assert np.linalg.norm(found[:3] - place) < 0.015
    column, whole = (columns[:, :, 0] / jitter).ravel(), (signal / jitter).ravel()
    assert (column @ whole) ** 2 > 0.98 * (column @ column) * (whole @ whole)


def test_held_out_unseen(engine):
    """Where a search begins does not depend on readings that are held out."""
    other, random = copy(engine), np.random.default_rng(2)
    other.positions = np.where(engine.rows[:, None], engine.positions, random.normal(0, 1, engine.positions.shape))
    columns, by_force = random.normal(size=(2, len(engine.rows), 6, 3))
    contact = next(c for c in candidates(engine.robot, engine.measurements)[0] if c.id == "contact")
    source = Candidate("field_distortion", SOURCE)

    def found(engine, candidate):
        def worth(columns):
            return float(np.sum(columns[engine.fitted]))

        return [[one.shape for one, _ in some] for some in starts.options(engine, candidate, columns, by_force, worth)]

    for candidate in (contact, source):
        assert found(engine, candidate) == found(other, candidate)
        assert any(map(len, found(engine, candidate)))


def test_source_forms(engine):
    """A piece of metal enters alone; a field takes it up where its position was fitted before."""
    effect = get("field_distortion", engine.robot.n_tubes)
    fields = [c for c in candidates(engine.robot, engine.measurements)[0] if c.id == "field_distortion"]
    assert sum({*SOURCE} <= {*candidate.names} for candidate in fields) == 1
    for candidate in fields:
        has_source = {*SOURCE} <= {*candidate.names}
        assert has_source or not {*SOURCE} & {*candidate.names}
        for found in ((), SOURCE):
            for form in forms(effect, candidate, found):
                assert ({*SOURCE} <= {*form.names}) == (has_source or bool(found))
