"""The procedures that measure one quantity each: the shipped tables give the truth, bad tables clear errors."""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ctcr.calibrate.outcome import frame_rows
from ctcr.calibrate.procedures import radius_of_circle
from ctcr.errors import InputError
from ctcr.fit.result import Priors
from ctcr.frames import of_sensor
from ctcr.model import parameters
from ctcr.model.model import Model
from ctcr.robot import robot_file
from ctcr.robot.description import Correlation

ROOT = Path(__file__).parents[3]
DATA = ROOT / "examples" / "data" / "calibration"
ROBOT = DATA / "robot.yaml"


def truth(name: str) -> list[float]:
    """One number a tube, as the README of the data tells."""
    (row,) = re.findall(rf"\| {name}, [^|]*\|(.*)\|", (DATA / "README.md").read_text())
    return [float(number) for number in row.split("|")]


@pytest.fixture
def run(run):
    return lambda *arguments: run("calibrate", *arguments)


@pytest.fixture
def values(run):
    """The values of a procedure by name: (value, standard deviation, value of the robot file)."""

    def values(*arguments) -> dict[str, tuple[float, float, float]]:
        code, out, err = run(*arguments, "--json", "-")
        assert code == 0, err
        return {row["name"].strip(): (row["value"], row["sd"], row["old"]) for row in json.loads(out)["values"]}

    return values


def assert_within(found: tuple, true: float, most_sd: float) -> None:
    value, sd, _ = found
    assert abs(value - true) < 3 * sd and sd < most_sd, (found, true)


def test_rotation_offset(values):
    """The home rotations are within their standard deviations of the true ones."""
    found = values("rotation-offset", DATA / "circles.csv", "--robot", ROBOT)
    for i, true in enumerate(truth("home rotation")):
        assert_within(found[f"tube {i + 1}: rotation offset"], true, 1.0)
        assert abs(found[f"tube {i + 1}: rotation offset"][0] - true) < 0.6  # a few tenths of a degree


def test_directions(run):
    """Forward and backward differ by the friction of the simulated tubes."""
    code, out, _ = run("rotation-offset", DATA / "circles.csv", "--robot", ROBOT, "--json", "-")
    tubes = json.loads(out)["tubes"]
    differences = [abs(tube["direction_difference_deg"]) for tube in tubes.values()]
    np.testing.assert_allclose(differences, 0.6, atol=0.15)  # forward and backward lag by 0.3 deg each


def test_registration(values):
    """The frame is within half a millimetre and 0.3 degrees of the true one."""
    found = values("registration", DATA / "points.csv", "--robot", ROBOT, "--placement-sd-mm", 0.1)
    for axis, true in zip("xyz", (-60.082, 19.556, -179.905), strict=True):
        assert abs(found[f"origin of the base frame, {axis}"][0] - true) < 0.5
    for axis, true in zip("xyz", (0.0008, 1.1967, 0.2996), strict=True):
        assert abs(found[f"rotation vector, {axis}"][0] - true) < np.radians(0.3)
    assert 0 < found["expected error at tool, RMS"][0] < 2


def test_home(values):
    """Home translations and lengths are within their standard deviations of the true ones."""
    found = values("home", DATA / "home.csv", "--robot", ROBOT)
    for i, (beta, length) in enumerate(zip(truth("home translation"), truth("length"), strict=True)):
        assert_within(found[f"tube {i + 1}: home translation"], beta, 1.5)
        assert_within(found[f"tube {i + 1}: length"], length, 1.5)
        deployed = list(found.values())[3 * i + 2] if len(found) == 9 else None
        assert deployed is None or abs(deployed[0] - beta - length) < 1


def test_cantilever(values):
    """The true modulus, and a larger standard deviation with uncertain diameters."""
    found = values("cantilever", DATA / "cantilever.csv", "--robot", ROBOT, "--tube", 1)
    assert_within(found["Young's modulus"], truth("Young's modulus")[0], 1.0)
    assert found["Young's modulus"][2] == 58.0
    blunt = values(
        "cantilever", DATA / "cantilever.csv", "--inner-mm", 1.3, "--outer-mm", 1.52, "--diameter-sd-mm", 0.01
    )
    assert blunt["Young's modulus"][1] > 3 * found["Young's modulus"][1]  # diameters count with the fourth power


