"""What is tolerated, what is said, what is refused."""

import json
import re
from dataclasses import replace

import lab_logs
import numpy as np
import pytest
from ctcr.intake import choices
from ctcr.intake.names import meaning
from lab_logs import text

NAMES = ["t", "beta1", "beta2", "alpha1", "alpha2", "x", "y", "z"]


@pytest.fixture
def lines(truth):
    """The header and 24 rows of a plain log."""
    return text(NAMES, [truth.t, truth.beta, truth.alpha, truth.position]).split("\n")[:-1]


def test_tolerated(log, lines, imported, same):
    """Blank lines, comments, a header repeated, a last row cut off: passed over, and said with their rows."""
    messy = ["# robot 3", "", *lines[:5], "", "# pause", lines[0], *lines[5:], lines[-1][:20]]
    table, said = imported(log("\r\n".join(messy)))
    same(table, orientation=False)
    for words in ("row 9: a comment", "row 10: the header again", f"row {len(messy)}: cut off"):
        assert words in said


@pytest.mark.parametrize("note", ["# homing done", "% 1, 2, 3, 4, 5, 6, 7, 8", "homing done"])
def test_lines_below_the_header(log, lines, imported, same, note):
    """Comments and short lines, below the header, below its units and below the first row, hide none of them."""
    units = "[s],[m],[m],[rad],[rad],[m],[m],[m]"
    after = note if note[0] in "#%" else ""
    table, said = imported(log("\n".join([lines[0], note, units, note, lines[1], after, *lines[2:]])))
    same(table, orientation=False)
    assert "guessed: unit" not in said


@pytest.mark.parametrize(
    "header",
    [
        ["time,beta,beta,alpha,alpha,position,position,position", ",1,2,1,2,x,y,z"],
        ["time,beta,,alpha,,position,,", ",1,2,1,2,x,y,z"],
        [",inner,outer,inner,outer,tip,tip,tip", "t,trans,trans,rot,rot,x,y,z"],
        ["time,beta,,alpha,,tip,,", ",1,2,1,2,x,y,z", "s,m,m,rad,rad,m,m,m"],
    ],
)
def test_header_of_two_rows(log, lines, imported, same, header):
    """Names above numbers or axes, merged or not, are a name each column, and no reading where they come again."""
    same(imported(log("\n".join([*header, *lines[1:9], *header, *lines[9:]])))[0], orientation=False)


def test_lines_of_runs(log, lines, imported, same, refused):
    """A line that names a run begins it, where no column does; any other short line is a fault with what to do."""
    blocks = ["Run 3", *lines[:13], "", "# run_7", lines[0], *lines[13:]]
    table, said = imported(log("\n".join(blocks)))
    same(table, orientation=False)
    assert np.bincount(table.run).tolist()[3:] == [12, 0, 0, 0, 12] and "row 16: names a run" in said
    table, _ = imported(log("\n".join([*lines[:13], "Run 2", *lines[13:]])))
    np.testing.assert_array_equal(table.run, np.repeat([1, 2], 12))
    named = [f"{line},{'run' if i == 0 else 5}" for i, line in enumerate(lines)]
    table, _ = imported(log("\n".join([*named[:13], "Run 2", *named[13:]])))
    assert set(table.run) == {5}
    assert "one such as Run 2 begins a run" in refused(log("\n".join([*lines[:13], "Block B", *lines[13:]])))


@pytest.mark.parametrize("missing", ["", "NaN", "gone"])
def test_row_without_run(log, lines, imported, missing):
    """It is dropped, and the others keep the numbers of theirs."""
    runs = ["run", *["5"] * 11, missing, *["7"] * 12]
    rows = "\n".join(f"{line},{run}" for line, run in zip(lines, runs, strict=True))
    table, said = imported(log(rows), "--missing", "gone")
    np.testing.assert_array_equal(table.run, np.repeat([5, 7], [11, 12]))
    assert "without run, 1 row (13): dropped" in said


def test_names_in_columns(truth, log, imported, same):
    """Joints that ROS writes as names and positions are named by those; velocities are none."""
    joints = ["tube1_trans", "tube2_trans", "tube1_rot", "tube2_rot"]
    names = ["t", *(f"field.{word}{i}" for word in ("name", "position", "velocity") for i in range(4)), "x", "y", "z"]
    words = [[joint] * 24 for joint in joints]
    values = [truth.beta, truth.alpha, 0 * truth.beta, 0 * truth.alpha, truth.position]
    same(imported(log(text(names, [truth.t, *words, *values])))[0], orientation=False)


