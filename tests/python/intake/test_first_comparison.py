"""From the log of a laboratory to a first comparison in three commands: init, import, compare."""

import json
from pathlib import Path

import numpy as np
import pytest
from ctcr import frames
from ctcr.robot import robot_file
from ctcr.table import measurements
from lab_logs import text
from scipy.spatial.transform import Rotation

DEMO = Path(__file__).parents[3] / "examples" / "data" / "demo"
FIELDS = "length_mm curved_length_mm curvature_per_m inner_diameter_mm outer_diameter_mm youngs_modulus_GPa".split()


@pytest.fixture(scope="module")
def demo():
    """The robot of the demonstration, and 40 of its readings with poses in the base frame."""
    robot, table = robot_file.load(DEMO / "robot.yaml"), measurements.load(DEMO / "measurements.csv", 3)
    rows = slice(0, 40)
    pose = frames.tracker_to_base(robot.tracker, table.position[rows], table.quaternion[rows])
    return robot, table.t[rows], table.beta[rows], table.alpha[rows], *pose


def matlab(t, beta, alpha, position, quaternion, lengths):
    """Milliseconds, exposed lengths, degrees, numbered quaternions."""
    names = ["Time_ms", *(f"L{i}_mm" for i in (1, 2, 3)), *(f"theta{i}_deg" for i in (1, 2, 3))]
    names += ["x_mm", "y_mm", "z_mm", "q0", "q1", "q2", "q3"]
    columns = [1e3 * t, 1e3 * beta + lengths, np.rad2deg(alpha), 1e3 * position, quaternion]
    return text(names, columns), ["--translation", "from-flush"]


def labview(t, beta, alpha, position, quaternion, lengths):
    """Decimal commas, the outermost tube first, distances behind the plate, the scalar last."""
    names = ["time", *(f"Trans{i}" for i in (1, 2, 3)), *(f"Rot{i}" for i in (1, 2, 3)), "x", "y", "z"]
    names += ["q1", "q2", "q3", "q4"]
    columns = [t, -1e3 * beta[:, ::-1], np.rad2deg(alpha[:, ::-1]), 1e3 * position, np.roll(quaternion, -1, axis=1)]
    return text(names, columns, ";", ","), ["--flip", "beta", "--order", "outermost-first", "--quaternion", "xyzw"]


def markers(t, beta, alpha, position, quaternion, lengths):
    """Poses of tip and base in a tracker that stands anywhere."""
    turn, shift = Rotation.from_rotvec([0.3, 1.2, -0.5]), np.array([0.1, -0.9, 1.7])
    tip = turn * Rotation.from_quat(np.roll(quaternion, -1, axis=1))
    names = ["stamp_ns", *(f"beta_{i}" for i in (1, 2, 3)), *(f"alpha_{i}" for i in (1, 2, 3))]
    names += [f"{marker}_{axis}" for marker in ("tip", "base") for axis in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    base = np.tile(np.concatenate([shift, turn.as_quat()]), (len(t), 1))
    stamps = [str(1_700_000_000_000_000_000 + round(1e9 * one)) for one in t]
    poses = np.hstack([turn.apply(position) + shift, tip.as_quat(), base])
    return text(names, [stamps, beta, alpha, poses]), ["--relative-to", "base"]


@pytest.mark.parametrize("laboratory", [matlab, labview, markers])
def test_three_commands(run, log, tmp_path, demo, laboratory):
    """All find the error of the same readings written in our format."""
    robot, t, beta, alpha, position, quaternion = demo
    content, arguments = laboratory(*demo[1:], np.array([tube.length_mm for tube in robot.tubes]))
    described = [",".join(f"{name}={getattr(tube, name)}" for name in FIELDS) for tube in robot.tubes]
    new, table = tmp_path / "robot.yaml", tmp_path / "measurements.csv"
    tubes = [word for tube in described for word in ("--tube", tube)]
    assert run("init", "-o", new, *tubes, "--gravity", "-y")[0] == 0
    code, _, err = run("import", log(content), "-o", table, "--robot", new, *arguments)
    assert code == 0, err
    names = ("t", "beta", "alpha", "position", "quaternion")
    header = [column for name in names for column in measurements.group_columns(3)[name]]
    ours = log(text(header, [t, beta, alpha, position, quaternion]), "ours.csv")
    found = []
    for path in (table, ours):
        code, out, err = run("compare", new, path, "--json", "-")
        assert code == 0, err
        found.append(json.loads(out))
    for kind in ("position_mm", "angle_deg"):
        first, second = (list(one[kind].values()) for one in found)
        np.testing.assert_allclose(first, second, rtol=1e-6)
