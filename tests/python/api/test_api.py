"""The functions of `import ctcr`: what the commands find, in and out of DataFrames, shown, drawn and written."""

import ast
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, get_type_hints

import ctcr
import matplotlib.figure
import numpy as np
import pytest
from ctcr.robot import robot_file
from ctcr.show.output import plain

ROOT = Path(__file__).parents[3]
DATA = ROOT / "examples" / "data" / "demo"
NAME = 'x<script>alert(1)</script> "\n\x1b[2J'
FEW = "tubes.*.curvature,tracker.frame"


@pytest.fixture(scope="module")
def robot():
    return ctcr.load(DATA / "robot.yaml")


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """80 rows of the demonstration, in 6 runs."""
    path = tmp_path_factory.mktemp("table") / "few.csv"
    lines = (DATA / "measurements.csv").read_text().splitlines()
    path.write_text("\n".join([lines[0], *lines[1:241:3]]) + "\n")
    return path


@pytest.fixture(scope="module")
def table(file):
    return ctcr.read(file)


@pytest.fixture(scope="module")
def report(robot, table):
    return ctcr.compare(robot, table)


@pytest.fixture(scope="module")
def fit(robot, table):
    return ctcr.calibrate(robot, table, free=FEW, hold_out=0, halves=False)


@pytest.fixture(scope="module")
def found(robot, table):
    return ctcr.diagnose(robot, table)


@pytest.fixture(scope="module")
def better(robot, found, table):
    return ctcr.add(robot, found, table, free=FEW)


def numbers(result) -> dict:
    """As JSON, without how long it took."""
    data = json.loads(json.dumps(plain(result.as_dict())))
    data.pop("seconds", None)
    return data


@pytest.fixture
def command(run, tmp_path):
    """command("compare", ...): the JSON that the command writes, without how long it took."""

    def command(*arguments) -> dict:
        path = tmp_path / "found.json"
        code, _, err = run(*arguments, "--json", path)
        assert code == 0, err
        data = json.loads(path.read_text())
        data.pop("seconds", None)
        return data

    return command


def test_same_as_commands(command, file, report, fit, found, better, tmp_path):
    """Comparison, calibration, diagnosis and added effects have the numbers of the commands."""
    robot = DATA / "robot.yaml"
    assert command("compare", robot, file) == numbers(report)
    new = tmp_path / "fitted.yaml"
    assert command("calibrate", "fit", robot, file, "--free", FEW, "--hold-out", 0, "-o", new) == numbers(fit)
    assert robot_file.load(new).model_dump() == fit.robot.model_dump()
    assert command("diagnose", robot, file) == numbers(found)
    kept, new = tmp_path / "diagnosis.json", tmp_path / "better.yaml"
    kept.write_text(json.dumps(numbers(found)))
    given = ["--diagnosis", kept, "--fit", file, "--free", FEW, "-o", new]
    assert command("add", robot, *given) == numbers(better)
    assert robot_file.load(new).model_dump() == better.robot.model_dump()
    assert list(better.robot.effects) == better.ids == [one.id for one in found.accepted]


def test_same_report(run, file, report, tmp_path):
    """The page is that of the command, but for how it was made."""
    pages = [tmp_path / name for name in ("command.html", "function.html")]
    assert run("compare", DATA / "robot.yaml", file, "--report", pages[0])[0] == 0
    report.report(pages[1])
    (shown, made), (again, in_python) = (page.read_text().split("<footer>") for page in pages)
    assert shown == again and "<code>ctcr compare" in made and "in Python" in in_python
    assert made[made.index("<table>") :] == in_python[in_python.index("<table>") :]  # the same files


def test_frame_in_and_out(robot, table, report):
    """A table goes through a DataFrame unchanged."""
    pytest.importorskip("pandas")
    again = ctcr.read(table.to_frame())
    for name in ("t", "run", "beta", "alpha", "force", "position", "row"):
        np.testing.assert_array_equal(getattr(again, name), getattr(table, name))
    np.testing.assert_allclose(again.quaternion, table.quaternion, rtol=1e-15)
    assert ctcr.compare(robot, again).position_mm == report.position_mm
    assert len(report.to_frame()) == report.position_mm.count


