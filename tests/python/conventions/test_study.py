"""Wrong conventions drawn at random are named and corrected, and none in right sessions: tools/convention_study.py."""

import numpy as np
import pytest
from ctcr.conventions import review
from wrong_conventions import DRAWN, faults, mended, right_case, spoiled

SAME_ERROR = 1.1  # of a corrected table over that of the right one


def judged(seed, kinds):
    """Whether all that is wrong in a session, and nothing else, is named and corrected."""
    random = np.random.default_rng([91, seed])
    while not (wrong := faults(random, case := right_case(random), kinds)) and kinds:
        pass  # this session has no room for such a fault
    bad = spoiled(case, wrong)
    found = review(bad.robot, bad.readings)
    named = len(found.findings) == len(wrong) and all(any(map(one.agrees, found.findings)) for one in wrong)
    return named and mended(case, found) < SAME_ERROR


@pytest.mark.parametrize("kinds", [(), ("frame_wrong", "joint_sign"), ("position_unit", "force_sign"), ("run_offset",)])
def test_drawn(kinds):
    """Nothing, two faults that hide each other, and a run homed elsewhere."""
    assert judged(len(kinds), kinds)


@pytest.mark.slow
def test_study():
    """Most faults are named and corrected, and nothing is named in right sessions."""
    assert all(judged(seed, ()) for seed in range(20))
    assert np.mean([judged(seed, (kind,)) for seed, kind in enumerate([*DRAWN] * 2)]) > 0.8