def test_curvature(values):
    """Curvature and curved length are the true ones, by a scale and by a reference length in the picture."""
    scale = ["--mm-per-px", 1 / 12, "--scale-sd-percent", 0.5]
    found = values("curvature", DATA / "picture.csv", "--robot", ROBOT, "--tube", 2, *scale)
    assert_within(found["curvature"], truth("curvature")[1], 0.2)
    assert_within(found["curved length"], truth("curved length")[1], 3.0)
    reference = ["--reference", 0, 0, 0, 1200, 100]
    other = values("curvature", DATA / "picture.csv", *reference)
    assert other["curvature"][0] == pytest.approx(found["curvature"][0], rel=1e-3)


STEPS = [
    ("registration", "points.csv", [], "tracker.position_mm[0]"),
    ("home", "home.csv", [], "tubes[0].length_mm"),
    ("rotation-offset", "circles.csv", [], "actuation.home_rotation_deg[0]"),
    ("cantilever", "cantilever.csv", ["--tube", 1], "tubes[0].youngs_modulus_GPa"),
    ("curvature", "picture.csv", ["--tube", 2, "--mm-per-px", 1 / 12], "tubes[1].curvature_per_m"),
]


def test_chain(run, tmp_path):
    """One after another they make a calibrated file with its ledger."""
    robot = ROBOT
    for number, (name, table, options, field) in enumerate(STEPS):
        target = tmp_path / f"{number}.yaml"
        code, out, err = run(name, DATA / table, "--robot", robot, *options, "-o", target)
        assert code == 0 and f"Robot file: {target}" in out, err
        entry = robot_file.load(target).history[-1]
        assert entry["command"] == f"ctcr calibrate {name}" and entry["sources"][0]["file"] == table
        changed = {change["field"]: change for change in entry["changes"]}
        assert changed[field]["sd"] > 0 and changed[field]["old"] != changed[field]["new"]
        robot = target
    final = robot_file.load(robot)
    assert len(final.history) == len(STEPS)
    assert final.actuation.recorded_home_rotation_deg == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(final.actuation.home_translation_mm, truth("home translation"), atol=2.5)


@pytest.mark.parametrize(
    "command, table, options, known",
    [
        ("cantilever", "cantilever.csv", ("--tube", 1, "--diameter-sd-mm", 0.005), {"tubes.1.youngs_modulus"}),
        (
            "curvature",
            "picture.csv",
            ("--tube", 2, "--mm-per-px", 0.083333),
            {"tubes.2.curvature", "tubes.2.curved_length"},
        ),
        ("rotation-offset", "circles.csv", (), {f"actuation.home_rotation.{i}" for i in (1, 2, 3)}),
        (
            "registration",
            "points.csv",
            (),
            {f"tracker.{kind}.{axis}" for kind in ("position", "rotation") for axis in "xyz"},
        ),
    ],
)
def test_becomes_prior(run, tmp_path, command, table, options, known):
    """What a procedure measures is the prior of the next fit, with its standard deviation; other priors stay."""
    code, out, err = run(command, DATA / table, "--robot", ROBOT, *options, "-o", tmp_path / "new.yaml", "--json", "-")
    assert code == 0, err
    before, after = robot_file.load(ROBOT), robot_file.load(tmp_path / "new.yaml")
    names = parameters.expand("standard", before)
    old, new = (parameters.priors(robot, names)[1] for robot in (before, after))
    assert {name for name, a, b in zip(names, old, new, strict=True) if not np.isclose(a, b, rtol=0.02)} == known
    units = {"GPa": 1e9, "1/m": 1.0, "mm": 1e-3, "deg": np.pi / 180, "rad": 1.0}
    measured = {
        row["sd"] * units[row["unit"]] for row in json.loads(out)["values"] if row["sd"] and row["unit"] in units
    }
    for name in known:
        assert np.min(np.abs(np.log(np.array([*measured]) / new[names.index(name)]))) < 0.01
    fields = [row["field"] for row in after.history[-1]["changes"]]
    assert any(field.startswith("uncertainty.") for field in fields)