def test_kinds_of_columns(table):
    """Integers, nullable numbers and missing values are read; what is no number is named with its row and column."""
    pandas = pytest.importorskip("pandas")
    frame = table.to_frame()
    loose = frame.astype(object)
    loose.loc[2, ["x_m", "y_m", "z_m"]] = [None, float("nan"), pandas.NA]
    assert np.isnan(ctcr.read(loose).position[2]).all()
    assert len(ctcr.read(frame.convert_dtypes())) == len(frame)
    faults = {"x_m": "abc", "beta1_m": True, "run": 1.5, "alpha1_rad": float("inf")}
    for name, value in faults.items():
        wrong = frame.astype(object)
        wrong.loc[3, name] = value
        if value is True:
            wrong[name] = pandas.Series([True] * len(frame))
        with pytest.raises(ctcr.InputError, match=rf"DataFrame, row {2 if value is True else 5}, {name}: "):
            ctcr.read(wrong)
    text = frame.astype(object).assign(run="first")
    with pytest.raises(ctcr.InputError) as caught:  # one fault a row, not that it were empty too
        ctcr.read(text)
    assert len(caught.value.problems) + caught.value.omitted == len(frame) and "empty" not in str(caught.value)
    dates = frame.assign(t_s=pandas.to_datetime(frame.t_s, unit="s"))
    with pytest.raises(ctcr.InputError, match="row 2, t_s: 1970-01-01[^ ]* is not a number"):
        ctcr.read(dates)
    for wrong in (frame.iloc[:0], frame[["x_m"]], frame.rename(columns={"x_m": "x_mm"}), 3, {"a": 1}):
        with pytest.raises(ctcr.InputError):
            ctcr.read(wrong)


def test_column_in_the_index(table):
    """A column of the format that is the index is not lost without a word."""
    pytest.importorskip("pandas")
    frame = table.to_frame()
    for names in (["t_s"], ["run", "t_s"]):
        with pytest.raises(ctcr.InputError, match=f"row 1, {names[0]}: is the index.* reset_index") as caught:
            ctcr.read(frame.set_index(names))
        assert [problem.field for problem in caught.value.problems] == names
    for allowed in (frame.set_index(["t_s"], drop=False), frame.rename_axis("row")):
        assert len(ctcr.read(allowed)) == len(frame)


def test_without_pandas(table, monkeypatch):
    """Where pandas is missing, the error says that it is needed."""
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ctcr.InputError, match="needs pandas"):
        table.to_frame()


def test_other_robot(robot, table):
    """A table of another number of tubes, in every function that takes one."""
    two = robot.model_copy(update={"tubes": robot.tubes[:2]})
    for function in (ctcr.compare, ctcr.calibrate, ctcr.diagnose, ctcr.predict):
        with pytest.raises(ctcr.InputError, match="3 tubes: the robot has 2"):
            function(two, table)
        for wrong in ((robot, "table.csv"), ("robot.yaml", table), (table, robot)):
            with pytest.raises(ctcr.InputError, match=r"(robot|table): needs .* \(of ctcr\.(load|read)\), not "):
                function(*wrong)


WRONG = [
    (lambda robot, table: ctcr.add(robot, "friction", None), "table: needs Measurements (of ctcr.read), not None"),
    (lambda robot, table: ctcr.add(robot, 3, table), "effects: needs Diagnosis or str or a list of str, not 3"),
    (lambda robot, table: ctcr.add(robot, "friction", table, fixed={"limit": 1}), "friction has no parameter limit"),
    (lambda robot, table: ctcr.add(robot, "friction", table, fixed={"a=1,2": 1}), "friction has no parameter a=1,2"),
    (lambda robot, table: ctcr.add(robot, "friction", table, start=[1]), "start: needs a dict of float by str or None"),
    (lambda robot, table: ctcr.calibrate(robot, table, free=3), "free: needs str or a list of str, not 3"),
    (lambda robot, table: ctcr.calibrate(robot, table, free=[3]), "free: needs str or a list of str, not [3]"),
    (lambda robot, table: ctcr.calibrate(robot, table, hold_out=-1), "hold_out: needs int >= 0 or None, not -1"),
    (lambda robot, table: ctcr.calibrate(robot, table, halves=1), "halves: needs bool, not 1"),
    (lambda robot, table: ctcr.calibrate(robot, table, noise="loud"), "noise: needs 'auto' or 'jitter' or 'field'"),
    (lambda robot, table: ctcr.diagnose(robot, table, threads=True), "threads: needs int >= 0, not True"),
    (lambda robot, table: ctcr.diagnose(robot, table, progress=3), "progress: needs a function, not 3"),
    (lambda robot, table: ctcr.compare(robot, table, steps="a"), "steps: needs int >= 0, not 'a'"),
    (lambda robot, table: ctcr.predict(robot, table, frame="x"), "frame: needs 'base' or 'tracker', not 'x'"),
    (lambda robot, table: ctcr.read(table.to_frame(), 2.5), "n_tubes: needs int >= 0 or None, not 2.5"),
    (lambda robot, table: ctcr.Model("robot.yaml"), "robot: needs a Robot (of ctcr.load), not 'robot.yaml'"),
    (lambda robot, table: table.rows(3), "chosen: needs an array or slice, not 3"),
    (lambda robot, table: ctcr.load({}), "path: needs str or Path, not {}"),
    (lambda robot, table: ctcr.robot_file.save(robot, None), "path: needs str or Path, not None"),
]


