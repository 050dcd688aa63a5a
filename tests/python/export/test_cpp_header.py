"""A robot exported for a controller: the numbers of its header, where they come from, and what it refuses.

One program is compiled, as that takes long: the example project with the headers of further robots.
"""

import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from ctcr.bench.devices import bench_file
from ctcr.cli import cli
from ctcr.effects import catalogue
from ctcr.errors import InputError
from ctcr.export import cpp_header
from ctcr.export.cpp_header import is_free
from ctcr.inputs import sha256
from ctcr.model import fields, parameters, recording
from ctcr.model.model import Model
from ctcr.robot import ledger, robot_file
from ctcr.robot.ledger import Change, Entry

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "examples" / "controller"
TABLE2 = ROOT / "examples" / "robots" / "table2.yaml"
ROBOTS = sorted([*(ROOT / "examples" / "robots").glob("*.yaml"), *(ROOT / "examples" / "data").glob("*/robot.yaml")])

# Prints tips of solved shapes, a line each: position and quaternion; and all named numbers of a system.
PROGRAM = """
#include <ctcr/system/parameters.hpp>

template <int N, class Fx>
void print_tips(const char* name, const ctcr::System<N, Fx>& system, std::initializer_list<ctcr::Joints<N>> joints) {
  for (const ctcr::Joints<N>& q : joints) {
    ctcr::Workspace<N> workspace;
    ctcr::Solution<N> tip;
    const ctcr::TipLoad load{.force = {0.02, -0.05, 0.01}};
    const auto status = ctcr::solve<ctcr::Derivatives::jacobian>(system.model, q, load, workspace, tip);
    const Eigen::Quaterniond turn(tip.rotation);
    const auto [x, y, z] = std::array{tip.position.x(), tip.position.y(), tip.position.z()};
    std::printf("%s %d %.17g %.17g %.17g %.17g %.17g %.17g %.17g\\n", name, int(status), x, y, z, turn.w(), turn.x(),
                turn.y(), turn.z());
  }
}

int main() {
  const int failed = example();
TIPS
  using Parameters = ctcr::SystemParameters<3, everything::Effects>;
  const auto values = Parameters::values(everything::system());
  for (int k = 0; k < Parameters::count; ++k) std::printf("value %s %.17g\\n", Parameters::name(k).c_str(), values[k]);
  return failed;
}
"""


def everything():
    """A robot with each effect of the catalogue, no parameter of which is neutral."""
    robot = robot_file.load(TABLE2)
    known = catalogue.catalogue(robot.n_tubes)
    names = [name for effect in known.values() for name in effect.names()]
    neutral, sigma = catalogue.priors(robot, names)[:2]
    values = neutral + sigma * np.random.default_rng(1).uniform(0.1, 0.2, len(names))
    return catalogue.with_values(robot, known, dict(zip(names, values, strict=True)))


def soft():
    """One tube that softens."""
    robot = robot_file.load(TABLE2)
    actuation = robot.actuation.model_copy(update={"home_translation_mm": [-298.0], "home_rotation_deg": [0.0]})
    one = robot.model_copy(update={"tubes": robot.tubes[:1], "actuation": actuation})
    return catalogue.with_values(one, ["softening"], {"effects.softening.gamma.1": 2e-3})


def configurations(n_tubes: int) -> np.ndarray:
    """(K, 2 N) [m], [rad]."""
    beta = np.array([-0.31, -0.22, -0.14])[:n_tubes]
    alpha = np.random.default_rng(2).uniform(-2, 2, (3, n_tubes))
    return np.hstack([np.tile(beta, (3, 1)), alpha])


