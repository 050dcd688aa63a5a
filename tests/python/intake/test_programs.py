"""Exports of other programs: NDI ToolBox, OptiTrack Motive, MATLAB, MCAP; poses and joints in two logs."""

import json
from datetime import datetime, timedelta

import numpy as np
import pytest
from ctcr.intake.log import distinct
from ctcr.table import measurements
from lab_logs import text
from scipy.io import savemat

JOINTS = ["t", "run", "beta1", "beta2", "alpha1", "alpha2"]
NDI_MISSING = ["-3.697314E28"] * 7


@pytest.fixture
def joints(truth, log):
    """The log of the joints beside a tracker's, whose rows also lie before and after it."""
    t = np.concatenate([[truth.t[0] - 1], truth.t, [truth.t[-1] + 1]])
    columns = [truth.run[[0, *range(24), 23]], truth.beta[[0, *range(24), 23]], truth.alpha[[0, *range(24), 23]]]
    return log(text(JOINTS, [t, *columns]), "joints.csv")


def ndi(truth, rotation: str) -> str:
    """Two tools; the second is the one at the tip, which is not seen in the fourth row."""
    group = {"quaternion": ["Q0", "Qx", "Qy", "Qz"], "euler": ["Rz", "Ry", "Rx"]}[rotation]
    marks = ["State", "Tx", "Ty", "Tz"]
    head = ["Tools"]
    for port in ("Port 0x01: Reference  s/n:1", "Port 0x02: Tip  s/n:2"):
        head += [port, "Frame", "Time [sec]", "Face", "State", *group, "Tx", "Ty", "Tz", "Error", "Markers", *marks]
    turn = truth.quaternion if rotation == "quaternion" else truth.rotation.as_euler("ZYX", degrees=True)
    lines = [",".join(head)]
    for i, (t, place) in enumerate(zip(truth.t, 1e3 * truth.position, strict=True)):
        still = ["1", "0", "0", "0"] if rotation == "quaternion" else ["0", "0", "0"]
        pose = [*(f"{v:.12g}" for v in (*turn[i], *place)), "0.1"]
        pose = pose if i != 3 else [*NDI_MISSING[: len(pose) - 1], "0"]
        state = "OK" if i != 3 else "Partially Out Of Volume"
        row = ["2", "Port 0x01", str(i), f"{t}", "0", "OK", *still, "1", "2", "3", "0.1", "1", "OK", "1", "2", "3"]
        row += ["Port 0x02", str(i), f"{t}", "0", state, *pose, "1", "OK", "7", "8", "9"]
        lines.append(",".join(row))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("rotation", ["quaternion", "euler"])
def test_ndi_toolbox(truth, log, joints, imported, rotation):
    """An export of NDI ToolBox, with quaternions or Euler angles, gives the true table; missing poses stay missing."""
    table, said = imported(log(ndi(truth, rotation)), "--joints", joints, "--sensor", "tip")
    seen = np.arange(24) != 3
    np.testing.assert_allclose(table.position[seen], truth.position[seen], atol=1e-9)
    cosine = np.abs(np.sum(table.quaternion * truth.quaternion, axis=1))
    np.testing.assert_allclose(cosine[seen], 1, atol=1e-9)
    assert np.isnan(table.position[3]).all() and np.isnan(table.quaternion[3]).all()
    np.testing.assert_allclose(table.beta, truth.beta, atol=1e-9)
    np.testing.assert_allclose(table.alpha, truth.alpha, atol=1e-9)
    np.testing.assert_array_equal(table.run, truth.run)
    assert "NDI ToolBox" in said and "1 row (5)" in said


def test_names_that_come_again(truth, log, joints, imported):
    """A column whose name comes again has a name of its own, also where another column has the name that it would get:
    all later columns keep their places."""
    lines = [line.split(",") for line in ndi(truth, "quaternion").split("\n")[:-1]]
    for taken in ("Face (2)", "Face (#7)"):
        more = [[taken, "Face"], *[["8", "9"]] * 24]
        wider = [",".join([*line[:5], *two, *line[5:]]) for line, two in zip(lines, more, strict=True)]
        table, _ = imported(log("\n".join(wider)), "--joints", joints, "--sensor", "tip")
        np.testing.assert_allclose(table.position[4:], truth.position[4:], atol=1e-9)
    assert distinct(["x", "x", "x (2)", "x"]) == ["x", "x (3)", "x (2)", "x (4)"]


def test_ndi_needs_joints_and_a_tool(truth, log, joints, refused):
    """Without a log of joints, or with an unknown tool, the error says which option helps."""
    path = log(ndi(truth, "quaternion"))
    assert "holds no joints: give their log with --joints" in refused(path, "--sensor", "tip")
    assert "Reference s/n:1" in (error := refused(path, "--joints", joints, "--sensor", "0x0")) and "--sensor" in error


