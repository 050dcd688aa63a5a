"""Rows that are copies of earlier ones are left out of comparisons and fits, and named."""

from dataclasses import replace

import ctcr
import numpy as np
import pytest
from ctcr.api.reviewed import to_fit
from ctcr.audit import copies
from ctcr.model import simulation


@pytest.fixture(scope="module")
def readings(robot, plan):
    return simulation.simulate(robot, plan, seed=3)


def repeated(readings, order):
    return replace(readings.rows(order), row=np.arange(2, len(order) + 2))


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize("order", [np.tile, np.repeat])
def test_copies(readings, order, timed):
    """A table that stands in a file twice, or each row of it, is the table."""
    readings = readings if timed else replace(readings, t=np.full(len(readings), np.nan))
    kept, [notice] = copies.left_out(repeated(readings, order(np.arange(len(readings)), 2)))
    for name in ("t", "run", "beta", "alpha", "force", "position", "quaternion"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(readings, name))
    assert notice.startswith(f"{len(readings)} rows (")


def test_no_copies(readings):
    """The same joints with another pose, and motions without a pose, are no copies."""
    assert copies.left_out(readings) == (readings, [])
    still = readings.without_poses(np.ones(len(readings), bool))
    again = repeated(replace(still, t=np.full(len(still), np.nan)), np.tile(np.arange(len(still)), 2))
    assert copies.left_out(again) == (again, [])


def test_comparison_and_fit(robot, readings):
    """Both take a table with copies as the one without, and say so."""
    twice = repeated(readings, np.repeat(np.arange(len(readings)), 2))
    once, found = (ctcr.compare(robot, table) for table in (readings, twice))
    assert "copies, left out" in found.notices[0]
    assert str(found.as_dict() | {"notices": list(once.notices)}) == str(once.as_dict())
    fitted, said, _ = to_fit(robot, twice)
    assert len(fitted) == len(readings) and "copies, left out" in said[0]