def built(folder: Path, headers: dict[str, str], program: str) -> str:
    """What the example prints, built as a project outside ours with a program in place of its main function."""
    installed, project = folder / "installed", folder / "project"
    shutil.copytree(EXAMPLE, project)
    for name, text in headers.items():
        (project / f"{name}.hpp").write_text(text)
    own = (EXAMPLE / "main.cpp").read_text()
    assert own.count("int main()") == 1
    includes = "\n".join(f'#include "{name}.hpp"' for name in headers)
    (project / "main.cpp").write_text(f"{own.replace('int main()', 'int example()')}\n{includes}\n{program}")
    off = [f"-DCTCR_{part}=OFF" for part in ("BUILD_TESTS", "BUILD_EXAMPLES", "CALIBRATION")]
    commands = [
        ["cmake", "-G", "Ninja", "-S", ROOT, "-B", folder / "library", *off],
        ["cmake", "--install", folder / "library", "--prefix", installed],
        ["cmake", "-G", "Ninja", "-S", project, "-B", project / "build", f"-DCMAKE_PREFIX_PATH={installed}"]
        # Without the flags of any build type: a fraction of the time to compile.
        + ["-DCMAKE_BUILD_TYPE=Unoptimised", "-DCMAKE_CXX_FLAGS=-DCTCR_FAST_COMPILE"],
        ["cmake", "--build", project / "build"],
        [project / "build" / "controller"],
    ]
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, timeout=900)
        assert done.returncode == 0, f"{command}\n{done.stdout[-4000:]}{done.stderr[-4000:]}"
    return done.stdout


@pytest.mark.skipif(not shutil.which("cmake"), reason="cmake is not installed")
def test_program(tmp_path):
    """Headers of all example robots, and of one with each effect, hold the numbers of Python; shapes agree to 1e-12."""
    robots = {f"robot_{i}": robot_file.load(path) for i, path in enumerate(ROBOTS)} | {"soft": soft()}
    headers = {name: cpp_header(robot, name) for name, robot in robots.items()}
    headers["everything"] = cpp_header(everything(), "everything")
    tips, wanted = [], []
    for name, robot in robots.items():
        n = robot.n_tubes
        for q in configurations(n):
            beta, alpha = (", ".join(map(repr, part.tolist())) for part in np.split(q, 2))
            joints = f"ctcr::Joints<{n}>{{ctcr::VecN<{n}>{{{beta}}}, ctcr::VecN<{n}>{{{alpha}}}}}"
            tips.append(f'  print_tips<{n}, {name}::Effects>("{name}", {name}::system(), {{{joints}}});')
            tip = Model(robot).predict([q[:n]], [q[n:]], [0.02, -0.05, 0.01])
            assert tip.solved.all()
            wanted.append([*tip.position[0], *tip.quaternion[0]])
    said = built(tmp_path, headers, PROGRAM.replace("TIPS", "\n".join(tips))).splitlines()
    found = [line.split() for line in said if line.split()[0] in robots]
    assert [line[1] for line in found] == ["0"] * len(wanted)
    found = np.array([line[2:] for line in found], float)
    found[:, 3:] *= np.sign(found[:, 3:4])
    for columns in (slice(0, 3), slice(3, 7)):
        size = np.linalg.norm(np.array(wanted)[:, columns], axis=1, keepdims=True)
        assert np.max(np.abs(found[:, columns] - np.array(wanted)[:, columns]) / size) < 1e-12
    values = [line.split()[1:] for line in said if line.startswith("value ")]
    assert [name for name, _ in values] == list(recording.names_of(3))
    np.testing.assert_allclose(
        [float(value) for _, value in values], recording.values(everything()), rtol=1e-14, atol=0
    )
    for what in ("late by", "a step"):
        assert re.search(rf"^{what} +min +[\d.]+, median +[\d.]+, p99 +[\d.]+, max +[\d.]+ us$", "\n".join(said), re.M)


def test_example():
    """The header of the example is what the command writes."""

    def undated(text: str) -> str:
        return re.sub(r"Exported by ctcr \S+ on \S+", "", text)

    assert undated((EXAMPLE / "robot.hpp").read_text()) == undated(cpp_header(robot_file.load(TABLE2)))