def test_faults_at_once(log, lines, refused):
    """Rows that do not fit are faults with their numbers, all of a kind at once."""
    short = [*lines]
    short[3], short[7] = "1,2,3", lines[7] + ",9,9"
    error = refused(log("\n".join(short)))
    assert "row 4: has 3 fields" in error and "row 8: has 10 fields" in error
    words = [*lines]
    words[4] = words[4].replace(words[4].split(",")[1], "oops", 1)
    words[6] = ",".join([*words[6].split(",")[:5], "what", *words[6].split(",")[6:]])
    error = refused(log("\n".join(words)))
    assert "row 5, beta1: 'oops' is not a number" in error and "row 7, x: 'what'" in error and "--missing" in error


def test_missing(truth, log, lines, imported):
    """Words and numbers for missing: the pose is left empty; without joints the row is dropped; both are said."""
    words = ("MISSING", "NaN", "", "-3.697314E28", "0", "none", "1e30", "gone", "?", ".", "<NA>", "-1.#IND", "nan(ind)")
    for word in words:
        changed = [*lines]
        changed[5] = ",".join([*lines[5].split(",")[:5], word, word, word])
        changed[9] = ",".join([lines[9].split(",")[0], "NaN", *lines[9].split(",")[2:]])
        table, said = imported(log("\n".join(changed)), "--missing", "gone")
        assert np.isnan(table.position[4]).all() and np.isfinite(table.position).all(axis=1).sum() == 22
        assert len(table) == 23 and "1 row (10): dropped" in said and "1 row (6): the pose is left empty" in said


def test_fields_that_are_no_words(log, lines, refused, imported, same):
    """Numbers of Fortran are read; units, vectors and thousands in a field are never taken for missing."""
    same(imported(log("\n".join([lines[0], lines[1].replace(",", "D+00,"), *lines[2:]])))[0], orientation=False)
    for field, words in (("12.5 mm", "holds its unit"), ("[1 2]", "several numbers"), ('"1,100.5"', "thousands")):
        changed = [*lines[:4], ",".join([lines[4].split(",")[0], field, *lines[4].split(",")[2:]]), *lines[5:]]
        error = refused(log("\n".join(changed)))
        assert words in error and "--missing" not in error


def test_fields_of_several_lines(truth, log, refused, imported, same):
    """A field that holds lines is judged alone: the decimal commas of its column stay numbers."""
    content = text(NAMES, [truth.t, truth.beta, truth.alpha, truth.position], delimiter=";", decimal=",").split("\n")
    before, beta, after = content[4].partition(content[4].split(";")[1])
    content[4] = f'{before}"{beta}\n"{after}'
    same(imported(log("\n".join(content)))[0], orientation=False)
    content[4] = f'{before}"saturated\nat the end"{after}'
    assert refused(log("\n".join(content))).count("is not a number") == 1


def test_identity_and_states(truth, log, imported):
    """The identity at the origin is no reading; nor is one that a column of states calls invalid."""
    names = [*NAMES, "qw", "qx", "qy", "qz", "visible"]
    poses = np.hstack([truth.position, truth.quaternion])
    poses[3] = [0, 0, 0, 1, 0, 0, 0]
    visible = [str(int(i != 8)) for i in range(24)]
    table, said = imported(log(text(names, [truth.t, truth.beta, truth.alpha, poses, visible])))
    assert np.flatnonzero(np.isnan(table.position[:, 0])).tolist() == [3, 8]
    assert "2 rows (5, 10)" in said


def test_names_of_quaternions(truth, log, imported, same):
    """Letters, numbers and words for the four columns, in any order of theirs."""
    by_letter = dict(zip("wxyz", truth.quaternion.T, strict=True))
    for w, x, y, z in (["qw", "qx", "qy", "qz"], ["q0", "qx", "qy", "qz"], ["quat_w", "quat_x", "quat_y", "quat_z"]):
        turned = [by_letter[letter] for letter in "xyzw"]
        names = [*NAMES, x, y, z, w]
        table, _ = imported(log(text(names, [truth.t, truth.beta, truth.alpha, truth.position, *turned])))
        same(table)


