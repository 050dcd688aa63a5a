"""The moment at which the tracker frame jumped is found to the row, whatever runs are locked."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr.diagnose import diagnose, jump
from ctcr.diagnose.candidates import Candidate
from ctcr.fit.folds import groups, held_out_rows
from ctcr.model import recording
from ctcr.robot import robot_file
from hidden_sessions import measured, measured_session, session

ROBOT = Path(__file__).parents[3] / "examples" / "robots" / "table2.yaml"


@pytest.fixture(scope="module")
def robot():
    return robot_file.load(ROBOT)


@pytest.mark.parametrize("when", [0.30, 0.40])  # within a run that would be locked, and within one that would not
def test_a_frame_that_jumps_within_a_run_is_followed_to_the_row(robot, when):
    by = {"x": 8e-4, "y": -5e-4, "turn_y": 2e-3}
    hidden = {f"effects.frame_jump.{name}": value for name, value in by.items()}
    table = measured(robot, np.random.default_rng(7), hidden, fixed={jump.WHEN: when})
    at = np.searchsorted(recording.session_part(table), when)
    run = table.run[at]
    assert table.run[at - 1] == run and held_out_rows(robot, table)[at] == (when == 0.30)
    result = diagnose(robot, table)
    assert [a.ids for a in result.accepted] == [["frame_jump"]]
    assert result.verdict.word == "identified"
    found = dict(result.accepted[0].best.candidate.shape)[jump.WHEN]
    assert abs(np.searchsorted(recording.session_part(table), found) - at) <= 1
    assert not result.held_out[table.run == run].any() or when != 0.30
    assert result.rms_mm["with_effects"] < 1.15 * result.rms_mm["noise_floor"]


@pytest.mark.parametrize("shuffled", [False, True])
def test_the_moment_of_a_jump_is_found_whatever_rows_are_fitted(robot, shuffled):
    """Rows that are not fitted cannot tell; the first stage looks at starts of runs alone."""
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

        def gain(slopes, fitted=fitted, signal=signal):
            a = np.column_stack([slopes[fitted, 0, 0], np.ones(fitted.sum())])
            left = signal[fitted] - a @ np.linalg.lstsq(a, signal[fitted], rcond=None)[0]
            return float(np.var(signal[fitted]) * fitted.sum() - left @ left)

        engine = SimpleNamespace(measurements=table, fitted=fitted)
        [(found, slopes)] = jump.moment(engine, whole, columns, gain)
        when = dict(found.shape)[jump.WHEN]
        np.testing.assert_array_equal(part[fitted] > when, part[fitted] >= at)
        np.testing.assert_array_equal(slopes[fitted, 0, 0], part[fitted] > when)
        assert found.penalty == pytest.approx(np.log(fitted.sum() - 1))


def test_rows_between_fitted_ones_may_hide_a_jump(robot):
    table = session(robot, np.random.default_rng(0))
    part = recording.session_part(table)
    fitted = np.ones(len(table), bool)
    fitted[10:15] = False
    np.testing.assert_array_equal(
        np.flatnonzero(jump.uncertain_rows(table, fitted, part[11] + 1e-6)), np.arange(10, 15)
    )
    assert not jump.uncertain_rows(table, fitted, 0.5 * (part[3] + part[4])).any()