def test_provenance(tmp_path):
    """A fitted value has its deviation in the unit of the file; a value that was edited since has none."""
    robot = robot_file.load(TABLE2)
    changes = [
        Change(("tubes", 0, "length_mm"), "mm", 463.25, 0.5),
        Change(("actuation", "home_rotation_deg", 1), "deg", 2.5, 0.25),
        Change(("tubes", 1, "curvature_per_m"), "1/m", 5.25, 0.125),
        Change(("tubes", 2, "youngs_modulus_GPa"), "GPa", 57.543448, 0.01),  # 57543447999.99999 Pa by division
    ]
    path = tmp_path / "fitted.yaml"
    figures = {"parameters": {"effects.delay.delay": {"value": 0.03, "sd": 0.002}}}
    ledger.write(robot, path, changes, Entry("ctcr calibrate fit", [], figures), effects={"delay": {"delay": 0.03}})
    path.write_text(path.read_text().replace("curvature_per_m: 5.25", "curvature_per_m: 5.5"))
    text = cpp_header(robot_file.load(path))
    assert sha256(path) in text and '"fitted.yaml"' in text
    today = robot_file.load(path).history[0]["date"]
    assert f".length = 0.46325,  // 463.25 mm, sd 0.50 (ctcr calibrate fit, {today})" in text
    assert ".youngs_modulus = 57543448000.0,  // 57.543 GPa, sd 0.010" in text
    assert re.search(r"0\.0436\d+,  // 2\.50 deg, sd 0\.25 ", text)
    assert re.search(r"\.curvature = 5\.5,$", text, re.M)
    assert re.search(r" 0\.03,  // delay\.delay \[s\], 0\.0300, sd 0\.0020 ", text)


@pytest.mark.parametrize("in_file", [True, False])
def test_fitted_frame(tmp_path, in_file):
    """Fitted numbers of the tracker frame have the deviations of draws from the fit, also where the file had none."""
    robot = robot_file.load(TABLE2)
    if not in_file:
        path = tmp_path / "bare.yaml"
        path.write_text(re.sub(r"^tracker:\n(?:  .*\n)+", "", TABLE2.read_text(), flags=re.M))
        robot = robot_file.load(path)
    rng = np.random.default_rng(3)
    names = [f"tracker.{kind}.{axis}" for kind in ("position", "rotation") for axis in "xyz"]
    mixing = 1e-3 * rng.standard_normal((6, 6))
    values = np.append(rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.2, 0.2, 3))
    fit = SimpleNamespace(names=names, values=values, covariance=mixing @ mixing.T)
    fit.sd = np.sqrt(np.diag(fit.covariance))
    after = parameters.applied(robot, names, values)
    ledger.write(robot, tmp_path / "fitted.yaml", fields.changes(fit, robot, after), Entry("ctcr calibrate fit"))
    header = cpp_header(robot_file.load(tmp_path / "fitted.yaml"))
    drawn = rng.multivariate_normal(values, fit.covariance, 4000)
    spread = {
        "position": 1e3 * np.std(drawn[:, :3], axis=0),
        "rotation": np.std(parameters.turned(robot.tracker.rotation_vector_rad, drawn[:, 3:]), axis=0),
    }
    for kind, expected in spread.items():
        block = re.search(rf"tracker_{kind}\{{.*?\n}};", header, re.S)[0]
        said = re.findall(r", sd ([\d.]+) \(ctcr calibrate fit, \d{4}-\d\d-\d\d\)", block)
        np.testing.assert_allclose([float(sd) for sd in said], expected, rtol=0.1)


def test_hostile_names(tmp_path):
    """No text of a file becomes code."""
    robot = robot_file.load(TABLE2)
    robot.name = 'x\n#error here\n\u202e*/ " \\'
    entry = {"command": "\nint x;\\", "date": "\n", "changes": [{"field": "tubes[0].length_mm", "new": 463.0, "sd": 1}]}
    robot.history = [entry, {"changes": 3, "figures": "none"}]
    lines = cpp_header(robot).splitlines()
    assert len(lines) == len(cpp_header(robot_file.load(TABLE2)).splitlines())
    assert not any(line.endswith("\\") or "\u202e" in line for line in lines)


