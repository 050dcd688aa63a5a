"""Held-out rows: whole runs, which the fitted ones determine."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from ctcr import settings
from ctcr.fit.folds import Coverage, groups, held_out_rows, named
from ctcr.model import parameters, recording
from ctcr.model.noise import noise_of_readings
from ctcr.robot import robot_file
from hidden_sessions import measured_session, session

ROBOT = Path(__file__).parents[3] / "examples" / "robots" / "table2.yaml"


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROBOT)


def test_by_run(robot):
    """Rows of one run are held out together; a single run is split into blocks of time."""
    table = measured_session(robot)
    held_out = held_out_rows(robot, table)
    assert 0.2 <= held_out.mean() <= 0.3
    for run in np.unique(table.run):
        assert np.ptp(held_out[table.run == run].astype(int)) == 0
    one = dataclasses.replace(table, run=np.zeros_like(table.run))
    assert len(np.unique(groups(one))) == 12 and np.all(np.diff(groups(one)) >= 0)


def test_named(robot):
    """Held-out rows are named by their runs, or as the blocks of time that they are where there are few runs."""
    table = measured_session(robot)
    assert named(table, table.run == 3) == "run 3"
    assert named(table, np.isin(table.run, (3, 5))) == "runs 3, 5"
    one = dataclasses.replace(table, run=np.zeros_like(table.run))
    assert named(one, held_out_rows(robot, one)) == "one of every four blocks of time"
    assert named(table, table.run < 0) == ""
    many = dataclasses.replace(table, run=np.arange(len(table)))
    assert named(many, many.run % 4 == 2) == f"{len(table) // 4} of {len(table)} runs"


def test_no_alternation(robot):
    """Held-out runs follow no plan that alternates between two or four kinds of runs."""
    table = measured_session(robot, runs=16)
    for turn in range(4):
        runs = np.unique(table.run[held_out_rows(robot, table, turn)])
        assert len(runs) == 4
        for period in (2, 4):
            assert len(set(runs % period)) > 1, (turn, period)


def with_one_odd_run(robot, odd):
    """Only in the run `odd` the outermost tube shows where its curve starts."""
    table = measured_session(robot, runs=12)
    length = robot.tubes[2].length
    shown = np.where(table.run == odd, 0.06, np.minimum(table.beta[:, 2] + length, 0.044))
    beta = np.column_stack([table.beta[:, :2], shown - length])
    return dataclasses.replace(table, beta=beta)


def test_undetermined_run(robot):
    """A run that goes where no other went is never held out, whatever poses were read."""
    odd = np.unique(session(robot, np.random.default_rng(0), runs=12).run)[2]
    table = with_one_odd_run(robot, odd)
    coverage = Coverage(robot, table, table.measured, groups(table))
    assert coverage.undetermined([odd])[0] > 100 * settings.MOST_UNDETERMINED
    held_out = held_out_rows(robot, table)
    assert not held_out[table.run == odd].any() and len(np.unique(table.run[held_out])) == 3
    assert coverage.undetermined(np.unique(table.run[held_out])).max() <= settings.MOST_UNDETERMINED
    # What was read has no say.
    moved = np.random.default_rng(1).normal(size=(len(table), 3))
    np.testing.assert_array_equal(held_out, held_out_rows(robot, dataclasses.replace(table, position=moved)))


def test_undetermined_variance(robot):
    """What is undetermined of a run is the variance of its prediction by fits to readings of noise alone."""
    random, table = np.random.default_rng(5), with_one_odd_run(robot, 3)
    names = parameters.expand("standard", robot)
    mean, sd, low, high = parameters.priors(robot, names)
    noise = noise_of_readings(robot, table, field=False)
    core = recording.recording_of(robot, table, names)
    core.activate([True] * len(table))
    slopes = np.nan_to_num(core.residual(mean, True)[1]).reshape(len(table), 6, -1)
    fitted, jitter = table.run != 7, np.repeat([noise.position_jitter, noise.rotation_jitter], 3)
    A = (slopes[fitted] / jitter[:, None]).reshape(-1, len(names)) * sd
    seen = []
    for _ in range(400):
        truth, error = random.normal(size=len(names)), random.normal(size=len(A))
        found = np.linalg.solve(A.T @ A + np.eye(len(names)), A.T @ (A @ truth + error))
        missed = slopes[~fitted][:, :3] @ (sd * (found - truth))
        seen.append(np.mean(np.sum(missed**2, axis=1)))
    undetermined = Coverage(robot, table, table.measured, groups(table)).undetermined([7])[0]
    part = np.mean(seen) / (3 * noise.position_jitter**2) / undetermined
    assert 0.6 < part < 1.15, part  # undetermined is the worst of three lengths of the curves


def test_rows_without_pose(robot):
    """Rows without a pose, such as way points, make no group of their own."""
    table = measured_session(robot)
    for part in (table, dataclasses.replace(table, run=np.zeros_like(table.run))):
        for turn in range(4):
            seen = ~held_out_rows(robot, part, turn)
            blind = dataclasses.replace(part, position=np.where(seen[:, None], part.position, np.nan))
            for again in range(4):
                assert (held_out_rows(robot, blind, again) & seen).any(), (turn, again)