@pytest.mark.parametrize("length", [("Meters", 1.0), ("Millimeters", 1e3)])
def test_motive(truth, log, joints, imported, length):
    """Header rows of types, names and properties; solved markers of the body are no bodies; empty where not seen."""
    unit, factor = length
    head = f"Format Version,1.23,Take Name,take,Capture Frame Rate,120.0,Rotation Type,Quaternion,Length Units,{unit}\n"
    head += "\n" + ",".join(["", "Type", *["Rigid Body"] * 8, *["Rigid Body Marker"] * 3]) + "\n"
    head += ",".join(["", "Name", *["Tip"] * 8, *["Tip:Marker1"] * 3]) + "\n"
    head += ",".join(["", "ID", *["A1"] * 11]) + "\n"
    head += ",".join(["", "", *["Rotation"] * 4, *["Position"] * 3, "Mean Marker Error", *["Position"] * 3]) + "\n"
    names = ["Frame", "Time (Seconds)", *"XYZWXYZ", "", *"XYZ"]
    poses = np.hstack(
        [truth.rotation.as_quat(), factor * truth.position, np.zeros((24, 1)), factor * truth.position + 1]
    )
    rows = text(names, [np.arange(24), truth.t, poses]).split("\n")
    rows[8] = ",".join([*rows[8].split(",")[:2], *[""] * 11])
    table, said = imported(log(head + "\n".join(rows)), "--joints", joints)
    seen = np.arange(24) != 7
    np.testing.assert_allclose(table.position[seen], truth.position[seen], atol=1e-9)
    np.testing.assert_allclose(np.abs(np.sum(table.quaternion * truth.quaternion, axis=1))[seen], 1, atol=1e-9)
    assert np.isnan(table.position[7]).all()
    np.testing.assert_allclose(table.beta, truth.beta, atol=1e-9)
    assert "OptiTrack Motive" in said


def test_joints_between_their_rows(truth, log, imported, refused):
    """Joints move in straight lines between the rows of their log; poses outside its times are dropped."""
    t = np.array([0.0, 1.0, 3.0])
    beta, alpha = np.array([[-0.3, -0.2], [-0.2, -0.1], [-0.2, -0.1]]), np.array([[0.0, 1.0], [1.0, 1.0], [-1.0, 1.0]])
    joint_log = log(text(["t", *JOINTS[2:]], [t, beta, alpha]), "joints.csv")
    times = np.array([-0.5, 0.25, 1.0, 2.0, 3.5])
    poses = log(text(["t", "x", "y", "z"], [times, truth.position[:5]]))
    table, said = imported(poses, "--joints", joint_log)
    np.testing.assert_allclose(table.beta, [[-0.275, -0.175], [-0.2, -0.1], [-0.2, -0.1]])
    np.testing.assert_allclose(table.alpha[:, 0], [0.25, 1.0, 0.0], atol=1e-12)
    assert "2 rows (2, 6)" in said
    moved, _ = imported(poses, "--joints", joint_log, "--offset", "t=0.5s")
    np.testing.assert_allclose(moved.alpha[:, 0], [0.0, 0.75, 0.5, -0.5], atol=1e-12)
    late = log(text(["t", "x", "y", "z"], [times + 100, truth.position[:5]]))
    assert "--offset t=" in refused(late, "--joints", joint_log)
    alpha[:, 1], beta[1:, 0], alpha[0, 0] = np.nan, np.nan, np.nan
    partial = log(text(["t", *JOINTS[2:]], [t, beta, alpha]), "partial.csv")
    assert "partial.csv: has no row with a time and all joints" in refused(poses, "--joints", partial)


@pytest.mark.parametrize("kind", ["date", "clock", "stamp"])
def test_clocks_of_two_kinds(truth, log, imported, refused, kind):
    """Beside seconds since a start, times of day and dates count from their first row, once an offset is given."""
    start = datetime(2026, 5, 4, 10, 15, 30)
    moments = [start + timedelta(seconds=t) for t in truth.t - truth.t[0]]
    if kind == "stamp":
        stamps = [f"{(moment - datetime(1970, 1, 1)).total_seconds():.6f}" for moment in moments]
    else:
        stamps = [f"{moment:{'%Y-%m-%dT' if kind == 'date' else ''}%H:%M:%S.%f}" for moment in moments]
    joints = log(text(["clock", *JOINTS[2:]], [stamps, truth.beta, truth.alpha]), "joints.csv")
    poses = log(text(["t", "x", "y", "z"], [truth.t - truth.t[0] + 3.0, truth.position]))
    assert "such as --offset t=" in refused(poses, "--joints", joints)
    table, _ = imported(poses, "--joints", joints, "--offset", "t=-3s")
    np.testing.assert_allclose(table.beta[1:-1], truth.beta[1:-1], atol=1e-6)