def test_correlated_prior(run, tmp_path):
    """Home and length come from one ruler: as priors of the next fit they keep what the encoder knows of their sum."""
    code, out, err = run("home", DATA / "home.csv", "--robot", ROBOT, "-o", tmp_path / "new.yaml", "--json", "-")
    assert code == 0, err
    robot = robot_file.load(tmp_path / "new.yaml")
    deployed = [1e-3 * row["sd"] for row in json.loads(out)["values"] if row["name"].strip() == "deployed at home"]
    for tube, sd in enumerate(deployed, start=1):
        priors = Priors.of(robot, [f"tubes.{tube}.length", f"actuation.home_translation.{tube}"], np.zeros((0, 3)))
        covariance = np.linalg.inv(priors.precision)
        assert np.sqrt(covariance.sum()) == pytest.approx(sd, rel=0.05) and sd < 0.3 * priors.sd[0]
    pairs = [{pair.first, pair.second} for pair in robot.uncertainty.correlations]
    assert pairs == [{f"tubes.{i}.length", f"actuation.home_translation.{i}"} for i in (1, 2, 3)]
    again = tmp_path / "again.yaml"
    code, out, err = run("home", DATA / "home.csv", "--robot", tmp_path / "new.yaml", "-o", again)
    assert code == 0 and robot_file.load(again).uncertainty == robot.uncertainty, err


@pytest.mark.parametrize(
    "pairs, words",
    [
        ([("tubes.1.lenght", "tubes.2.length", 0.5)], "did you mean tubes.1.length?"),
        ([("tubes.1.length", "tubes.1.length", 0.5)], "tubes.1.length is named twice"),
        (
            [("tubes.1.length", "tubes.1.poisson_ratio", 0.5)],
            "no parameter with an uncertainty is named tubes.1.poisson",
        ),
        ([(f"tubes.{i}.length", f"tubes.{i % 3 + 1}.length", -0.9) for i in (1, 2, 3)], "no errors can have all these"),
    ],
)
def test_bad_correlations(pairs, words):
    """Correlations of unknown parameters, and such as no errors can have, are refused in words."""
    robot = robot_file.load(ROBOT)
    robot.uncertainty.correlations = [Correlation(first=a, second=b, r=r) for a, b, r in pairs]
    with pytest.raises(InputError) as error:
        parameters.correlations(robot, parameters.expand("standard", robot))
    assert words in str(error.value) and "uncertainty.correlations" in str(error.value)


def test_defaults(run, tmp_path):
    """A section that the file leaves to its defaults is written once a procedure measures a part of it."""
    robot = tmp_path / "robot.yaml"
    text = ROBOT.read_text()
    robot.write_text(text[: text.index("actuation:")] + text[text.index("tracker:") :])
    new = tmp_path / "new.yaml"
    code, out, err = run("home", DATA / "home.csv", "--robot", robot, "--pitch-mm", 2, "-o", new)
    assert code == 0 and "-463.0 ± 1.0 by the robot file" in out, err
    found = robot_file.load(new).actuation
    assert found.recorded_home_translation_mm == [-463, -330.5, -199] and -298 < found.home_translation_mm[0] < -296


def test_in_place(run, tmp_path):
    """The input is changed with --in-place alone."""
    robot = tmp_path / "robot.yaml"
    robot.write_bytes(ROBOT.read_bytes())
    code, _, err = run("home", DATA / "home.csv", "--robot", robot, "-o", robot)
    assert code == 2 and "--in-place" in err and robot.read_bytes() == ROBOT.read_bytes()
    assert run("home", DATA / "home.csv", "--robot", robot, "--in-place")[0] == 0
    assert len(robot_file.load(robot).history) == 1


def rows(table: str) -> list[str]:
    return (DATA / table).read_text().splitlines()


def doubled_first_point() -> list[str]:
    lines = rows("points.csv")
    return [*lines, lines[1].replace("A,-60", "A,-61", 1)]