@pytest.mark.parametrize("call, message", WRONG)
def test_arguments(robot, table, call, message):
    """An argument of another kind than annotated is an error that says what is needed."""
    with pytest.raises(ctcr.InputError, match=re.escape(message)):
        call(robot, table)


def test_all_arguments(robot, table):
    """All wrong arguments of a call are named at once; numbers of numpy, and any kind of list, are right ones."""
    with pytest.raises(ctcr.InputError) as caught:
        ctcr.predict(table, robot, steps=-1)
    assert [problem.field for problem in caught.value.problems] == ["robot", "table", "steps"]
    names = np.array(["tracker.frame"])
    fit = ctcr.calibrate(robot, table, free=names, hold_out=np.int64(0), halves=np.bool_(False), anyway=True)
    assert len(fit.fit.names) == 6
    with pytest.raises(TypeError, match=r"compare\(\) missing 1 required positional argument: 'table'"):
        ctcr.compare(robot)


def test_wrong_convention(robot, table):
    """Angles in degrees are read, named by a comparison, and refused by fits and predictions."""
    frame = pytest.importorskip("pandas") and table.to_frame()
    angles = [name for name in frame if name.startswith("alpha")]
    # So large that they cannot be angles in radians.
    degrees = ctcr.read(frame.assign(**{name: 360 * 20 + np.degrees(frame[name]) for name in angles}))
    assert degrees.refusal and "Not possible" in degrees._repr_html_()
    assert ctcr.compare(robot, degrees).wrong
    with pytest.raises(ctcr.WrongConventions) as raised:
        ctcr.calibrate(robot, degrees)
    assert raised.value.review.wrong and "anyway" in str(raised.value)
    with pytest.raises(ctcr.InputError, match="deg"):
        ctcr.predict(robot, degrees)


@pytest.fixture(scope="module")
def shuffled(table):
    """Half of the rows in another order than their times."""
    order = np.random.default_rng(1).permutation(len(table))[::2]
    return ctcr.read(pytest.importorskip("pandas") and table.to_frame().iloc[order])


def test_doubts_of_a_table(robot, shuffled, tmp_path):
    """What a table was warned of stands in every result made from it, once: printed, in a notebook and on its page."""
    (late, again), page = shuffled.doubts, tmp_path / "page.html"
    assert "does not come after" in late and "a run continues" in again
    assert late in str(shuffled)
    results = [
        ctcr.compare(robot, shuffled),
        ctcr.calibrate(robot, shuffled, free=FEW, hold_out=0, halves=False),
        ctcr.diagnose(robot, shuffled),
        ctcr.add(robot, "tip_load", shuffled, free=FEW),
    ]
    for result in results:
        for text in (str(result), result._repr_html_()):
            assert text.count("does not come after") == text.count("a run continues") == 1
        result.report(page)
        assert page.read_text().count("does not come after") == 1
    with pytest.raises(ctcr.WrongConventions, match="does not come after"):
        ctcr.calibrate(robot, replace(shuffled, alpha=shuffled.alpha * [1, -1, 1]))


def test_doubts_in_commands(run, robot, shuffled, tmp_path):
    """The commands show them as the functions do: once on the terminal, once on the page."""
    path, page = tmp_path / "shuffled.csv", tmp_path / "page.html"
    shuffled.to_frame().to_csv(path, index=False)
    for words in (["compare"], ["calibrate", "fit", "--free", FEW, "--hold-out", 0]):
        code, out, err = run(*words, DATA / "robot.yaml", path, "--report", page)
        assert code == 0 and out.count("does not come after") == 1, err
        assert page.read_text().count("does not come after") == 1