def test_constant_rotation(truth, log, imported):
    """A rotation that never changes was not measured."""
    names = [*NAMES, "qw", "qx", "qy", "qz"]
    still = np.tile([1.0, 0, 0, 0], (24, 1))
    table, said = imported(log(text(names, [truth.t, truth.beta, truth.alpha, truth.position, still])))
    assert table.quaternion is None and "never changes" in said


def test_two_columns_for_one_thing(truth, log, refused, imported, same):
    """Measured joints go before commanded ones; a real doubt is a question."""
    both = ["t", "beta1_cmd", "beta2_cmd", *NAMES[1:]]
    path = log(text(both, [truth.t, truth.beta + 1, truth.beta, truth.alpha, truth.position]))
    table, said = imported(path)
    same(table, orientation=False)
    assert "beta1_cmd" in said
    twice = ["t", "left_beta1", "right_beta1", *NAMES[2:]]
    path = log(text(twice, [truth.t, truth.beta[:, :1], truth.beta, truth.alpha, truth.position]))
    assert "--column beta1=" in refused(path)
    table, _ = imported(path, "--column", "beta1=left_beta1")
    same(table, orientation=False)


@pytest.mark.parametrize("given", ["sim", "cmd", "target", "pred", "model", "nominal", "fk", "theory"])
@pytest.mark.parametrize("measured", ["exp", "ndi", "gt", "tracker", "meas", "true", ""])
def test_given_poses_are_not_measured(truth, log, imported, same, given, measured):
    """What a model or a command gives is no measurement beside one, in any order and under any name of that."""
    for names in (["{}_x", "{}_y", "{}_z"], ["x_{}", "y_{}", "z_{}"]):
        both = [[name.format(word).strip("_") for name in names] for word in (given, measured)]
        content = text(
            [*NAMES[:5], *both[0], *both[1]], [truth.t, truth.beta, truth.alpha, truth.position + 1, truth.position]
        )
        table, said = imported(log(content))
        same(table, orientation=False)
        assert f"Not used: {', '.join(both[0])}" in said


def test_given_poses_alone(truth, log, imported, refused):
    """Without a measured one, a given pose is taken and said; two measured ones are a question that names both."""
    columns = [truth.t, truth.beta, truth.alpha, truth.position]
    assert "not measured" in imported(log(text([*NAMES[:5], "x_sim", "y_sim", "z_sim"], columns)))[1]
    both = [f"{axis}_{word}" for word in ("raw", "filt") for axis in "xyz"]
    error = refused(log(text([*NAMES[:5], *both], [*columns, truth.position])))
    assert "raw and filt" in error and "--sensor" in error


def test_markers_by_any_spelling(truth, log, imported, same):
    """A marker is found without the signs in its name; one without a name goes by its first column; a rotation without
    a name is the sensor's."""
    names = [f"EM{i}_{axis}" for i in (1, 2) for axis in "xyz"]
    poses = log(text([*NAMES[:5], *names], [truth.t, truth.beta, truth.alpha, truth.position + 1, truth.position]))
    same(imported(poses, "--sensor", "EM2")[0], orientation=False)
    names = [*NAMES, "x_raw", "y_raw", "z_raw", "qw", "qx", "qy", "qz"]
    columns = [truth.t, truth.beta, truth.alpha, truth.position, truth.position + 1, truth.quaternion]
    same(imported(log(text(names, columns)), "--sensor", "x")[0])
    names = [*NAMES[:5], "x_base", "y_base", "z_base", "x_tip", "y_tip", "z_tip", "qw", "qx", "qy", "qz"]
    columns[3:5] = [truth.position + 1, truth.position]
    same(imported(log(text(names, columns)))[0])