def test_one_log_without_times(truth, log, joints, imported, refused, tmp_path):
    """The error names the log that lacks times, and what to do; a frame number with its unit is a time."""
    t = np.round(truth.t / 0.005) * 0.005
    names = ["Frame", "x", "y", "z"]
    poses = log(text(names, [np.round(t / 0.005).astype(int), truth.position]))
    error = refused(poses, "--joints", joints)
    assert "log.csv: has no times, joints.csv has" in error and "--column t=NAME" in error and "Frame" in error
    kept = tmp_path / "lab.yaml"
    for said in (["--column", "t=Frame", "--unit", "t=5ms", "--save-mapping", kept], ["--mapping", kept]):
        table, _ = imported(poses, "--joints", joints, *said)
        np.testing.assert_allclose(np.diff(table.t), np.diff(t), atol=1e-9)
    one_by_one = log("\n".join(joints.read_text().split("\n")[:25]), "short.csv")
    assert "row by row, --ignore t" in refused(poses, "--joints", one_by_one)
    table, _ = imported(poses, "--joints", one_by_one, "--ignore", "t")
    np.testing.assert_allclose(table.positions, truth.position, atol=1e-9)


def test_two_counters(truth, log, imported, same, tmp_path):
    """Of two logs that count frames of different periods, that of the joints gets its times first; no row is lost."""
    count = np.arange(len(truth.t))
    imported(
        log(text(["cycle", *JOINTS[1:]], [50 * count, truth.run, truth.beta, truth.alpha])),
        *"--column t=cycle --unit t=0.7ms".split(),
    )
    timed = (tmp_path / "measurements.csv").rename(tmp_path / "timed.csv")
    poses = log(text(["frame", "x", "y", "z"], [count + 9, truth.position]))
    table, _ = imported(poses, "--joints", timed, *"--column t=frame --unit t=35ms --offset t=-0.315s".split())
    same(table, time=False, orientation=False, run=True)
    np.testing.assert_allclose(np.diff(table.t), 0.035, atol=1e-9)