@pytest.mark.parametrize(
    "name, lines, options, message",
    [
        ("rotation-offset", rows("circles.csv")[:4], ["--robot", ROBOT], "circles.csv, tube 1: "),
        ("rotation-offset", rows("circles.csv"), [], "give --ratio, turns of a tube in one turn of its motor"),
        (
            "rotation-offset",
            [rows("circles.csv")[0], "4" + rows("circles.csv")[1][1:]],
            ["--robot", ROBOT],
            "row 2, tube: tube 4 is not there: the robot has 3",
        ),
        ("rotation-offset", rows("circles.csv"), ["--ratio", 1, "-o", "x.yaml"], "give --robot"),
        ("rotation-offset", rows("circles.csv"), ["--robot", ROBOT, "--ratio", 1], "turns"),
        ("registration", rows("points.csv")[:7], [], ""),
        ("registration", doubled_first_point(), [], "row 27, cad_x: the CAD coordinates of A differ"),
        ("home", rows("home.csv")[:5], ["--robot", ROBOT], "tube 3 has no row: needs every tube, 1 to 3"),
        ("home", rows("home.csv"), [], "give --pitch-mm"),
        ("cantilever", rows("cantilever.csv"), [], "needs the tube's diameters"),
        ("cantilever", rows("cantilever.csv"), ["--robot", ROBOT], "give --tube, 1 to 3 from the innermost"),
        ("cantilever", rows("cantilever.csv"), ["--robot", ROBOT, "--tube", 4], "tube 4 is not there: the robot has 3"),
        ("curvature", rows("picture.csv"), [], "points in px need their scale: give --mm-per-px, or --reference"),
        ("curvature", rows("picture.csv")[:4], ["--mm-per-px", 0.1], ""),
    ],
)
def test_faults(run, tmp_path, name, lines, options, message):
    """One clear error, with exit code 2 where an option is missing; nothing is written."""
    table = tmp_path / "circles.csv"
    table.write_text("\n".join(lines) + "\n")
    if "--robot" in options and "-o" not in options:
        options = [*options, "-o", tmp_path / "new.yaml"]
    code, out, err = run(name, table, *options, "--json", tmp_path / "a.json")
    assert out == "" and message in err and "Traceback" not in err
    assert code == (2 if "give --" in err else 1)
    assert err.startswith("Error: ") and "this should not happen" not in err
    assert [path.name for path in tmp_path.iterdir()] == ["circles.csv"]


def exchanged(lines: list[str], first: str, second: str) -> list[str]:
    """The rows of two tubes under the number of the other one."""
    other = {first: second, second: first}
    return [lines[0], *(other.get(line[0], line[0]) + line[1:] for line in lines[1:])]


def flush_times(factor: float) -> list[str]:
    """home.csv with its flush angles times a factor."""
    header, *lines = rows("home.csv")
    parts = [line.rsplit(",", 1) for line in lines]
    return [header, *(f"{rest},{factor * float(angle)}" for rest, angle in parts)]


WRONG = [
    ("curvature", rows("picture.csv"), ["--tube", 1, "--mm-per-px", 1 / 12], "curvature", 4.5),
    ("rotation-offset", exchanged(rows("circles.csv"), "1", "2"), [], "tube 1: radius of the circle", 3.0),
    ("rotation-offset", exchanged(rows("circles.csv"), "1", "2"), ["--deployed-mm", 20], "tube 2: radius", 3.0),
    ("cantilever", rows("cantilever.csv"), ["--tube", 1, "--outer-mm", 3], "Young's modulus", 4.0),
    ("home", flush_times(1.02), [], "tube 1: length", 2.0),
]


@pytest.mark.parametrize(("command", "lines", "options", "name", "least"), WRONG)
def test_contradiction(run, tmp_path, command, lines, options, name, least):
    """What can hardly be true together with the robot file is said before all else, to people and to programs."""
    table = tmp_path / "table.csv"
    table.write_text("\n".join(lines) + "\n")
    code, out, err = run(command, table, "--robot", ROBOT, *options, "--json", "-")
    assert code == 0, err
    found = json.loads(out)
    first = next(text for text in found["notices"] if text.startswith(name))
    assert found["notices"].index(first) < 4 and "standard deviations" in first
    far = [row for row in found["values"] if row["shift"] and abs(row["shift"]) > 2]
    assert max(abs(row["shift"]) for row in far) > least
    for row in far:
        assert abs(row["value"] - row["old"]) / np.hypot(row["sd"], row["old_sd"]) == pytest.approx(abs(row["shift"]))
    page = tmp_path / "page.html"
    code, out, err = run(command, table, "--robot", ROBOT, *options, "-o", tmp_path / "new.yaml", "--report", page)
    assert code == 0 and out.startswith("Doubt: ") and "<h2>Doubts</h2>" in page.read_text(), err
    assert first in robot_file.load(tmp_path / "new.yaml").history[-1]["note"]