@pytest.mark.parametrize(
    ("column", "words", "option"),
    [
        ("beta1 [furlong]", "furlong is no unit of length", "--unit beta="),
        ("beta1_counts", "counts is no unit of length", "--unit beta="),
        ("beta1 [deg]", "deg is no unit of length", "--unit beta="),
        ("alpha1_steps", "steps is no unit of angle", "--unit alpha="),
        ("alpha1 (Grad)", "Grad is no unit of angle", "--unit alpha=deg"),
        ("t_ticks", "ticks is no unit of time", "--unit t="),
        ("x [px]", "px is no unit of length", "--unit position="),
        ("mass", "has no unit", "--unit force="),
    ],
)
def test_units_are_asked_for(truth, log, lines, refused, column, words, option):
    """A stated unit that is not known, or none of a weight, is never guessed; the option that says it is named."""
    columns = [truth.t, truth.beta, truth.alpha, truth.position]
    names = [column if column.startswith(name) else name for name in NAMES] + ["mass"] * (column == "mass")
    error = refused(log(text(names, [*columns, np.full(24, 20.0)][: len(columns) + (column == "mass")])))
    assert words in error and column in error and option in error


def test_counts(truth, log, imported, refused, same):
    """Numbers that can only be counts are asked for with the option that says how long one is."""
    path = log(text(NAMES, [truth.t, truth.beta / 2.5e-6, truth.alpha, truth.position]))
    assert "--unit beta=0.0025mm" in refused(path)
    same(imported(path, "--unit", "beta=0.0025mm")[0], orientation=False)


def test_words_for_missing_as_numbers(truth, log, imported):
    """One number in all three coordinates stands for a pose that was not seen."""
    for word in (-1.0, 999.0, -9999.0):
        position = truth.position.copy()
        position[5] = word
        table, said = imported(log(text(NAMES, [truth.t, truth.beta, truth.alpha, position])), "--unit", "position=m")
        assert np.flatnonzero(np.isnan(table.position[:, 0])).tolist() == [5] and "1 row (7): the pose" in said


def test_numbers_for_missing(truth, log, imported):
    """--missing takes numbers, too. One number in all coordinates and angles of a pose is one that was not seen."""
    angles = np.rad2deg(truth.rotation.as_euler("ZYX"))
    columns = [truth.t, 1e3 * truth.beta, np.rad2deg(truth.alpha), 1e3 * truth.position, angles]
    names = ["t", "beta1_mm", "beta2_mm", "alpha1_deg", "alpha2_deg", "x_mm", "y_mm", "z_mm", "yaw", "pitch", "roll"]
    for word, options in ((-9999.0, []), (-1.0, []), (-77.5, ["--missing", "-77.5"])):
        for column in columns[3:]:
            column[5] = word
        columns[4][5, :2] = -12.0 if options else word
        table, said = imported(log(text(names, columns)), "--euler", "ZYX", *options)
        assert np.flatnonzero(~table.measured).tolist() == [5] and "1 row (7): the pose" in said


def test_number_for_missing_joints(truth, log, imported, refused):
    """A number that no joint has, in a few rows, may stand for a missing one: the option that drops them is named."""
    beta = 1e3 * truth.beta
    beta[7] = -9999
    path = log(text([*NAMES[:1], "beta1_mm", "beta2_mm", *NAMES[3:]], [truth.t, beta, truth.alpha, truth.position]))
    error = refused(path)
    assert "row 9" in error and "--missing -9999" in error and "encoder" not in error
    assert len(imported(path, "--missing", "-9999")[0]) == 23


def test_order_of_quaternions_is_shown(truth, log, imported, same):
    """The list of columns says what each of four numbered ones becomes by --quaternion."""
    names = [*NAMES, "q1", "q2", "q3", "q4"]
    quaternions = np.roll(truth.quaternion, -1, axis=1)
    path = log(text(names, [truth.t, truth.beta, truth.alpha, truth.position, quaternions]))
    table, said = imported(path, "--quaternion", "xyzw")
    same(table)
    assert [line.split()[:2] for line in said.splitlines() if re.match(r" +q\d", line)] == [
        ["q1", "qx"],
        ["q2", "qy"],
        ["q3", "qz"],
        ["q4", "qw"],
    ]


def test_wrapped_angles(truth, log, imported, same):
    """Jumps of a whole turn are a doubt, and taken out where that is asked for."""
    slow = replace(truth, alpha=np.linspace([0.1, 0], [12, -9], 24))
    path = log(text(NAMES, [truth.t, truth.beta, slow.alpha % (2 * np.pi), truth.position]))
    assert "alpha1 and alpha2: jumps by nearly a whole turn, 3 times" in imported(path)[1]
    table, said = imported(path, "--unwrap", "alpha")
    np.testing.assert_allclose(table.alpha, slow.alpha, atol=1e-9)
    assert "whole turn" not in said