def test_printed_comparison(robot, table):
    """A comparison says on its face that its error is that of a corrected table, or of some rows alone."""
    flipped = ctcr.compare(robot, replace(table, alpha=table.alpha * [1, -1, 1]))
    beta = table.beta.copy()
    beta[:20, 0] = -0.464  # behind the plate
    some = ctcr.compare(robot, replace(table, beta=beta))
    for report, said in ((flipped, "alpha2 counts the other way"), (some, "no solution for 20 of 80 readings")):
        assert said in str(report) and said in report._repr_html_()
        assert all(line.isprintable() for line in str(report).splitlines())


def test_few_rows(robot, table):
    """A table without rows, or with too few for a diagnosis, is refused with the reason."""
    for function in (ctcr.compare, ctcr.calibrate, ctcr.diagnose, ctcr.predict):
        with pytest.raises(ctcr.InputError, match=r"few\.csv: holds no rows"):
            function(robot, table.rows(slice(0, 0)))
    three = table.rows(slice(0, 3))
    for fit in (ctcr.diagnose, lambda *given: ctcr.add(given[0], "friction", given[1])):
        with pytest.raises(ctcr.InputError, match="3 measured poses: .* takes 4 or more"):
            fit(robot, three)
    assert "3 readings" in str(ctcr.compare(robot, three))


def test_why(robot):
    """A pose that is NaN has its reason in its row."""
    beta = [[-0.3, -0.22, -0.13], [-0.3, -0.1, -0.13]]
    tips = ctcr.Model(robot).predict(beta, [[0, 1, 2]] * 2)
    assert tips.why == ["ok", "joints out of order"] and np.isnan(tips.position[1]).all()
    assert "1 solved" in repr(tips) and "joints out of order" in tips._repr_html_()
    if "pandas" in sys.modules:
        assert tips.to_frame()["status"].tolist() == tips.why


def test_predict(robot, table, hidden):
    """Rows of a table are those of a model; with friction they depend on the way there."""
    tips = ctcr.predict(robot, table)
    beta, alpha = robot.joints_of_table(table.beta, table.alpha)
    solved = ctcr.Model(robot, steps=4).predict(beta, alpha, table.force)
    np.testing.assert_array_equal(tips.position, solved.position)
    rubbed, back = hidden(robot, friction__coefficient="0.01"), table.rows(slice(None, None, -1))
    there, again = (ctcr.predict(rubbed, way).position for way in (table, back))
    assert np.linalg.norm(there - again[::-1], axis=1).max() > 1e-4
    away = ctcr.predict(robot, table, frame="tracker").position - robot.tracker.position
    np.testing.assert_allclose(away, tips.position @ robot.tracker.rotation.T, atol=1e-12)


def test_shown(robot, table, report, fit, found, better):
    """One line in a terminal, a table with units and no colours of its own in a notebook, a figure."""
    for result in (robot, table, report, fit, found, better):
        assert len(repr(result)) < 120 and "\n" not in repr(result) and repr(result) == str(result)
        text = result._repr_html_()
        assert "<table" in text and "color:#" not in text and "background" not in text
    assert "mm" in report._repr_html_() and "rad" in better._repr_html_()
    shape = ctcr.Model(robot).shape(table.beta[0], table.alpha[0])
    assert re.fullmatch(r"<Shape: 3 tubes, [\d.]+ mm long at \d+ arc lengths, stability [\d.]+>", repr(shape))
    for result in (report, fit, found, better):
        assert isinstance(result.plot(), matplotlib.figure.Figure) and result.plot()._repr_svg_().startswith("<svg")


def test_report_of_added_effects(run, better, file, tmp_path):
    """The page of added effects says what they do to the error, and what was fitted; the command writes it too."""
    page = tmp_path / "added.html"
    better.report(page)
    for text in ("<h2>The error falls</h2>", "Friction between the tubes", "effects.friction.coefficient.1", "<svg"):
        assert text in page.read_text()
    given = [DATA / "robot.yaml", "tip_load", "-o", tmp_path / "new.yaml", "--report", tmp_path / "command.html"]
    assert run("add", *given)[0] == 2  # nothing is fitted
    assert run("add", *given, "--fit", file, "--free", FEW)[0] == 0
    assert "Input files" in (tmp_path / "command.html").read_text()


def test_names_of_users(robot, table):
    """Names reach a notebook and a terminal as they are written."""
    named = robot.model_copy(update={"name": NAME})
    for shown in (named, ctcr.compare(named, table)):
        assert "<script>" not in shown._repr_html_() and "&lt;script&gt;" in shown._repr_html_()
        assert repr(shown).isprintable()


