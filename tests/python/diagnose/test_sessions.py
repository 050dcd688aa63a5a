"""Whether runs are one session: frames and homes of their own against effects that act in runs."""

from dataclasses import replace

import numpy as np
import pytest
from ctcr import settings
from ctcr.diagnose import sessions
from ctcr.fit import joint
from ctcr.frames import product, quaternion_from_rotation_vector
from ctcr.show import wording
from hidden_sessions import measured
from scipy.spatial.transform import Rotation


def moved(readings, random, homes=False):
    """The readings with a frame, and homes, of each run's own."""
    runs, index = np.unique(readings.run, return_inverse=True)
    shift, turn = 4e-3 * random.normal(size=(len(runs), 3))[index], 0.05 * random.normal(size=(len(runs), 3))[index]
    position = Rotation.from_rotvec(turn).apply(readings.position) + shift
    quaternion = product(quaternion_from_rotation_vector(turn), readings.quaternion)
    alpha = readings.alpha + homes * 0.2 * random.normal(size=(len(runs), readings.alpha.shape[1]))[index]
    return replace(readings, position=position, quaternion=quaternion, alpha=alpha)


@pytest.mark.parametrize("seed", range(2))
def test_own_frames(robot, seed):
    """Frames of their own are found, said, and taken out: what is left is noise."""
    random = np.random.default_rng(seed)
    plain = measured(robot, random, {})
    found, said = sessions.of_runs(robot, moved(plain, random))
    assert found.sessions.homes is None and "The runs do not share a frame: " in said[0] and len(said) == 1
    assert joint.fit(robot, found).rms_mm() < 1.2 * joint.fit(robot, plain).rms_mm()


def test_far_runs(robot):
    """So are those of a run so far off that a fit takes it for outliers."""
    random = np.random.default_rng(6)
    plain = measured(robot, random, {})
    near = moved(plain, random)
    far = replace(near, position=near.position + np.where(near.run == 3, 0.1, 0.0)[:, None] * [0, 0, 1])
    found, said = sessions.of_runs(robot, far)
    assert "The runs do not share a frame: " in said[0]
    assert joint.fit(robot, found).rms_mm() < 1.2 * joint.fit(robot, plain).rms_mm()


def test_elsewhere(robot):
    """So are those of a tracker that stood elsewhere in the room on each day."""
    random = np.random.default_rng(8)
    plain = measured(robot, random, {})
    _, index = np.unique(plain.run, return_inverse=True)
    shift, turn = 0.2 * random.normal(size=(8, 3))[index], 0.4 * random.normal(size=(8, 3))[index]
    position = Rotation.from_rotvec(turn).apply(plain.position) + shift
    quaternion = product(quaternion_from_rotation_vector(turn), plain.quaternion)
    found, said = sessions.of_runs(robot, replace(plain, position=position, quaternion=quaternion))
    assert "The runs do not share a frame: " in said[0]
    assert joint.fit(robot, found).rms_mm() < 1.2 * joint.fit(robot, plain).rms_mm()


def test_one_day(robot):
    """So is that of one run in which the tracker was moved, which a robust fit takes for outliers."""
    random = np.random.default_rng(9)
    plain = measured(robot, random, {})
    found, said = sessions.of_runs(
        robot, replace(plain, position=plain.position + np.where(plain.run == 4, 0.02, 0.0)[:, None] * [1, 0, 0])
    )
    assert "The runs do not share a frame: " in said[0] and "but for run 4: up to 20" in said[1]
    assert joint.fit(robot, found).rms_mm() < 1.2 * joint.fit(robot, plain).rms_mm()


def test_many_runs(robot):
    """So are those of more runs than are looked at: all of them lie in one frame, and the sentence says how well."""
    random = np.random.default_rng(7)
    plain = measured(robot, random, {})
    copies = np.arange(settings.CONVENTION_MOST_RUNS // 8 + 2)
    many = plain.rows(np.tile(np.arange(len(plain)), len(copies)))
    many = replace(
        many, run=many.run + 8 * np.repeat(copies, len(plain)), t=np.arange(len(many)), row=np.arange(len(many))
    )
    found, said = sessions.of_runs(robot, moved(many, random))
    left = joint.fit(robot, found, rows=found.run < 8)
    assert left.rms_mm() < 1.2 * joint.fit(robot, plain).rms_mm()
    assert said[0].endswith(f"to {wording.mm(left.rms_mm())}.")


def test_own_homes(robot):
    """So are homes."""
    random = np.random.default_rng(5)
    plain = measured(robot, random, {})
    found, said = sessions.of_runs(robot, moved(plain, random, homes=True))
    assert found.sessions.homes is not None and "The runs do not share a frame and homes: " in said[0]
    assert joint.fit(robot, found).rms_mm() < 1.5 * joint.fit(robot, plain).rms_mm()


def test_question():
    """Who reads what the runs seem not to share is asked about that alone."""
    homes, tube = ("actuation.home_rotation.1", "actuation.home_rotation.2"), ("tubes.1.length", "tubes.1.curvature")
    asked = [sessions._not_shared(found)[0] for found in ({tube: 0.4}, {homes: 0.4}, {homes: 0.48, tube: 0.5})]
    assert asked[0].endswith("were tubes changed between runs?") and "share tube 1." in asked[0]
    assert asked[1].endswith("were tubes homed anew between runs?") and "share their homes." in asked[1]
    assert asked[2].endswith("were tubes changed or homed anew between runs?")
    assert sessions._not_shared({}) == []


@pytest.mark.parametrize(
    "hidden",
    [
        {},
        {"effects.frame_jump.x": 3e-3, "effects.frame_jump.when": 0.5},
        {"effects.frame_drift.y": 3e-3},
        {"effects.tip_load.mass": 4e-3},
        {"effects.friction.coefficient.1": 0.1, "effects.friction.coefficient.2": 0.1},
    ],
)
def test_one_session(robot, hidden):
    """An effect that differs from run to run is not taken for frames of their own, and the table stays as it was."""
    readings = measured(robot, np.random.default_rng(3), hidden)
    found, said = sessions.of_runs(robot, readings)
    assert found is readings and not said


def test_as_asked(robot):
    """Who knows better is followed."""
    random = np.random.default_rng(0)
    plain = measured(robot, random, {})
    assert sessions.of_runs(robot, plain, asked=True)[0].sessions
    assert not sessions.of_runs(robot, moved(plain, random), asked=False)[0].sessions


def test_there_and_back(robot):
    """What was taken out of the runs, put back, gives the table."""
    random = np.random.default_rng(2)
    readings = moved(measured(robot, random, {}), random, homes=True)
    taken = sessions.as_sessions(robot, readings, homes=True)
    back = taken.sessions.put_back(taken)
    for name in ("position", "beta", "alpha"):
        np.testing.assert_allclose(getattr(back, name), getattr(readings, name), atol=1e-12)
    turned = np.abs(np.sum(back.quaternion * readings.quaternion, axis=1))
    np.testing.assert_allclose(turned, 1, atol=1e-12)
    assert back.sessions is None