def test_mat(truth, tmp_path, imported, same, refused):
    """A structure of matrices, of other variables too; 4 x 4 matrices along the third axis."""
    path = tmp_path / "log.mat"
    matrices = np.tile(np.eye(4), (24, 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = truth.rotation.as_matrix(), truth.position
    data = {"time": truth.t, "beta": 1e3 * truth.beta, "alpha": truth.alpha, "T": np.moveaxis(matrices, 0, 2)}
    savemat(path, {"log": data, "gain": 3.0, "notes": "first try"})
    table, said = imported(path, "--unit", "alpha=rad")
    same(table)
    assert "MATLAB" in said
    vectors = {"t": truth.t, "beta": truth.beta, "alpha": truth.alpha, "tip_pos": truth.position.T}
    savemat(path, vectors | {"quat": truth.rotation.as_quat(), "force": truth.force})
    table, _ = imported(path, "--quaternion", "xyzw")
    same(table, force=True)
    assert "--quaternion" in refused(path)
    path.write_bytes(b"MATLAB 5.0 MAT-file" + bytes(200))
    assert "damaged" in refused(path) or "no arrays" in refused(path)


@pytest.mark.parametrize("whole_runs", [False, True])
def test_mat_array_of_structures(truth, tmp_path, imported, same, whole_runs):
    """A structure is a row, or a run where it holds columns."""
    parts = (slice(0, 12), slice(12, 24)) if whole_runs else range(24)
    names = {"t": truth.t, "beta": truth.beta, "alpha": truth.alpha, "pos": truth.position}
    array = np.empty(len(parts), [(name, "O") for name in names])
    array[:] = [tuple(values[part] for values in names.values()) for part in parts]
    savemat(tmp_path / "log.mat", {"trials": array})
    table, _ = imported(tmp_path / "log.mat")
    same(table, orientation=False)
    assert np.ptp(table.run) == int(whole_runs)


def test_numpy(truth, tmp_path, imported, refused, same):
    """Named arrays of a .npz, times as numpy's dates among them; a matrix alone needs the names of its columns."""
    stamps = np.datetime64("2026-05-04T10:00:00", "ns") + np.round(1e9 * truth.t).astype("timedelta64[ns]")
    path = tmp_path / "log.npz"
    np.savez(path, time=stamps, beta=truth.beta, alpha=truth.alpha, position=truth.position, gain=3.0)
    same(imported(path)[0], orientation=False)
    path = tmp_path / "log.npy"
    np.save(path, np.column_stack([truth.t, truth.beta, truth.alpha, truth.position]))
    assert "--columns" in refused(path)
    same(imported(path, "--columns", "t,beta1..beta2,alpha1..alpha2,x,y,z")[0], orientation=False)


@pytest.mark.parametrize("form", ["lines", "list", "indented", "below a name", "arrays"])
def test_json(truth, log, imported, same, form):
    """JSON with an object a reading, or with arrays of all; null is not measured; a counter of frames is a clock."""
    frames = np.round(truth.t / 1e-6).astype(int).tolist()
    readings = [
        {"frame": frame, "joints": {"beta": beta, "alpha": alpha}, "pose": {"position": position}}
        for frame, beta, alpha, position in zip(
            frames, truth.beta.tolist(), truth.alpha.tolist(), truth.position.tolist(), strict=True
        )
    ]
    readings[0]["pose"] = None
    readings[4]["pose"]["position"] = None
    readings[5]["pose"]["position"] = [None] * 3
    del readings[7]["pose"]
    poses = [(each.get("pose") or {}).get("position") or [None] * 3 for each in readings]
    arrays = {"frame": frames, "beta": truth.beta.tolist(), "alpha": truth.alpha.tolist(), "position": poses}
    content = {
        "lines": "\n".join(map(json.dumps, readings)),
        "list": json.dumps(readings),
        "indented": json.dumps(readings, indent=1),
        "below a name": json.dumps({"name": "second", "readings": readings}),
        "arrays": json.dumps(arrays),
    }
    table, said = imported(log(content[form]), "--column", "t=frame", "--unit", "t=1us")
    unseen = [0, 4, 5, 7]
    assert np.isnan(table.positions[unseen]).all()
    table.positions[unseen] = truth.position[unseen]
    same(table, orientation=False)
    assert "(1, 5 to 6, 8)" in said


@pytest.mark.parametrize("written", [1, 2])
def test_labview_measurement(truth, log, imported, same, written):
    """A .lvm file: headers with numbers, units and decimal commas, one of them each time it was written to."""
    names = ["X_Value", "Trans 1", "Trans 2", "Rot 1", "Rot 2", "x", "y", "z"]
    end = "***End_of_Header***"
    head = ["LabVIEW Measurement\t", "Separator\tTab", "Decimal_Separator\t,", "Time\t14:03:22,887", end + "\t", "\t"]
    units = "\t".join(["Y_Unit_Label", "mm", "mm", "deg", "deg", "mm", "mm", "mm"])
    part = ["Channels\t7", "Samples" + "\t24" * 7, units, "X0" + "\t0,0E+0" * 7, "Delta_X" + "\t2,0" * 7, end]
    values = [truth.t, 1e3 * truth.beta, np.rad2deg(truth.alpha), 1e3 * truth.position]
    body = text(names, values, "\t", ",").split("\n")
    first = [f"{body[0]}\tComment", f"{body[1]}\tbegun", *body[2:13]]
    again = ["", *part, f"{body[0]}\tComment"] if written == 2 else []
    table, said = imported(log("\n".join([*head, *part, *first, *again, *body[13:]]), "log.lvm"))
    same(table, orientation=False)
    assert "Comment" in said and "guessed: unit" not in said


def test_mcap(truth, tmp_path, imported, same):
    """Our own export: joints and measurements on two channels, null for what was not measured."""
    writer_of = pytest.importorskip("mcap.writer", reason="mcap is not installed").Writer
    path = tmp_path / "recording.mcap"
    groups = measurements.group_columns(2)
    channels = {
        "/joints": ("t", "run", "beta", "alpha"),
        "/measurements": ("t", "run", "force", "position", "quaternion"),
    }
    with open(path, "wb") as file:
        writer = writer_of(file)
        writer.start()
        for topic, names in {**channels, "/reference": ("t",)}.items():
            channel = writer.register_channel(topic, "json", 0)
            values = np.column_stack([getattr(truth, name) for name in names])
            keys = [column for name in names for column in groups[name]]
            for row in values:
                message = dict(zip(keys, row.tolist(), strict=True))
                if "x_m" in message and row[0] == truth.t[2]:
                    message |= dict.fromkeys(groups["position"] + groups["quaternion"])
                time = round(1e9 * row[0])
                writer.add_message(channel, time, json.dumps(message).encode(), time)
        writer.finish()
    table, said = imported(path)
    assert np.isnan(table.position[2]).all() and "/reference" in said
    table.position[2], table.quaternion[2] = truth.position[2], truth.quaternion[2]
    same(table, run=True, force=True)