@pytest.mark.parametrize(("name", "table", "options", "_"), STEPS)
def test_agreement(run, name, table, options, _):
    """Right measurements of a robot within its uncertainty bring no doubt."""
    code, out, err = run(name, DATA / table, "--robot", ROBOT, *options)
    assert code == 0 and "Doubt" not in out, err


@pytest.mark.parametrize(
    ("command", "lines", "options", "words"),
    [
        ("home", flush_times(-1), [], ["tube 1", "behind the front plate", "flush_angle"]),
        ("home", flush_times(360), [], ["tube 1", "m: has flush_angle another unit"]),
        ("home", exchanged(rows("home.csv"), "1", "2"), ["--robot", ROBOT], ["longer than tube 1"]),
    ],
)
def test_impossible(run, tmp_path, command, lines, options, words):
    """What no robot can have is an error, with and without a robot file."""
    table = tmp_path / "table.csv"
    table.write_text("\n".join(lines) + "\n")
    for chosen in (options or ["--pitch-mm", 2], ["--robot", ROBOT, "-o", tmp_path / "new.yaml"]):
        code, out, err = run(command, table, *chosen, "--json", tmp_path / "a.json")
        assert code == 1 and out == "" and all(word in err for word in words), err
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]


def test_unit(run, tmp_path):
    """Without a robot file, a modulus that no tube has is doubted still."""
    table = tmp_path / "table.csv"
    table.write_text("load_g,deflection_mm,free_length_mm\n.01,9.3,120\n.02,18.5,120\n.03,27.8,120\n")
    code, out, err = run("cantilever", table, "--inner-mm", 1.3, "--outer-mm", 1.52)
    assert code == 0 and out.startswith("Doubt: Young's modulus: 0.0") and "GPa is unusual" in out, err


@pytest.mark.parametrize(
    ("command", "text", "options", "fault"),
    [
        ("cantilever", "5,1,80\n\n10,-2,80\n20,4,80", [], "row 4: the tube must deflect along the load"),
        ("cantilever", "0,1,80\n10,2,80\n20,4,80", ["--fit-zero"], "row 2: no load bends nothing: leave this row out"),
        ("home", "1,-296.3,82.7\n1,,", ["--pitch-mm", 2], "row 2, distance_mm: '-296.3' does not fit: needs"),
    ],
)
def test_fault_rows(run, tmp_path, command, text, options, fault):
    """Faults that the computation finds name the row of the file too, and the unit of the column."""
    header = {"cantilever": "load_g,deflection_mm,free_length_mm", "home": "tube,distance_mm,flush_angle_rev"}[command]
    table = tmp_path / "table.csv"
    table.write_text(f"{header}\n{text}\n")
    sizes = ["--inner-mm", 1.3, "--outer-mm", 1.52] if command == "cantilever" else []
    code, _, err = run(command, table, *sizes, *options)
    assert code == 1 and f"table.csv, {fault}" in err


