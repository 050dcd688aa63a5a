"""`ctcr compare` names wrong conventions of random robots, with what corrects them, and none where there is none."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conventions_bench import RUNS, design, session
from ctcr.conventions import review, runs
from ctcr.conventions.hypotheses import hypotheses, with_frame
from ctcr.conventions.orientation import mirror
from ctcr.fit.floors import floors
from ctcr.frames import conjugate, product
from ctcr.model import simulation
from ctcr.robot import defaults, robot_file
from ctcr.table import measurements
from scipy.spatial.transform import Rotation
from wrong_conventions import DRAWN, OF_RUNS, with_other_tube

ROOT = Path(__file__).parents[3]


def bench(seed, n_tubes=2, **options):
    random = np.random.default_rng(seed)
    robot = design(random, n_tubes)
    return robot, session(robot, random, **options)


def scaled(readings, group, factor):
    return replace(readings, **{group: getattr(readings, group) * np.array(factor)})


def inverted(readings):
    """The tracker in the frame of the sensor, by matrices."""
    poses = np.tile(np.eye(4), (len(readings), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(readings.quaternion, scalar_first=True).as_matrix()
    poses[:, :3, 3] = readings.position
    back = np.linalg.inv(poses)
    turned = Rotation.from_matrix(back[:, :3, :3]).as_quat(scalar_first=True)
    signs = np.sign(np.sum(turned * conjugate(readings.quaternion), axis=1, keepdims=True))
    return replace(readings, position=back[:, :3, 3], quaternion=signs * turned)


FAULTS = {  # of a robot with two tubes: kind, columns, and how the table goes wrong
    "one sign": ("joint_sign", ["alpha2"], lambda m: scaled(m, "alpha", [1, -1])),
    "all signs": ("joint_sign", ["alpha1", "alpha2"], lambda m: scaled(m, "alpha", -1)),
    "insertion": ("joint_sign", ["beta1", "beta2"], lambda m: scaled(m, "beta", -1)),
    "degrees": ("joint_unit", ["alpha1", "alpha2"], lambda m: scaled(m, "alpha", 180 / np.pi)),
    "mm": ("joint_unit", ["beta1", "beta2"], lambda m: scaled(m, "beta", 1e3)),
    "inches": ("joint_unit", ["beta1", "beta2"], lambda m: scaled(m, "beta", 1 / 0.0254)),
    "plane": ("joint_offset", ["alpha2"], lambda m: replace(m, alpha=m.alpha - [0, np.pi / 2])),
    "upside down": ("joint_offset", ["alpha1"], lambda m: replace(m, alpha=m.alpha - [np.pi, 0])),
    "relative": ("joint_relative", ["beta1"], lambda m: replace(m, beta=m.beta - m.beta[:, 1:] * [1, 0])),
    "both relative": (
        "joint_relative",
        ["beta1", "alpha1"],
        lambda m: replace(m, beta=m.beta - m.beta[:, 1:] * [1, 0], alpha=m.alpha - m.alpha[:, 1:] * [1, 0]),
    ),
    "order": (
        "joint_order",
        ["beta1", "beta2", "alpha1", "alpha2"],
        lambda m: replace(m, beta=m.beta[:, ::-1], alpha=m.alpha[:, ::-1]),
    ),
    "left-handed": (
        "mirrored",
        ["y_m"],
        lambda m: replace(scaled(m, "position", [1, -1, 1]), quaternion=mirror(m.quaternion, 1)),
    ),
    "scalar last": (
        "quaternion_order",
        ["qw", "qx", "qy", "qz"],
        lambda m: replace(m, quaternion=np.roll(m.quaternion, -1, 1)),
    ),
    "inverse": (
        "quaternion_inverse",
        ["qw", "qx", "qy", "qz"],
        lambda m: replace(m, quaternion=conjugate(m.quaternion)),
    ),
    "reaction": ("force_sign", ["fx_N", "fy_N", "fz_N"], lambda m: scaled(m, "force", -1)),
    "grams": ("force_unit", ["fx_N", "fy_N", "fz_N"], lambda m: scaled(m, "force", 1e3 / 9.80665)),
    "tracker from tip": ("pose_inverse", ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"], inverted),
    "tracker in inches": ("position_unit", ["x_m", "y_m", "z_m"], lambda m: scaled(m, "position", 1 / 0.0254)),
    "tracker in mm": ("position_unit", ["x_m", "y_m", "z_m"], lambda m: scaled(m, "position", 1e3)),
    "clock": ("time_unit", ["t_s"], lambda m: scaled(m, "t", 1e3)),
}


@pytest.mark.parametrize("name", FAULTS)
def test_named(name):
    """Each wrong convention is the only one named, and the corrected table is the right one."""
    kind, columns, spoil = FAULTS[name]
    robot, readings = bench([len(name), ord(name[0])])
    found = review(robot, spoil(readings))
    assert [(one.kind, list(one.columns)) for one in found.findings] == [(kind, columns)]
    for group in ("t", "beta", "alpha", "force", "position", "quaternion"):
        tolerance = 0.06 if kind == "joint_offset" else 1e-9  # where it is found by the fit, a home is off by its error
        np.testing.assert_allclose(getattr(found.readings, group), getattr(readings, group), atol=tolerance)


def test_unit_of_a_joint_at_rest():
    """What never moves says nothing of its unit: neither at 0, nor elsewhere, where another unit is another home."""
    robot, readings = bench(12, 3)
    still = simulation.simulate(robot, scaled(readings, "alpha", [1, 0, 1]), "jitter", 1)
    (found,) = review(robot, scaled(still, "alpha", 180 / np.pi)).findings
    assert (found.kind, found.columns) == ("joint_unit", ("alpha1", "alpha3"))
    at_rest = replace(readings, beta=readings.beta[:1] + 0 * readings.beta)
    named = {one.columns for one in hypotheses(robot, at_rest) if one.kind == "joint_unit"}
    assert named == {("beta1", "beta2", "beta3"), ("alpha1", "alpha2", "alpha3"), ("alpha1",), ("alpha2",), ("alpha3",)}


@pytest.mark.parametrize("n_tubes", [1, 2, 3, 4])
def test_right(n_tubes):
    """Nothing is named on tables of robots that differ from their file as real ones do."""
    for seed in range(2):
        noise = ("jitter", "realistic")[seed % 2]
        robot, readings = bench([100 + seed, n_tubes], n_tubes, noise=noise)
        found = review(robot, readings)
        assert (found.findings, found.unexplained) == ([], "")


def test_right_with_a_rough_tracker():
    """Jitter is no error of the table, however large it is beside the robot."""
    robot, readings = bench(19)
    deployed = 1e3 * np.median(np.max(readings.beta + robot.lengths, axis=1))
    robot.tracker.jitter_mm = 0.1 * deployed
    position = readings.position + np.random.default_rng(2).normal(0, 1e-4 * deployed, readings.position.shape)
    for table in (readings, replace(readings, position=position)):
        found = review(robot, table)
        assert (found.findings, found.unexplained) == ([], "")


@pytest.mark.parametrize("n_tubes", [2, 3])
def test_poses_of_other_rows(n_tubes):
    """Poses that belong to other joints are no known convention: none is named, and this is said."""
    robot, readings = bench(41, n_tubes)
    mixed = np.random.default_rng(1).permutation(len(readings))
    found = review(robot, replace(readings, position=readings.position[mixed], quaternion=readings.quaternion[mixed]))
    assert found.findings == []
    assert "wrong in another way" in found.unexplained


@pytest.mark.parametrize("n_tubes", [2, 3])
def test_positions_of_another_robot(n_tubes):
    """Positions that have nothing to do with the joints are in no other unit, though smaller ones err by less."""
    robot, readings = bench([7, n_tubes], n_tubes)
    anywhere = np.random.default_rng(n_tubes).normal(0, 0.05, readings.position.shape)
    found = review(robot, replace(readings, position=anywhere))
    assert not found.findings and "wrong in another way" in found.unexplained


def test_constant_orientation(files, run):
    """Quaternions that never change are no orientation."""
    robot, readings = bench(43)
    still = replace(readings, quaternion=np.tile([1.0, 0, 0, 0], (len(readings), 1)))
    code, out, error = run("compare", *files(robot, still), "--json", "-")
    data = json.loads(out)
    assert (code, data["conventions"], data["angle_deg"]) == (0, [], None)
    assert any("orientation never changes" in said for said in data["notices"])


@pytest.mark.parametrize(
    "effect", [{"friction__coefficient": 0.3}, {"tip_load__mass": 3e-3}, {"backlash_rotation__play": 0.05}]
)
def test_physics(hidden, effect):
    """A physical effect that the robot file lacks is no convention."""
    robot, readings = bench(3, 3, noise="realistic", hidden=lambda built: hidden(built, **effect))
    assert review(robot, readings).findings == []


def test_wrong_data_sheet():
    """Nor is a data sheet that is wrong by many of its standard deviations."""
    robot, readings = bench(5, 3)
    tubes = [tube.model_copy(update={"curvature_per_m": 1.2 * tube.curvature_per_m}) for tube in robot.tubes]
    tracker = robot.tracker.model_copy(update={"position_mm": [x + 5 for x in robot.tracker.position_mm]})
    alpha = readings.alpha + np.deg2rad([6, -5, 7])
    found = review(robot.model_copy(update={"tubes": tubes, "tracker": tracker}), replace(readings, alpha=alpha))
    assert found.findings == []


def test_out_of_order():
    """Where a tube is too short in the file for half of the readings, nothing is named that leaves a larger error."""
    random = np.random.default_rng(0)
    robot = design(random, 2)
    inner, outer = robot.actuation.home_translation_mm
    near = outer - 15.0 - inner  # so near to the outer tube's base that the inner one may not come from further out
    robot.tubes[0].length_mm -= near
    robot.actuation.home_translation_mm = [inner + near, outer]
    readings = session(robot, random)
    tips = 1e3 * readings.beta + [tube.length_mm for tube in robot.tubes]
    robot.tubes[0].length_mm -= float(np.quantile(tips[:, 0] - tips[:, 1], 0.45))
    assert all(before > after for before, after in (one.rms_mm for one in review(robot, readings).findings))


@pytest.mark.parametrize(("field", "size"), [("curvature_per_m", 1e-3), ("length_mm", 1e-3)])
def test_unit_of_file(field, size, files, run):
    """Values of the robot file in another unit are named as that, and what looks wrong in the file is said first."""
    robot, readings = bench(37)
    fields = (field, "curved_length_mm") if field == "length_mm" else (field,)
    tubes = [tube.model_copy(update={name: size * getattr(tube, name) for name in fields}) for tube in robot.tubes]
    paths = files(robot.model_copy(update={"tubes": tubes}), readings)
    code, out, error = run("compare", *paths, "--json", "-")
    [one] = json.loads(out)["conventions"]
    assert (code, one["kind"], one["columns"]) == (0, "file_unit", [])
    assert f"tubes[0].{field}: {getattr(robot.tubes[0], field):g}" in one["fix"]
    assert error.index("is this ") < error.index("Wrong conventions")


@pytest.mark.parametrize("wrong", [(0,), (0, 1)])
def test_radius(wrong):
    """Curvatures typed as radii in mm are named as that, and no other unit is."""
    robot, readings = bench(37)
    right = [tube.curvature_per_m for tube in robot.tubes]
    given = robot.model_copy(deep=True)
    for i in wrong:
        given.tubes[i].curvature_per_m = 1e3 / right[i]
    [one] = (found := review(given, readings)).findings
    assert one.kind == "file_unit" and "mm, not 1/m" in one.text
    np.testing.assert_allclose([tube.curvature_per_m for tube in found.robot.tubes], right)


def test_frame():
    """An inverse frame and a frame that is somewhere else are told apart, both with the right six numbers."""
    robot, readings = bench(7)
    rotation, origin = robot.tracker.rotation, robot.tracker.position
    other = Rotation.from_rotvec([0.5, -1.0, 0.7]).as_matrix()
    for kind, frame in (
        ("frame_inverse", (rotation.T, -rotation.T @ origin)),
        ("frame_wrong", (other @ rotation, origin + 0.1)),
    ):
        found = review(with_frame(robot, *frame), readings)
        assert [one.kind for one in found.findings] == [kind]
        np.testing.assert_allclose(found.robot.tracker.position, origin, atol=4e-3)
        np.testing.assert_allclose(found.robot.tracker.rotation, rotation, atol=0.05)


def test_all_known_exactly():
    """Where nothing is uncertain nothing is calibrated: a right table is right, with a floor."""
    robot, readings = bench(1)
    exact = robot.uncertainty.model_copy(update=dict.fromkeys(defaults.UNCERTAINTY, 0.0))
    exact = robot.model_copy(update={"uncertainty": exact})
    assert review(exact, readings).findings == []
    assert 0 < floors(exact, readings).expected_error_mm < 1


def test_two_faults():
    """Two wrong conventions at once are both named."""
    robot, readings = bench(11)
    rotation, origin = robot.tracker.rotation, robot.tracker.position
    spoiled = replace(scaled(readings, "alpha", [-1, 1]), quaternion=conjugate(readings.quaternion))
    found = review(with_frame(robot, rotation.T, -rotation.T @ origin), spoiled)
    assert {one.kind for one in found.findings} == {"frame_inverse", "joint_sign", "quaternion_inverse"}


def test_hidden_faults():
    """Two wrong conventions are named where neither alone makes the table better."""
    robot, readings = bench(11)
    turn = Rotation.from_rotvec([0.5, -1.0, 0.7]).as_matrix()
    other = with_frame(robot, turn @ robot.tracker.rotation, robot.tracker.position + 0.1)
    found = review(other, scaled(readings, "alpha", 180 / np.pi))
    assert {one.kind for one in found.findings} == {"joint_unit", "frame_wrong"}
    left = replace(scaled(readings, "position", [-100, 100, 100]), quaternion=mirror(readings.quaternion, 0))
    found = review(robot, replace(left, quaternion=np.roll(left.quaternion, -1, 1)))
    assert {one.kind for one in found.findings} == {"mirrored", "position_unit", "quaternion_order"}
    np.testing.assert_allclose(found.readings.quaternion, readings.quaternion, atol=1e-9)


@pytest.mark.parametrize("spoil", ["signs", "mirror"])
def test_mirror_or_signs(spoil):
    """Where the frame is wrong too, readings do not tell a mirror from angles that all count the other way."""
    robot, readings = bench(11)
    turn = Rotation.from_rotvec([0.5, -1.0, 0.7]).as_matrix()
    other = with_frame(robot, turn @ robot.tracker.rotation, robot.tracker.position + 0.1)
    if spoil == "signs":
        table = scaled(readings, "alpha", -1)
    else:
        table = replace(scaled(readings, "position", [-1, 1, 1]), quaternion=mirror(readings.quaternion, 0))
    for quaternion in (table.quaternion, None):
        frame, handed = sorted(review(other, replace(table, quaternion=quaternion)).findings, key=lambda one: one.kind)
        assert (frame.kind, {handed.kind, *(one.kind for one in handed.rivals)}) == (
            "frame_wrong",
            {"joint_sign", "mirrored"},
        )
    turned = replace(table, quaternion=np.roll(table.quaternion, -1, 1))
    assert "quaternion_order" in {one.kind for one in review(other, turned).findings}


def test_sensor_on_another_tube():
    """A sensor that sits on another tube than the file says is named with its tube."""
    robot, readings = bench(47)
    wrong = robot.model_copy(update={"tracker": robot.tracker.model_copy(update={"sensor_on_tube": 2})})
    [one] = (found := review(wrong, readings)).findings
    assert (one.kind, found.robot.tracker.sensor_on_tube) == ("sensor_tube", robot.tracker.sensor_on_tube)


@pytest.mark.parametrize(("kind", "move"), [("alpha", 0.35), ("beta", 4e-3)])
def test_run(kind, move):
    """A run that was homed elsewhere is named with its joint, and by how much it is off."""
    robot, readings = bench(13, 2)
    run = RUNS // 2
    offset = np.where((readings.run == run)[:, None], [move, 0.0], 0.0)
    [one] = review(robot, replace(readings, **{kind: getattr(readings, kind) - offset})).findings
    assert (one.kind, list(one.columns), list(one.runs)) == ("run_offset", [f"{kind}1"], [run])


OF_ONE_RUN = {**{name: FAULTS[name] for name in ("one sign", "all signs", "degrees", "order", "reaction")}} | {
    "left-handed": ("mirrored", ["y_m"], lambda m: scaled(m, "position", [1, -1, 1])),
    "exchanged": ("mirrored", ["x_m", "z_m"], lambda m: replace(m, position=m.position[:, ::-1])),
}


@pytest.mark.parametrize("name", OF_ONE_RUN)
def test_one_run(name):
    """What is wrong in one run alone is named with that run, and only that run is corrected."""
    kind, columns, spoil = OF_ONE_RUN[name]
    robot, readings = bench(29, 2)
    run, bad = 5, spoil(readings)
    here = (readings.run == run)[:, None]
    parts = {part: np.where(here, getattr(bad, part), getattr(readings, part)) for part in runs.CHANGED}
    found = review(robot, replace(readings, **parts))
    [one] = found.findings
    assert (one.kind, sorted(one.columns), list(one.runs)) == (kind, sorted(columns), [run])
    for part in runs.CHANGED:
        np.testing.assert_allclose(getattr(found.readings, part), getattr(readings, part), atol=1e-12)


@pytest.mark.parametrize("last", [[6], [5, 6, 7]])
def test_other_tube(last):
    """Runs with another tube are named with the tube, and left out of all that follows."""
    robot, readings = bench(31)
    other, here = with_other_tube(robot, readings, 1, 1.25), np.isin(readings.run, last)[:, None]
    parts = {name: np.where(here, getattr(other, name), getattr(readings, name)) for name in ("position", "quaternion")}
    found = review(robot, replace(readings, **parts))
    [one] = found.findings
    assert (one.kind, list(one.runs)) == ("tube_changed", last) and "tube 2" in one.text
    assert not np.isin(found.readings.run, last).any()


def test_frozen():
    """Rows in which the tracker repeats itself while the joints move are named, and only those."""
    robot, readings = bench(17)
    rows = np.arange(40, 50)[readings.run[40:50] == readings.run[39]]
    position, quaternion = readings.position.copy(), readings.quaternion.copy()
    position[rows], quaternion[rows] = position[39], quaternion[39]
    found = review(robot, replace(readings, position=position, quaternion=quaternion))
    [one] = found.findings
    assert (one.kind, list(one.rows)) == ("frozen", readings.row[rows].tolist())
    assert np.isnan(found.readings.position[rows]).all()


def test_frozen_from_the_first():
    """A tracker that gives one pose in all rows, so that no step tells its resolution, stood still too."""
    robot, readings = bench(17)
    still = {name: np.repeat(getattr(readings, name)[:1], len(readings), axis=0) for name in ("position", "quaternion")}
    found = review(robot, replace(readings, **still))
    elsewhere = (readings.load_space != readings.load_space[0]).any(axis=1)
    [one] = found.findings
    assert (one.kind, list(one.rows)) == ("frozen", readings.row[elsewhere].tolist())
    assert np.isnan(found.readings.position[elsewhere]).all() and not found.unexplained


def test_frozen_at_stops():
    """Where the robot stops while the tracker repeats an old pose, all readings of the stop are missing."""
    robot, readings = bench(17)
    twice = readings.rows(np.repeat(np.arange(len(readings)), 2))
    twice = replace(twice, t=np.arange(len(twice), dtype=float), row=np.arange(len(twice)) + 2)
    rows = np.arange(80, 90)[twice.run[80:90] == twice.run[79]]
    position, quaternion = twice.position.copy(), twice.quaternion.copy()
    position[rows], quaternion[rows] = position[79], quaternion[79]
    [one] = review(robot, replace(twice, position=position, quaternion=quaternion)).findings
    assert (one.kind, list(one.rows)) == ("frozen", twice.row[rows].tolist())


def test_frozen_across_runs():
    """A tracker that repeats its pose from one run into the next stood still in both."""
    robot, readings = bench(17)
    start = int(np.flatnonzero(readings.run == 3)[0])
    rows = np.arange(start - 3, start + 3)
    position, quaternion = readings.position.copy(), readings.quaternion.copy()
    position[rows], quaternion[rows] = position[start - 4], quaternion[start - 4]
    [one] = review(robot, replace(readings, position=position, quaternion=quaternion)).findings
    assert (one.kind, list(one.rows)) == ("frozen", readings.row[rows].tolist())


@pytest.mark.parametrize("late", [[2, 5], list(range(RUNS))])
def test_stale(late):
    """Runs whose poses are those of the row before are named; in a stream that is a delay, and no convention."""
    robot, readings = bench(23)
    rows = np.arange(len(readings))
    before = np.where(np.isin(readings.run, late) & (readings.run == readings.run[rows - 1]), rows - 1, rows)
    old = replace(readings, position=readings.position[before], quaternion=readings.quaternion[before])
    [one] = review(robot, old).findings
    assert (one.kind, list(one.runs)) == ("stale", late)
    assert "stale" not in [one.kind for one in review(robot, replace(old, t=old.t / 60)).findings]


def test_uncertain_sensor(files):
    """A sensor whose rotation the file says to be anywhere is not said to be turned."""
    robot, readings = bench(23)
    turned = product(readings.quaternion, Rotation.from_rotvec([1.0, 1.5, 0.5]).as_quat(scalar_first=True))
    wide = robot.uncertainty.model_copy(update={"sensor_rotation_deg": 104.0})
    table = replace(readings, quaternion=turned)
    assert [one.kind for one in review(robot, table).findings] == ["sensor_rotation"]
    assert review(robot.model_copy(update={"uncertainty": wide}), table).findings == []


def test_at_rest():
    """A tracker without noise that repeats its pose at rest did not stand still."""
    robot, readings = bench(19, noise="none")
    twice = np.repeat(np.arange(len(readings)), 2)
    held = replace(readings.rows(twice), t=np.arange(len(twice), dtype=float), row=np.arange(len(twice)) + 2)
    assert review(robot, held).findings == []


def test_unseen():
    """Tables without positions, or without a row that the model solves, end in no finding and no error."""
    robot, readings = bench(23)
    assert review(robot, replace(readings, position=None)).findings == []
    assert review(robot, replace(readings, beta=0 * readings.beta + 5.0)).findings == []


@pytest.fixture
def files(tmp_path):
    """files(robot, readings): paths of a robot file and of a table."""

    def write(robot, readings):
        robot_file.save(robot, tmp_path / "robot.yaml")
        simulation.write(readings, tmp_path / "measurements.csv")
        return tmp_path / "robot.yaml", tmp_path / "measurements.csv"

    return write


def test_commands(files, run):
    """`compare` says it in text and JSON; `diagnose` and fits stop there and say so."""
    robot, readings = bench(29)
    paths = files(robot, scaled(readings, "alpha", [1, -1]))
    code, out, _ = run("compare", *paths, "--json", "-")
    [one] = json.loads(out)["conventions"]
    assert (code, one["kind"], one["columns"]) == (0, "joint_sign", ["alpha2"])
    assert "--flip alpha2" in one["fix"]
    assert one["rms_mm"]["after"] < one["rms_mm"]["before"]
    answer = json.loads(run("diagnose", *paths, "--json", "-")[1])
    assert (answer["verdict"], answer["conventions"][0]["kind"]) == ("wrong_convention", "joint_sign")
    code, _, error = run("calibrate", "fit", *paths)
    assert code != 0
    assert "alpha2 counts the other way" in error
    assert "--anyway" in error


IMPORT = re.compile(r"ctcr import((?: --[a-z-]+ [^\s,;]+)+)")


def undone(hypothesis, readings):
    """The table that a hypothesis makes right: its changes of joints, forces and positions are affine."""
    made = {}
    for group in ("beta", "alpha", "force", "position"):
        values = getattr(readings, group)
        probe = np.vstack([np.zeros(values.shape[1]), np.eye(values.shape[1])])
        few = replace(readings.rows(np.arange(len(probe))), **{group: probe})
        at = getattr(hypothesis.change(few), group)
        made[group] = np.linalg.solve((at[1:] - at[0]).T, (values - at[0]).T).T
    return replace(readings, **made)


@pytest.mark.parametrize("n_tubes", [2, 3])
def test_fixes(n_tubes, files, run, tmp_path):
    """Each command that mends a table does what its hypothesis does: of joints, forces and positions."""
    robot, readings = bench(37, n_tubes, runs=2)
    robot.actuation.home_rotation_deg = [20.0, -35.0, 50.0][:n_tubes]
    tested = set()
    for one in hypotheses(robot, readings):
        if not (found := IMPORT.search(one.fix)):
            assert one.kind not in ("joint_sign", "joint_order", "joint_unit", "mirrored"), one.text
            continue
        paths = files(robot, undone(one, readings))
        options = found[1].replace("ROBOT", str(paths[0])).split()
        code, _, error = run("import", paths[1], *options, "-o", tmp_path / "mended.csv")
        assert code == 0, (one.text, error)
        mended = measurements.load(tmp_path / "mended.csv", n_tubes)
        for group in ("t", "beta", "alpha", "force", "position", "quaternion"):
            np.testing.assert_allclose(
                getattr(mended, group), getattr(readings, group), atol=1e-6, rtol=1e-6, err_msg=f"{one.text}: {group}"
            )
        tested.add(one.text)
    assert {"all betas count from home", "the tracker frame of the table is left-handed: x is mirrored"} <= tested


@pytest.mark.parametrize(
    ("kind", "spoil"),
    [
        ("joint_order", lambda robot, m: replace(m, alpha=m.alpha[:, ::-1])),
        ("joint_offset", lambda robot, m: replace(m, beta=m.beta + [1e-3 * tube.length_mm for tube in robot.tubes])),
        ("mirrored", lambda robot, m: scaled(m, "position", [1, -1, 1])),
    ],
)
def test_followed(kind, spoil, files, run, tmp_path):
    """What `compare` says to do makes the table right."""
    robot, readings = bench(41)
    paths = files(robot, spoil(robot, readings))
    [one] = json.loads(run("compare", *paths, "--json", "-")[1])["conventions"]
    assert one["kind"] == kind
    options = IMPORT.search(one["fix"])[1].replace("ROBOT", str(paths[0])).split()
    assert run("import", paths[1], *options, "-o", tmp_path / "mended.csv")[0] == 0
    mended = measurements.load(tmp_path / "mended.csv", robot.n_tubes)
    for group in ("beta", "alpha", "force", "position", "quaternion"):
        np.testing.assert_allclose(getattr(mended, group), getattr(readings, group), atol=1e-6)


def test_refused_table(files, run):
    """A table that the reader refuses is compared as it should be where a convention says how; else its error stays."""
    robot, readings = bench(31)
    paths = files(robot, scaled(readings, "beta", -1))
    code, out, _ = run("compare", *paths, "--json", "-")
    answer = json.loads(out)
    assert (code, answer["conventions"][0]["kind"]) == (0, "joint_sign")
    assert answer["rows"]["compared"] == len(readings)
    with pytest.raises(Exception, match="must be <= 0"):
        measurements.load(paths[1], robot.n_tubes)
    random = np.random.default_rng(1)
    paths = files(robot, replace(readings, beta=random.uniform(0, 1, readings.beta.shape)))
    code, _, error = run("compare", *paths)
    assert code != 0
    assert "behind the plate" in error


def test_documented():
    """Every kind of wrong convention stands in the page on formats."""
    page = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    for kind in {*DRAWN, *OF_RUNS, *(kind for kind, _, _ in FAULTS.values()), "stale", "sensor_tube", "file_unit"}:
        assert f"`{kind}`" in page, kind
