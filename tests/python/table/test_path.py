"""Rows without which the path would be another."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ctcr import settings
from ctcr.table.measurements import Measurements
from ctcr.table.path import with_path

CORNERS = 6


def stream(random: np.random.Generator, timed: bool = True) -> tuple[Measurements, list[int]]:
    """A table of straight motions between corners, each in many small steps at a speed of its own, and the corners."""
    corners = np.column_stack([random.uniform(-0.3, -0.29, (CORNERS, 2)), random.uniform(-1, 1, (CORNERS, 2))])
    joints, t, at = [corners[:1]], [0.0], [0]
    for a, b in zip(corners, corners[1:], strict=False):
        steps = int(random.integers(100, 300))
        joints.append(a + np.linspace(0, 1, steps + 1)[1:, None] * (b - a))
        t += (t[-1] + random.uniform(1, 2) * np.linspace(0, 1, steps + 1)[1:]).tolist()
        at.append(at[-1] + steps)
    joints = np.vstack(joints)
    count = len(joints)
    times = np.array(t) if timed else np.full(count, np.nan)
    nothing = np.full((count, 3), np.nan)
    return Measurements.of_joints(*np.hsplit(joints, 2), t=times, position=nothing), at


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize("seed", range(5))
def test_what_is_left_out_is_straight(seed, timed):
    """The motion between kept rows is that of all rows, its corners and the chosen rows are kept, most others not."""
    table, corners = stream(np.random.default_rng(seed), timed)
    chosen = np.zeros(len(table), bool)
    chosen[[17, 400]] = True
    kept = with_path(table, chosen)
    assert kept[chosen].all() and kept[corners].all()
    assert np.sum(kept) < 0.3 * len(table)
    when = table.clock
    for name, slack in settings.PATH_STRAIGHT.items():
        for joint in getattr(table, name).T:
            np.testing.assert_allclose(np.interp(when, when[kept], joint[kept]), joint, atol=slack)
        assert np.max(np.abs(np.diff(getattr(table, name)[kept], axis=0))) < 1.5 * settings.PATH_STEP[name]


def test_runs_and_loads():
    """The last row before another run or load and the first one with it are kept, and so is every row of a crooked
    path."""
    table, _ = stream(np.random.default_rng(7))
    run, force = table.run.copy(), table.force.copy()
    run[120:], force[240:] = 1, 0.1
    kept = with_path(replace(table, run=run, force=force), np.zeros(len(table), bool))
    assert kept[[119, 120, 239, 240]].all()
    crooked = np.random.default_rng(8).normal(0, 0.01, table.alpha.shape)
    assert with_path(replace(table, alpha=table.alpha + crooked), np.zeros(len(table), bool)).mean() > 0.95


def test_straight_as_in_the_library():
    """Where friction takes a motion for straight, so does the choice of rows."""
    header = Path(__file__).parents[3] / "include/ctcr/friction/path_nodes.hpp"
    bent, slid = re.search(r"double bent = (\S+), slid = (\S+);", header.read_text(encoding="utf-8")).groups()
    assert settings.PATH_STRAIGHT == {"alpha": float(bent), "beta": float(slid)}