@pytest.fixture
def robot(run, tmp_path):
    """Of two tubes, 420 and 300 mm long."""
    path = tmp_path / "robot.yaml"
    assert run("init", "-o", path, "--example", 2)[0] == 0
    return path


def test_joints_that_the_robot_cannot_have(truth, log, imported, refused, robot):
    """Tubes that end behind the plate or inside an outer one, or hardly move, are said with what may be wrong."""

    def path(beta):
        return log(
            text([*NAMES[:1], "beta1 [m]", "beta2 [m]", *NAMES[3:]], [truth.t, beta, truth.alpha, truth.position])
        )

    assert "Doubt" not in imported(path(truth.beta), "--robot", robot)[1]
    assert "behind the plate" in refused(path(truth.beta * [2, 2]), "--robot", robot)
    retracted = np.where(np.arange(24)[:, None] == 3, [-0.43, -0.2], truth.beta)
    assert "in 1 row (5) a tube" in imported(path(retracted), "--robot", robot)[1]
    assert "--unit beta=m" in imported(path(1e-3 * truth.beta * 0.5), "--robot", robot)[1]
    order = ["--robot", robot, "--translation", "from-flush"]
    assert "--order" in refused(path(truth.travel[:, ::-1] + [0, 0.01]), *order)


def test_travel_is_asked_for(truth, log, refused):
    """Positive translations are not guessed: the error names what they may be."""
    error = refused(log(text(NAMES, [truth.t, truth.travel, truth.alpha, truth.position])))
    assert "from-flush" in error and "--flip beta" in error and "row 2" in error


def test_constant_joint(truth, log, imported, refused):
    """A joint that never moves may be left out of a log, once that is said."""
    names = ["t", "beta1", "alpha1", "alpha2", "x", "y", "z"]
    path = log(text(names, [truth.t, truth.beta[:, 0], truth.alpha, truth.position]))
    assert "--constant beta2=0mm" in refused(path)
    table, _ = imported(path, "--constant", "beta2=-12mm")
    np.testing.assert_allclose(table.beta[:, 1], -0.012)
    still = ["--constant", "beta2=0mm", "--offset", "alpha=0deg", "--offset", "t=0s"]
    assert not imported(path, *still)[0].beta[:, 1].any()


def test_mapping_for_the_next_log(truth, log, imported, same, tmp_path):
    """What was said and guessed of one log reads the next, whose numbers would be guessed otherwise."""
    names = ["Time_ms", "Ext1", "Ext2", "Rot1", "Rot2", "X", "Y", "Z"]
    first = [1e3 * truth.t, 1e3 * truth.travel, np.rad2deg(truth.alpha), 1e3 * truth.position]
    kept = tmp_path / "lab.yaml"
    home = ["--translation", "from-flush", "--home-mm", "-300,-200"]
    imported(log(text(names, first)), *home, "--save-mapping", kept)
    small = [1e3 * truth.t, 1e3 * truth.travel, np.rad2deg(truth.alpha) / 100, 1e3 * truth.position]
    table, said = imported(log(text(names, small)), "--mapping", kept)
    np.testing.assert_allclose(table.alpha, truth.alpha / 100, atol=1e-9)
    assert "option" in said and "guessed" not in said
    table, _ = imported(log(text(names, small)), "--mapping", kept, "--unit", "alpha=rad")
    np.testing.assert_allclose(table.alpha, np.rad2deg(truth.alpha) / 100, atol=1e-9)


def test_mapping_of_markers_and_of_two_logs(truth, log, imported, same, tmp_path):
    """Which marker in which frame, and which log has the joints, are kept too; so is a unit that only one log needs."""
    kept, base = tmp_path / "lab.yaml", np.tile([0.1, 0.2, 0.3, 1.0, 0, 0, 0], (24, 1))
    names = ["time_s", *(f"{m}_{c}" for m in ("a", "b") for c in ("x", "y", "z", "qw", "qx", "qy", "qz"))]
    poses = log(text(names, [truth.t, truth.position + [0.1, 0.2, 0.3], truth.quaternion, base]))
    joints = log(text(["time", *NAMES[1:5]], [1e3 * truth.t, truth.beta, truth.alpha]), "joints.csv")
    said = ["--joints", joints, "--sensor", "a", "--relative-to", "b", "--unit", "t=ms", "--save-mapping", kept]
    same(imported(poses, *said)[0])
    same(imported(poses, "--joints", joints, "--mapping", kept)[0])