@pytest.mark.parametrize("seed", range(4))
def test_radius(seed):
    """The radius that a robot file predicts is the model's; its deviation is that over the uncertainty of the tube."""
    random = np.random.default_rng(seed)
    robot = robot_file.load(ROBOT).model_copy(deep=True)
    place = random.uniform(-4, 4, 3)
    tube = robot.tubes[1]
    tube.curvature_per_m = float(random.uniform(-12, 12))
    robot.tracker.sensor_position_mm = place.tolist()
    robot.gravity = None
    actuation = robot.actuation.model_copy(update={"home_translation_mm": [0.0], "home_rotation_deg": [0.0]})
    alone = robot.model_copy(update={"tubes": [tube], "actuation": actuation})
    for deployed in (0.03, tube.curved_length):
        tip = Model(alone).predict(np.array([[deployed - tube.length]]), np.zeros((1, 1)), np.zeros((1, 3)))
        seen, _ = of_sensor(robot.tracker, tip.position, tip.quaternion)
        assert radius_of_circle(robot, 2, 1e3 * deployed)[0] == pytest.approx(np.hypot(*seen[0, :2]), rel=1e-5)
    # Gauss-Hermite quadrature over two standard normal deviations: exact up to the ninth power of each.
    points, weights = np.polynomial.hermite_e.hermegauss(5)
    radii = np.zeros((5, 5))
    for i, j in np.ndindex(5, 5):
        other = robot.model_copy(deep=True)
        other.tubes[1].curvature_per_m *= 1 + 0.05 * points[i]
        other.tubes[1].curved_length_mm += 2.5 * points[j]
        radii[i, j] = radius_of_circle(other, 2)[0]
    weight = np.outer(weights, weights) / np.sum(weights) ** 2
    spread = np.sqrt(np.sum(weight * (radii - np.sum(weight * radii)) ** 2))
    assert radius_of_circle(robot, 2)[1] == pytest.approx(spread, rel=0.05)


def test_turn_of_frame():
    """Frames are compared as rotations: another rotation vector of the same turn is no contradiction, a turn is."""
    robot = robot_file.load(ROBOT)
    vector = np.array(robot.tracker.rotation_vector_rad)
    other = vector * (1 - 2 * np.pi / np.linalg.norm(vector))
    position, sd = np.array(robot.tracker.position_mm), np.full(3, 1e-3)
    same = frame_rows(robot, position, 1e3 * sd, other, sd)
    assert max(abs(row.shift) for row in same) < 1e-6
    turned = frame_rows(robot, position, 1e3 * sd, vector + [0.0, 0.0, np.radians(3)], sd)
    assert any(row.contradicts for row in turned) and not any(row.contradicts for row in turned[:3])
    assert not any(row.contradicts for row in frame_rows(robot, position + 100, sd, vector, sd, prior=False))


@pytest.mark.parametrize(
    ("command", "table", "options", "title"),
    [
        ("rotation-offset", "circles.csv", [], "Rotation offsets: new robot"),
        ("registration", "points.csv", [], "Tracker frame: new robot"),
        ("home", "home.csv", [], "Home: new robot"),
        ("cantilever", "cantilever.csv", ["--tube", 1], "Cantilever: new robot"),
        ("curvature", "picture.csv", ["--tube", 2, "--mm-per-px", 0.083333], "Shape of the tube: new robot"),
    ],
)
def test_report(run, tmp_path, command, table, options, title):
    """A page with a picture that needs no network."""
    page = tmp_path / "page.html"
    code, out, err = run(command, DATA / table, "--robot", ROBOT, *options, "--report", page)
    assert code == 0 and f"Report: {page}" in out, err
    text = page.read_text()
    assert f"<h1>{title}</h1>" in text and text.count("<svg") == 1 and ">sd</th>" in text
    assert f"<code>ctcr calibrate {command} " in text and f'{DATA / table}</td><td class="text">' in text
    assert not re.search(r"""(?:src|href)=["']https?:""", text)


@pytest.mark.parametrize("sign", [1, -1])
def test_circle(sign):
    """The picture shows the lag of each direction, for either sense of rotation."""
    from ctcr.calibrate.procedure_figures import Circle

    angle = np.tile(np.linspace(-3, 3, 40), 2)
    forward = np.arange(80) < 40
    seen = sign * (angle + 0.7 + np.where(forward, 0.02, -0.02))
    position = np.column_stack([3 + 0.5 * np.cos(seen), 0.5 * np.sin(seen), np.full(80, 2.0)])
    fit = SimpleNamespace(centre=np.array([3.0, 0, 2]), normal=np.array([0.0, 0, 1]), radius=0.5, outliers=[])
    circle = Circle("tube 1", position, angle, forward, fit)
    assert np.degrees(0.02) * np.where(forward, 1, -1) == pytest.approx(circle.behind(), abs=1e-9)
