"""Logs with the habits of different laboratories hold, once imported, what was written into them."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest
from ctcr.frames import conjugate
from lab_logs import text
from scipy.spatial.transform import Rotation


def test_matlab(truth, log, imported, same):
    """Milliseconds, degrees, millimetres of travel from flush tips, numbered quaternions, NaN, an index column."""
    names = ["", "Time_ms", "Trial", "Ext1_mm", "Ext2_mm", "Rot1_deg", "Rot2_deg", "X_mm", "Y_mm", "Z_mm"]
    names += ["q0", "q1", "q2", "q3"]
    poses = np.hstack([1e3 * truth.position, truth.quaternion])
    poses[5] = np.nan
    joints = [1e3 * truth.travel, np.rad2deg(truth.alpha)]
    content = text(names, [np.arange(24), 1e3 * truth.t, truth.run, *joints, poses])
    table, said = imported(log(content), "--translation", "from-flush", "--home-mm", "-300,-200")
    kept = np.delete(np.arange(24), 5)
    assert np.isnan(table.positions[5]).all() and np.isnan(table.quaternions[5]).all()
    np.testing.assert_allclose(table.t, truth.t, atol=1e-9)
    for name in ("t", "beta", "alpha", "position", "quaternion", "run"):
        assert len(getattr(table, name)) == 24

    fields = ("t", "run", "beta", "alpha", "force", "position", "quaternion", "row")
    same(replace(table, **{name: getattr(table, name)[kept] for name in fields}), kept, run=True)
    assert "1 row (7)" in said and "taken as w, x, y, z" in said


def test_labview(truth, log, imported, same):
    """Semicolons, decimal commas, a BOM, status lines, a row of units, the outermost tube first, a comma at the end."""
    head = "Messung 12;;;\nDate;27.11.2026;;\n\n"
    names = ["Time", "Tube 1 trans", "Tube 2 trans", "Tube 1 rot", "Tube 2 rot", "Px", "Py", "Pz", "Comment"]
    units = ["[s]", "[mm]", "[mm]", "[°]", "[°]", "[mm]", "[mm]", "[mm]", ""]
    columns = [truth.t, 1e3 * truth.beta[:, ::-1], np.rad2deg(truth.alpha[:, ::-1]), 1e3 * truth.position, ["ok"] * 24]
    body = text(names, columns, ";", ",").split("\n")
    content = head + "\n".join([body[0] + ";", ";".join(units) + ";", *(line + ";" for line in body[1:-1])]) + "\n"
    table, said = imported(log(content, encoding="utf-8-sig"), "--order", "outermost-first")
    same(table, orientation=False)
    assert "decimal commas" in said and "Comment" in said


def test_german(truth, log, imported, refused, same):
    """German names, a row of units with brackets, dashes and a date, row numbers, -9999 where nothing was seen."""
    names = ["Nr", "Zeitstempel", "Lauf", "Vorschub Innenrohr", "Vorschub Außenrohr", "Drehwinkel Innenrohr"]
    names += ["Drehwinkel Außenrohr", "Position X", "Position Y", "Position Z", "qx", "qy", "qz", "qw"]
    units = ["[-]", "[TT.MM.JJJJ]", "[-]", *["[mm]"] * 2, *["[Grad]"] * 2, *["[mm]"] * 3, *["[-]"] * 4]
    start = datetime(2026, 5, 4, 10, 15, 30)
    times = [f"{start + timedelta(seconds=t):%d.%m.%Y %H:%M:%S,%f}" for t in truth.t]
    pose = np.hstack([1e3 * truth.position, truth.rotation.as_quat()])
    pose[5] = -9999
    joints = [1e3 * truth.beta, np.rad2deg(truth.alpha)]
    head, body = text(names, [np.arange(24), times, truth.run + 1, *joints, pose], ";", ",").split("\n", 1)
    path = log("\r\n".join([head, ";".join(units), *body.split("\n")]), encoding="utf-8-sig")
    assert "in German it is --unit alpha=deg" in refused(path)
    table, said = imported(path, "--unit", "alpha=deg")
    kept = np.delete(np.arange(24), 5)
    same(table.rows(kept), kept)
    assert np.isnan(table.positions[5]).all() and len(np.unique(table.run)) == 2 and "Not used: Nr" in said


def test_ros(truth, log, imported, same):
    """Nanoseconds since 1970 with all digits, poses of tip and base side by side, the scalar of quaternions last."""
    stamp = 1_790_000_000_123_456_789
    base = Rotation.from_euler("xyz", [0.3, -0.2, 0.9])
    turned = base * truth.rotation
    places = base.apply(truth.position) + [1.0, 2.0, 0.5]
    names = ["%time", "field.joints.beta1", "field.joints.beta2", "field.joints.alpha1", "field.joints.alpha2"]
    names += [f"field.{marker}.pose.position.{axis}" for marker in ("tip", "base") for axis in "xyz"]
    names += [f"field.{marker}.pose.orientation.{axis}" for marker in ("tip", "base") for axis in "xyzw"]
    fixed = [np.tile([1.0, 2.0, 0.5], (24, 1)), np.tile(base.as_quat(), (24, 1))]
    times = [str(stamp + round(1e9 * t)) for t in truth.t]
    content = text(names, [times, truth.beta, truth.alpha, places, fixed[0], turned.as_quat(), fixed[1]])
    table, said = imported(log(content), "--relative-to", "base")
    same(table)
    assert str(stamp + round(1e9 * truth.t[0])) in said
    alone, said = imported(log(content))
    np.testing.assert_allclose(alone.position, places, atol=1e-9)
    assert "--relative-to" in said


def in_rows(truth, base, tools, step=0.0):
    """A log with a row for each of two tools, the second `step` later."""
    names = ["time_s", "run", "beta1", "beta2", "alpha1", "alpha2", "Tool ID", "x", "y", "z", "qx", "qy", "qz", "qw"]
    other = [np.tile([1.0, 2.0, 0.5], (24, 1)), np.tile(base.as_quat(), (24, 1))]
    tip = [base.apply(truth.position) + [1.0, 2.0, 0.5], (base * truth.rotation).as_quat()]
    tables = [
        text(names, [truth.t + k * step, truth.run, truth.beta, truth.alpha, [tools[k]] * 24, *pose]).split("\n")[:-1]
        for k, pose in enumerate((other, tip))
    ]
    return "\n".join(
        [tables[0][0], *(line for pair in zip(*(table[1:] for table in tables), strict=True) for line in pair)]
    )


@pytest.mark.parametrize("tools", [("base", "tip"), ("0A", "0B"), ("1", "2")])
def test_a_row_a_tool(truth, log, imported, refused, same, tools):
    """Rows of one time are one reading, in which --sensor and --relative-to choose as in any other log."""
    path = log(in_rows(truth, Rotation.from_euler("xyz", [0.3, -0.2, 0.9]), tools))
    same(imported(path, "--sensor", tools[1], "--relative-to", tools[0])[0], run=True)
    if tools[1] != "tip":
        assert "--sensor NAME" in refused(path)


def test_tools_with_times_of_their_own(truth, log, imported, refused, same):
    """No two tools are one reading: --sensor takes the rows of one, and without it the error names them."""
    path = log(in_rows(truth, Rotation.identity(), ("base", "tip"), 0.001))
    error = refused(path)
    assert "base and tip" in error and "--sensor NAME" in error and "--ignore Tool ID" in error
    assert "not of one time" in refused(path, "--sensor", "tip", "--relative-to", "base")
    table, said = imported(path, "--sensor", "tip")
    np.testing.assert_allclose(table.positions - [1.0, 2.0, 0.5], truth.position, atol=1e-9)
    assert len(table) == 24 and "only the rows of tip" in said
    assert len(imported(path, "--ignore", "Tool ID")[0]) == 48
    roles = "t,run,beta1..beta2,alpha1..alpha2,-,x,y,z,qx,qy,qz,qw"
    assert "--sensor NAME" in refused(path, "--columns", roles)
    assert len(imported(path, "--columns", roles, "--sensor", "tip")[0]) == 24


def test_matrices(truth, log, imported, same):
    """Spaces, no header, 4 x 4 matrices by rows or by columns, roles by their order."""
    matrices = np.zeros((24, 4, 4))
    matrices[:, :3, :3], matrices[:, :3, 3] = truth.rotation.as_matrix(), 1e3 * truth.position
    matrices[:, 3, 3] = 1
    for block in (matrices, np.swapaxes(matrices, 1, 2)):
        content = text([], [truth.t, truth.beta, truth.alpha, block.reshape(24, 16)], " ")
        roles = "t,beta1..beta2,alpha1..alpha2,m1..m16"
        table, _ = imported(log(content, "log.txt"), "--columns", roles, "--unit", "alpha=rad")
        same(table)


def test_named_matrices(truth, log, imported, same):
    """Matrices whose columns are named by row and column are read as poses."""
    names = ["t", "b1", "b2", "a1", "a2", *(f"T{i}{j}" for i in range(4) for j in range(4))]
    matrices = np.tile(np.eye(4), (24, 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = truth.rotation.as_matrix(), truth.position
    table, _ = imported(log(text(names, [truth.t, truth.beta, truth.alpha, matrices.reshape(24, 16)], "\t")))
    same(table)


def test_euler_angles(truth, log, imported, refused, same):
    """Each sequence means what it means in scipy; without one there is no guess."""
    names = ["time", "beta_1", "beta_2", "alpha_1", "alpha_2", "x", "y", "z", "rx", "ry", "rz"]
    for sequence in ("ZYX", "xyz", "YXZ"):
        angles = truth.rotation.as_euler(sequence, degrees=True)
        ordered = angles[:, [sequence.lower().index(axis) for axis in "xyz"]]
        path = log(text(names, [truth.t, truth.beta, truth.alpha, truth.position, ordered]))
        table, _ = imported(path, "--euler", sequence)
        same(table)
    assert "--euler ZYX" in refused(path)
    table, _ = imported(path, "--ignore", "rx,ry,rz")
    assert table.quaternion is None


def test_clocks(truth, log, imported, refused, same):
    """Times of many programs pass midnight; of day and month, the one that makes the log short comes first."""
    start = datetime(2026, 6, 5, 23, 59, 59, 900_000)
    moments = [start + timedelta(seconds=float(t)) for t in truth.t]
    forms = ["%Y-%m-%dT%H:%M:%S.%f", "%d-%b-%Y %H:%M:%S.%f", "%H:%M:%S.%f", "%H:%M:%S:%f", "%M:%S.%f"]
    forms += ["%Y-%m-%d %H-%M-%S.%f", "%d/%m/%y %H:%M:%S.%f", "%m/%d/%y %I:%M:%S.%f %p", "%d.%m.%Y %H:%M:%S,%f"]
    names = ["Timestamp", "beta1", "beta2", "alpha1", "alpha2", "x", "y", "z"]
    for form in forms:
        times = [moment.strftime(form) for moment in moments]
        table, said = imported(log(text(names, [times, truth.beta, truth.alpha, truth.position], ";")))
        same(table, orientation=False)
        assert f"t_s = 0 is {times[0]}" in said
    error = refused(log(text(names, [["noon"] * 24, truth.beta, truth.alpha, truth.position])))
    assert "'noon' is no time that is understood: 2026-05-04 10:15:30.25" in error


@pytest.mark.parametrize(
    ("names", "forms"),
    [(["Datum", "Uhrzeit"], ["%d.%m.%Y", "%H:%M:%S,%f"]), (["Date", "Time"], ["%m/%d/%Y", "%I:%M:%S.%f %p"])],
)
def test_days_beside_the_clock(truth, log, imported, names, forms):
    """A column of dates beside one of times of day tells that the second run was measured two days later."""
    start = datetime(2026, 5, 30, 22, 15)
    moments = [start + timedelta(days=2 * int(run), seconds=t) for t, run in zip(truth.t, truth.run, strict=True)]
    stamps = [[moment.strftime(form) for moment in moments] for form in forms]
    joints = ["beta1", "beta2", "alpha1", "alpha2"]
    path = log(text([*names, *joints], [*stamps, truth.beta, truth.alpha], ";"))
    table, said = imported(path)
    np.testing.assert_allclose(table.t, truth.t - truth.t[0] + 2 * 86400 * truth.run, atol=2e-6)
    assert "t_s (the day)" in said and f"t_s = 0 is {stamps[0][0]} {stamps[1][0]}" in said
    assert imported(path, "--ignore", names[0])[0].t[-1] < 1


def test_forces(truth, log, imported, same):
    """Millinewtons of the reaction."""
    names = ["t", "beta1", "beta2", "alpha1", "alpha2", "Fx [mN]", "Fy [mN]", "Fz [mN]", "x", "y", "z"]
    content = text(names, [truth.t, truth.beta, truth.alpha, -1e3 * truth.force, truth.position])
    table, _ = imported(log(content), "--flip", "force")
    same(table, force=True, orientation=False)


def test_weights(truth, log, imported, refused, run, tmp_path):
    """Grams hung at the tip pull along gravity."""
    names = ["t", "beta1", "beta2", "alpha1", "alpha2", "Load (g)", "x", "y", "z"]
    grams = np.arange(24.0)
    path, robot = log(text(names, [truth.t, truth.beta, truth.alpha, grams, truth.position])), tmp_path / "robot.yaml"
    assert "--robot" in refused(path)
    assert run("init", "-o", robot, "--example", 2, "--gravity", "-y")[0] == 0
    table, _ = imported(path, "--robot", robot)
    np.testing.assert_allclose(table.force, np.outer(grams, [0, -9.80665e-3, 0]), atol=1e-12)


def test_units_of_loads(truth, log, imported, refused):
    """Every unit of force or mass becomes newtons; forces of no such robot are asked for."""
    names = ["t", "beta1", "beta2", "alpha1", "alpha2", "fx{}", "fy{}", "fz{}", "x", "y", "z"]
    for unit, size in {"_kN": 1e3, " [cN]": 1e-2, "_kg": 9.80665, "_g": 9.80665e-3, " (lbf)": 4.4482216152605}.items():
        columns = [truth.t, truth.beta, truth.alpha, truth.force / size, truth.position]
        table, _ = imported(log(text([name.format(unit) for name in names], columns)))
        np.testing.assert_allclose(table.force, truth.force, atol=1e-9)
    columns[3] = 1e3 * truth.force
    assert "--unit force=mN" in refused(log(text([name.format("") for name in names], columns)))


def test_rotations(truth, log, imported, refused, same):
    """Rotation vectors; 3 x 4 matrices in one row, by rows or by columns; matrices of the inverse pose."""
    names, joints = ["t", "beta1", "beta2", "alpha1", "alpha2"], [truth.t, truth.beta, truth.alpha]
    for turns in (["rx", "ry", "rz"], ["wx", "wy", "wz"], ["rotvec_x", "rotvec_y", "rotvec_z"]):
        path = log(text([*names, "x", "y", "z", *turns], [*joints, truth.position, truth.rotation.as_rotvec()]))
        assert "--euler vector" in refused(path)
        same(imported(path, "--euler", "vector")[0])
    matrix = np.concatenate([truth.rotation.as_matrix(), truth.position[:, :, None]], axis=2)
    for layout in (matrix, np.swapaxes(matrix, 1, 2)):
        same(imported(log(text([*names, *(f"m{i}" for i in range(1, 13))], [*joints, layout.reshape(24, 12)])))[0])
    back = truth.rotation.inv()
    inverse = np.concatenate([back.as_matrix(), -back.apply(truth.position)[:, :, None]], axis=2).reshape(24, 12)
    grid = [f"T{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3, 4)]
    same(imported(log(text([*names, *grid], [*joints, inverse])), "--invert-quaternion")[0])


def test_middle_tube(truth, log, imported):
    """Beside i and o, m is the middle tube, no metre."""
    columns = np.column_stack([truth.beta[:, 0], truth.beta.mean(axis=1), truth.beta[:, 1]])
    names = ["t", "b_i", "b_m", "b_o", "a_i", "a_m", "a_o", "x", "y", "z"]
    path = log(text(names, [truth.t, 1e3 * columns, columns, truth.position]))
    table, _ = imported(path, "--unit", "alpha=rad", tubes=3)
    np.testing.assert_allclose(table.beta, columns, atol=1e-9)


def test_seconds_and_nanoseconds(truth, log, imported):
    """Stamps of ROS in two columns."""
    names = ["stamp.secs", "stamp.nsecs", "beta1", "beta2", "alpha1", "alpha2", "x", "y", "z"]
    whole = 1_790_000_000_900_000_000 + np.round(1e9 * truth.t).astype(int)
    parts = [[str(v // 10**9) for v in whole], [str(v % 10**9) for v in whole]]
    table, _ = imported(log(text(names, [*parts, truth.beta, truth.alpha, truth.position])))
    np.testing.assert_allclose(table.t, truth.t - truth.t[0], atol=2e-9)


def test_mends_of_our_own_table(truth, log, imported, same):
    """Each mend of a convention undoes it on a table of our own format."""
    names = "t_s,run,beta1_m,beta2_m,alpha1_rad,alpha2_rad,fx_N,fy_N,fz_N,x_m,y_m,z_m,qw,qx,qy,qz".split(",")
    right = {"t": truth.t, "run": truth.run, "beta": truth.beta, "alpha": truth.alpha, "force": truth.force}
    right |= {"position": truth.position, "quaternion": truth.quaternion}
    one, flipped = np.array([1.0, -1.0]), truth.position * [1, -1, 1]
    quarter = np.array([0.0, np.pi / 2])
    wrong = {
        "--flip alpha2": {"alpha": truth.alpha * one},
        "--flip alpha": {"alpha": -truth.alpha},
        "--unit alpha=deg": {"alpha": np.rad2deg(truth.alpha)},
        "--unit alpha1=deg": {"alpha": np.column_stack([np.rad2deg(truth.alpha[:, 0]), truth.alpha[:, 1]])},
        "--unit position=mm": {"position": 1e3 * truth.position},
        "--unit t=ms": {"t": 1e3 * truth.t},
        "--quaternion xyzw": {"quaternion": np.roll(truth.quaternion, -1, axis=1)},
        "--invert-quaternion": {"quaternion": conjugate(truth.quaternion)},
        "--flip force": {"force": -truth.force},
        "--order outermost-first": {"beta": truth.beta[:, ::-1], "alpha": truth.alpha[:, ::-1]},
        "--offset alpha2=90deg": {"alpha": truth.alpha - quarter},
        "--offset alpha2@1=90deg": {"alpha": truth.alpha - np.outer(truth.run == 1, quarter)},
        "--mirror y": {"position": flipped, "quaternion": truth.quaternion * [1, -1, 1, -1]},
    }
    for options, columns in wrong.items():
        table, said = imported(log(text(names, (right | columns).values())), *options.split())
        same(table, force=True, run=True)
        np.testing.assert_allclose(table.t, truth.t, atol=1e-9)
        assert "our format" in said


def test_mirror_is_a_reflection(truth):
    """The rotation of the mirrored frame is M R M."""
    from ctcr.intake.poses import Pose, mirrored

    for k, axis in enumerate("xyz"):
        turned = mirrored(Pose(truth.position, truth.quaternion), axis)
        m = np.diag(np.where(np.arange(3) == k, -1.0, 1.0))
        expected = m @ truth.rotation.as_matrix() @ m
        np.testing.assert_allclose(Rotation.from_quat(np.roll(turned.quaternion, -1, axis=1)).as_matrix(), expected)
        np.testing.assert_allclose(turned.position, truth.position @ m)