def test_mapping_survives_its_file(tmp_path):
    """Every choice, with names of columns that YAML would read otherwise, comes back as it was."""
    path = tmp_path / "lab.yaml"
    given = choices.Choices(
        columns={"beta1": 'a "quoted" \\ name: #1', "y": "no", "t": "1e3", "x": "tab\there", "z": " é𝛼"},
        units={"alpha": "0.1deg"},
        home_mm=[-1.5, -2.0],
        translation="from-home",
        missing=["null", "~"],
        flip=["alpha2"],
        invert_quaternion=True,
        euler="ZYX",
        offsets={"alpha1": "90deg"},
    )
    choices.save(given, path)
    assert choices.load(path) == given


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("colums:\n  t: Time", "did you mean columns"),
        ("columns: 3", "needs names with values"),
        ("columns:\n  gamma1: x", "gamma1"),
        ("euler: ZZX", "sequence"),
        ("- 1", "does not map columns"),
    ],
)
def test_faulty_mapping(log, lines, refused, tmp_path, content, words):
    """Each fault of a mapping file is named."""
    path = tmp_path / "lab.yaml"
    path.write_text(content)
    assert words in refused(log("\n".join(lines)), "--mapping", path)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--unit", "alpha=mm"], "no unit of angle"),
        (["--unit", "gamma=mm"], "gamma"),
        (["--flip", "x"], "--mirror x"),
        (["--column", "beta1=bta1"], "did you mean beta1"),
        (["--column", "beta9x=beta1"], "is not known"),
        (["--unit", "beta=0mm"], "makes all numbers 0"),
        (["--offset", "alpha2=90"], "has no unit: write 90deg"),
        (["--offset", "t=2"], "has no unit: write 2s"),
        (["--offset", "alpha2@7=90deg"], "no alpha2 in a run 7"),
        (["--flip", "alpha3"], "there are 2 tubes"),
        (["--euler", "ZY"], "sequence of axes"),
        (["--sensor", "tip"], "fits none"),
        (["--translation", "from-flush"], "--robot"),
        (["--home-mm", "1,2,3", "--translation", "from-home"], "needs 2"),
        (["--home-mm", "1,2"], "needs --translation"),
        (["--home-mm", "-300,inf", "--translation", "from-home"], "is not a list of finite numbers"),
        (["--unit", "alpha"], "NAME=VALUE"),
    ],
)
def test_faulty_options(log, lines, refused, options, words):
    """Each fault of an option is named."""
    assert words in refused(log("\n".join(lines)), *options)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"PK\3\4", "spreadsheet"),
        (b"\xd0\xcf\x11\xe0" + bytes(9), "spreadsheet"),
        (b"\x80\4\x95", "frame.to_csv"),
        (b'[{"t": 1}]', "an object a reading"),
        (b"{}", "an object a reading"),
        (b'{"t": 1}\n{"t": 2}\n{"t"\n', "line 3: is damaged JSON"),
        (b'{\n"t": 1,\n"a"}', "is damaged JSON"),
        (b'{"a": [[1], [1, 2]]}', "lists of several lengths"),
        (b'{"a": ' + 100_000 * b"[", "is damaged JSON"),
        (b"\x93NUMPY", "numpy.savez"),
        (b"\x00\x01\x02" * 50, "neither text"),
        (b"hello\nworld\n", "no rows of numbers"),
        (b"a,b,c\n1,2,3\n4,5,6\n", "looks like a joint"),
    ],
)
def test_no_log(log, refused, content, words):
    """A file that is no log is refused with its kind."""
    assert words in refused(log(content))


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-32-le", "utf-32-be", "utf-16", "utf-32"])
def test_wide_characters(log, lines, imported, same, encoding):
    """Text of two or four bytes a character, with or without a mark in front."""
    same(imported(log("\n".join(lines), encoding=encoding))[0], orientation=False)


