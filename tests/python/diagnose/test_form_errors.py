"""A further effect is the likelier a cause, the more it explains and the less the forms of the others may err by."""

from dataclasses import dataclass

import numpy as np
import pytest
from ctcr.diagnose.form_errors import (
    form_error,
    left_by,
    log_density_of_errors,
    log_density_of_mend,
    log_odds_of_cause,
    log_odds_of_imitation,
    log_odds_of_mend,
)
from scipy.integrate import quad


@dataclass
class Found:
    id: str
    explained: float


SHARES = np.linspace(0.0, 1.0, 101)


def test_left():
    """Effects explain, one after the other, parts of what is left."""
    found = [Found("softening", 0.84), Found("clearance", 0.75)]
    assert left_by(found) == pytest.approx(0.2)
    assert left_by([]) == 1.0 and left_by([Found("softening", 1.3)]) == 0.0


def test_form_error():
    """That of several effects lies between theirs, nearer to that of the larger signal."""
    exact, loose = (form_error([Found(name, 0.9)]) for name in ("softening", "clearance"))
    mostly = [form_error([Found("softening", part), Found("clearance", 1.0)]) for part in (0.1, 0.5, 0.9)]
    assert exact < mostly[2] < mostly[1] < mostly[0] < loose
    assert form_error([Found("clearance", 0.0)]) == loose


@pytest.mark.parametrize("error", [0.05, 0.15, 0.5, 2.0])
def test_densities(error):
    """What errors of a form leave, and the share of it that another effect explains, are distributions."""
    left = quad(lambda left: np.exp(log_density_of_errors(left, error)), 0, 10 * error)[0]
    mended = quad(lambda share: np.exp(log_density_of_mend(share, error)), 0, 1)[0]
    assert [left, mended] == pytest.approx([1, 1], abs=1e-9)


def test_odds():
    """A larger share makes a cause likelier, and so do more that is left and exacter forms of the others."""
    little, much = [Found("softening", 0.99)], [Found("softening", 0.5)]
    for before in (little, much):
        odds = [log_odds_of_cause(share, before) for share in SHARES]
        assert np.all(np.diff(odds) >= 0) and odds[0] < 0 < odds[-1]
    assert log_odds_of_mend(0.5, little) > log_odds_of_mend(0.5, much)
    assert log_odds_of_mend(0.5, [Found("clearance", 0.9)]) > log_odds_of_mend(0.5, [Found("softening", 0.9)])


def test_imitation():
    """Effects are the likelier to imitate an unknown cause, the less each explains; one large share clears no other."""
    for k in range(3):
        odds = [log_odds_of_imitation([*np.full(k, 0.4), share, *np.full(2 - k, 0.4)]) for share in SHARES]
        assert np.all(np.diff(odds) <= 0) and odds[0] > odds[-1]
    weak = [log_odds_of_imitation(np.full(count, 0.3)) for count in range(2, 6)]
    assert np.all(np.diff(weak) > 0)
    assert log_odds_of_imitation([0.99, 0.1, 0.1]) > 0 > log_odds_of_imitation([0.99, 0.9, 0.9])