def test_bench_limits():
    """The limits are those of the bench, for the homes that the robot has."""
    bench = bench_file.load(ROOT / "examples" / "data" / "bench" / "bench.yaml")
    robot = robot_file.load(TABLE2)
    robot.actuation.recorded_home_translation_mm = [home - 1.0 for home in robot.actuation.home_translation_mm]
    text = cpp_header(robot, bench=bench)
    low = re.search(r"limits\.beta_low << (.*);", text)[1].split(", ")
    expected = 1e-3 * (np.array(bench.limits.translation_mm)[:, 0] + 1.0)
    np.testing.assert_allclose([float(value) for value in low], expected)


def test_without_tracker(tmp_path):
    """A robot file without a tracker makes T_ref the identity, which the command says; with one it does not."""
    bare = tmp_path / "bare.yaml"
    bare.write_text(re.sub(r"^tracker:\n(?:  .*\n)+", "", TABLE2.read_text(), flags=re.M))
    for source, is_said in ((bare, True), (TABLE2, False)):
        done = CliRunner().invoke(cli, ["export", str(source), "--cpp", str(tmp_path / "robot.hpp")])
        assert done.exit_code == 0, done.output
        assert ("no tracker: T_ref in the header is the identity" in done.output) == is_said


@pytest.mark.skipif(not shutil.which("c++"), reason="no compiler is installed")
def test_macros(tmp_path):
    """The compiler says of each macro that it knows, such as linux and EIGEN_PI, that it can be no namespace."""

    def preprocessed(namespace: str, *options: str) -> subprocess.CompletedProcess[str]:
        header = tmp_path / "robot.hpp"
        header.write_text(cpp_header(robot_file.load(TABLE2), namespace))
        flags = ("-std=gnu++20", "-I", ROOT / "include", "-isystem", "/usr/include/eigen3", "-x", "c++", "-E")
        return subprocess.run(["c++", *flags, *options, header], capture_output=True, text=True)

    plain = preprocessed("robot", "-dM")
    assert plain.returncode == 0
    macros = {line.split()[1].partition("(")[0] for line in plain.stdout.splitlines()}
    macros = {name for name in macros if is_free([name])}
    assert {"linux", "unix", "EIGEN_PI", "M_PI", "EOF"} <= macros
    refused = preprocessed("::".join(sorted(macros)))
    assert refused.returncode
    assert set(re.findall(r'#error "(\w+) is a macro here', refused.stderr)) == macros


def test_refusals(monkeypatch):
    """What a controller cannot do without, effects written in Python, and names that are none."""
    robot = robot_file.load(TABLE2)
    robot.actuation.translation_mm_per_rev = None
    with pytest.raises(InputError, match="translation_mm_per_rev: is not known"):
        cpp_header(robot)
    monkeypatch.setitem(robot_file.user_effects, "mine", None)
    with pytest.raises(InputError, match="mine is written in Python"):
        cpp_header(robot_file.load(TABLE2).with_effects({"mine": {}}))
    for name in (
        "std",
        "ctcr::x",
        "a b",
        "",
        "1x",
        "x;int y",
        "é",
        "x::",
        "class",
        "and",
        "a::co_await",
        "stdin",
        "time",
        "sin",
        "Eigen",
        "a::std",
        "a::ctcr::b",
    ):
        with pytest.raises(InputError, match="no free name"):
            cpp_header(robot_file.load(TABLE2), name)
    for name in ("robot", "a::b_2", "classes", "Main", "a::time", "mB", "robot_7"):
        assert f"namespace {name} {{" in cpp_header(robot_file.load(TABLE2), name)