@pytest.mark.parametrize("epoch", [719529, 25569])
def test_days(truth, log, imported, refused, same, epoch):
    """Days since an epoch may be seconds too: the error asks, and either unit answers it."""
    days = [f"{epoch + 20000 + t / 86400:.12f}" for t in truth.t]
    path = log(text(NAMES, [days, truth.beta, truth.alpha, truth.position]))
    assert "--unit t=day or --unit t=s" in refused(path)
    table, _ = imported(path, "--unit", "t=day")
    np.testing.assert_allclose(table.t, truth.t - truth.t[0], atol=2e-5)
    assert np.ptp(imported(path, "--unit", "t=s")[0].t) < 1e-4
    same(
        imported(log(text(["time_h", *NAMES[1:]], [truth.t / 3600, truth.beta, truth.alpha, truth.position])))[0],
        orientation=False,
    )


def test_windows_stamps(truth, log, imported, same):
    """Times in steps of 100 ns are too few for nanoseconds since 1970."""
    stamps = [str(133_900_000_090_000_000 + round(1e7 * t)) for t in truth.t]
    same(imported(log(text(NAMES, [stamps, truth.beta, truth.alpha, truth.position])))[0], orientation=False)


def test_times_that_start_again(truth, log, imported):
    """Runs without a column: the clock starts again, and goes on from there. Rows out of order, or back in time, do
    not."""
    t = np.concatenate([np.arange(10), 0.5 + np.arange(8), np.arange(6)])
    table, said = imported(log(text(NAMES, [t, truth.beta, truth.alpha, truth.position])))
    np.testing.assert_array_equal(table.run, np.repeat([0, 1, 2], [10, 8, 6]))
    assert "times start again: 3 runs" in said and "Doubt" not in said
    t = np.arange(24.0)
    t[[6, 7, 15]] = 7, 6, 2
    table, said = imported(log(text(NAMES, [t, truth.beta, truth.alpha, truth.position])))
    assert not table.run.any() and "2 rows do not come after" in said and "--ignore t" in said
    table, said = imported(log(text(NAMES, [np.arange(24.0)[::-1], truth.beta, truth.alpha, truth.position])))
    assert not table.run.any() and "23 rows do not come after" in said


def test_options_without_effect(log, lines, imported):
    """A mend of what the log lacks is said to do nothing."""
    _, said = imported(log("\n".join(lines)), "--flip", "force", "--invert-quaternion", "--mirror", "x")
    assert "--flip force has no effect" in said and "--invert-quaternion has no effect" in said
    assert "--mirror has" not in said


def test_inputs_are_kept(log, lines, run, tmp_path):
    """An output never overwrites an input, by whatever name."""
    path = log("\n".join(lines))
    before = path.read_bytes()
    (tmp_path / "link.csv").symlink_to(path)
    for target in (path, tmp_path / "link.csv"):
        code, _, err = run("import", path, "-o", target)
        assert code == 2 and "is also that of" in err and path.read_bytes() == before


def test_json(log, lines, run, tmp_path):
    """The JSON holds the size of the table and the meaning of each column."""
    code, out, _ = run("import", log("\n".join(lines)), "-o", tmp_path / "out.csv", "--json", "-")
    data = json.loads(out)
    assert code == 0 and data["rows"] == 24 and data["tubes"] == 2
    assert {row["column"]: row["becomes"] for row in data["logs"][0]["columns"]}["beta1"] == "beta1_m"