def test_saved(robot, fit, tmp_path):
    """What is written is what `.robot` holds; what was fitted or edited before is not lost; no input is overwritten."""
    path = tmp_path / "fitted.yaml"
    assert fit.save(path).model_dump() == fit.robot.model_dump() == ctcr.load(path).model_dump()
    with pytest.raises(ctcr.InputError, match="is the input"):
        fit.save(robot.file)
    edited = robot.model_copy(deep=True)
    edited.tubes[2].length_mm = 199.5
    table = ctcr.read(DATA / "measurements.csv").rows(slice(0, 40))
    again = ctcr.calibrate(edited, table, free="tubes.1.curvature", hold_out=0, halves=False)
    twice = ctcr.calibrate(again.robot, table, free="tubes.2.curvature", hold_out=0, halves=False)
    written = twice.save(path)
    assert written.tubes[2].length_mm == 199.5 and len(written.history) == 2
    assert written.tubes[0].curvature_per_m == again.robot.tubes[0].curvature_per_m != robot.tubes[0].curvature_per_m


def test_import_is_cheap():
    """Neither numpy nor pandas nor the compiled core; and functions outlive the import of rooms of the same names."""
    text = """
import sys, ctcr
assert not {"numpy", "pandas", "ctcr._core", "click"} & set(sys.modules), sorted(sys.modules)
import ctcr.compare.analysis, ctcr.diagnose.pipeline, ctcr.calibrate.joint_fit
from ctcr.compare import Comparison
assert all(callable(getattr(ctcr, name)) for name in ("compare", "calibrate", "diagnose", "add"))
assert "pandas" not in sys.modules and Comparison is ctcr.Comparison
"""
    subprocess.run([sys.executable, "-c", text], check=True)


def test_names():
    """What editors read, what is exported and what exists are the same names."""
    [types] = [
        node
        for node in ast.parse(Path(ctcr.__file__).read_text()).body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    ]
    imported = {alias.asname for node in types.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert imported == set(ctcr.__all__) and set(ctcr.__all__) <= set(dir(ctcr))
    assert (Path(ctcr.__file__).parent / "py.typed").is_file()
    for name in ctcr.__all__:
        assert getattr(ctcr, name) is not None
    with pytest.raises(AttributeError):
        ctcr.nothing  # noqa: B018


def test_types_of_answers():
    """What `as_dict` returns has known types: a program under strict checks may call it."""
    for result in (ctcr.Comparison, ctcr.Calibration, ctcr.Diagnosis, ctcr.Added):
        assert get_type_hints(result.as_dict)["return"] == dict[str, Any]


def test_types(tmp_path):
    """A type checker knows all names of a script, and finds the wrong ones."""
    pytest.importorskip("mypy")
    right, wrong = ROOT / "examples" / "06_python.py", tmp_path / "wrong.py"
    wrong.write_text("import ctcr\nctcr.load(3)\nctcr.compare(1, 2)\nctcr.read('a').nothing\nctcr.nothing\n")
    check = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", f"--cache-dir={tmp_path / 'cache'}"]
    environment = {"MYPYPATH": str(Path(ctcr.__file__).parents[1]), "PYTHONPATH": ":".join(sys.path), "PATH": ""}
    options = {"capture_output": True, "text": True, "env": environment, "cwd": tmp_path}
    done = subprocess.run([*check, right], **options)
    assert done.returncode == 0, done.stdout + done.stderr
    said = subprocess.run([*check, wrong], **options).stdout
    assert {line.split(":")[1] for line in said.splitlines() if ": error:" in line} == {"2", "3", "4", "5"}


@pytest.mark.parametrize("notebook", sorted((ROOT / "examples" / "notebooks").glob("*.ipynb")), ids=lambda p: p.stem)
def test_notebook(notebook, monkeypatch):
    """All cells run in their order, and what each shows can be shown; no outputs are kept in the file."""
    pytest.importorskip("pandas")
    monkeypatch.chdir(notebook.parent)
    names: dict = {}
    for number, cell in enumerate(json.loads(notebook.read_text())["cells"]):
        if cell["cell_type"] != "code":
            continue
        assert not cell["outputs"] and cell["execution_count"] is None
        body = ast.parse("".join(cell["source"])).body
        last = body.pop() if isinstance(body[-1], ast.Expr) else None
        exec(compile(ast.Module(body, []), f"{notebook.name}, cell {number}", "exec"), names)
        if last:
            value = eval(compile(ast.Expression(last.value), f"{notebook.name}, cell {number}", "eval"), names)
            forms = [getattr(value, name)() for name in ("_repr_html_", "_repr_svg_") if hasattr(value, name)]
            assert any(forms) or isinstance(value, Path)