@pytest.mark.parametrize(
    ("name", "role", "tube", "unit"),
    [
        ("tube2_rot [deg]", "alpha", 2, "deg"),
        ("Trans 1 / mm", "beta", 1, "mm"),
        ("θ₁ (°)", "alpha", 1, "deg"),
        ("innerTrans_mm", "beta", -3, "mm"),
        ("Timestamp (ms)", "t", 0, "ms"),
        ("force_x_N", "fx", 0, "N"),
        ("Tip Tx", "x", 0, None),
        ("Rotation W", "ow", 0, None),
        ("pitch (deg)", "ry", 0, "deg"),
        ("r12", "m12", 0, None),
        ("x2", "x", 0, None),
        ("rot_i", "alpha", -3, None),
        ("nsecs", "nsec", 0, "ns"),
        ("TubeOneRotDeg", "alpha", 1, "deg"),
        ("beta1mm", "beta", 1, "mm"),
        ("x_in", "x", 0, "inch"),
        ("rot_in", "alpha", -3, None),
        ("y_0.1mm", "y", 0, "0.1mm"),
        ("load_kg", "weight", 0, "kgf"),
        ("fz [lb]", "fz", 0, "lbf"),
        ("alpha1 [gon]", "alpha", 1, "gon"),
        ("rot2_steps", "alpha", 2, "steps"),
        ("x [furlong]", "x", 0, "furlong"),
        ("x (tip)", "x", 0, None),
        ("Time (UTC)", "t", 0, None),
        ("T [degC]", "t", 0, "degC"),
        ("azimuth", "rz", 0, None),
        ("Vorschub 1 [mm]", "beta", 1, "mm"),
        ("Weg Innenrohr (mm)", "beta", -3, "mm"),
        ("Drehwinkel Außenrohr [°]", "alpha", -1, "deg"),
        ("Zeitstempel [TT.MM.JJJJ]", "t", 0, None),
        ("Uhrzeit [hh:mm:ss]", "t", 0, None),
        ("Spitze x [mm]", "x", 0, "mm"),
        ("Gier (°)", "rz", 0, "deg"),
    ],
)
def test_names(name, role, tube, unit):
    """Names of columns as laboratories write them have their meaning and unit."""
    found = meaning(name)
    assert (found.role, found.tube, found.unit and found.unit.text) == (role, tube, unit)


@pytest.mark.parametrize(
    "name", ["index", "Unnamed: 0", "current_1_A", "alpha1_vel", "", "#3", "rot_360", "wx [rad/s]"]
)
def test_names_of_nothing(name):
    """Names of other quantities have no meaning."""
    assert meaning(name) is None


@pytest.mark.parametrize(("slip", "there"), [("x", "y and z"), ("y", "x and z"), ("qx", "qw, qy and qz")])
def test_slip_in_a_name(truth, log, refused, imported, same, slip, there):
    """A position or a quaternion that lacks one column is a fault that names the others, and what it may be."""
    names = [*NAMES, "qw", "qx", "qy", "qz"]
    content = text(names, [truth.t, truth.beta, truth.alpha, truth.position, truth.quaternion])
    path = log(re.sub(rf"\b{slip}\b", "[red]nonsense", content, count=1))
    words = f"{there} look like a {'quaternion' if 'q' in slip else 'position'} without {slip}: give --column {slip}="
    said = refused(path)
    assert words in said and "not used: [red]nonsense" in said
    same(imported(path, "--column", f"{slip}=[red]nonsense")[0])
    others = there.replace(" and ", ", ").split(", ")
    assert "left out" not in imported(path, *(part for name in others for part in ("--ignore", name)))[1]


def test_decimal_commas_between_commas(truth, log, refused):
    """Are named as what they are, also where some numbers are whole."""
    content = text(["run", *NAMES], [0 * truth.t, truth.t, truth.beta, truth.alpha, truth.position], decimal=",")
    said = refused(log(content))
    assert "17 fields a row and 9 names" in said and "decimal commas cannot be told" in said


def test_name_without_its_unit(truth, log, imported, same, refused):
    """A column is found by its name in the file, though the unit below is appended; not where two have that name."""
    names, units = ["Zeit", "V1", "V2", "Winkel A", "Winkel B", "x", "y", "z"], "[s],[mm],[m],[rad],[rad],[m],[m],[m]"
    values = [truth.t, truth.beta * [1e3, 1], truth.alpha, truth.position]
    lines = text(names, values).split("\n")
    path = log("\n".join([lines[0], units, *lines[1:]]))
    roles = ["beta1=V1", "beta2=v2", "alpha1=Winkel A", "alpha2=Winkel B [rad]"]
    same(imported(path, *(part for role in roles for part in ("--column", role)))[0], orientation=False)
    path = log("\n".join([lines[0].replace("V2", "V1"), units, *lines[1:]]))
    assert "the log has no column V1" in refused(path, "--column", "beta1=V1")


def test_zero_based(log, imported, same, truth):
    """Tubes counted from 0."""
    names = ["t", "d0", "d1", "theta0", "theta1", "x", "y", "z"]
    table, _ = imported(log(text(names, [truth.t, truth.beta, truth.alpha, truth.position])))
    same(table, orientation=False)
    assert lab_logs.ROWS == len(table)
