"""Runs what the documents tell the reader to run, and the examples: commands, C++ blocks, Python blocks.

What a document says that commands print stands in a block `output` behind them, and they must print it. Commands that
build or test everything (`tools/dev ...`) are only looked up in the command's own help.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import ctcr
import numpy as np
import origin
import pytest

ROOT = Path(__file__).parents[3]
DOCUMENTS = [
    ROOT / "README.md",
    *sorted(
        path for folder in ("docs", "include", "examples", "bench", "tools") for path in (ROOT / folder).rglob("*.md")
    ),
]
RUN = ("tools/dev", ".venv/bin/ctcr", "c++", "build/")  # what commands begin with
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def all_blocks_of(document: Path) -> list[tuple[str, str]]:
    """Language and body of each, in their order."""
    return BLOCK.findall(document.read_text())


def blocks(document: Path, language: str) -> list[str]:
    return [body for kind, body in all_blocks_of(document) if kind == language]


def all_blocks(language: str) -> list:
    return [
        pytest.param(body, id=f"{name(document)}-{number}")
        for document in DOCUMENTS
        for number, body in enumerate(blocks(document, language), start=1)
    ]


def commands(block: str) -> list[str]:
    lines = block.replace("\\\n", " ").splitlines()
    return [line.split(" #")[0].strip() for line in lines if line.startswith(RUN)]


def missing_lines(excerpt: str, printed: str) -> list[str]:
    """Lines of an excerpt that do not stand in the output, in this order; blanks and the ends of lines do not count."""
    rest, missing = " ".join(printed.split()), []
    for line in excerpt.splitlines():
        words = " ".join(line.split())
        before, found, behind = rest.partition(words)
        if found:
            rest = behind
        else:
            missing.append(line)
    return missing


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder that looks like the project to a command, but keeps what the command writes away from it."""
    for folder in ("examples", "include"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    (tmp_path / ".venv").symlink_to(sys.prefix)
    (tmp_path / "build").mkdir()
    return tmp_path


def run(command: list, folder: Path) -> str:
    done = subprocess.run(
        command,
        cwd=folder,
        env=os.environ | {"MPLBACKEND": "Agg", "COLUMNS": "80"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


def test_readme_commands():
    """The README begins with the commands to see and to test the project."""
    assert commands(blocks(ROOT / "README.md", "sh")[0]) == ["tools/dev demo", "tools/dev test"]


@pytest.mark.parametrize("language", ["cpp", "python"])
def test_readme_shows(language):
    """The README has an example in each language."""
    assert blocks(ROOT / "README.md", language)


def test_excerpt():
    """An excerpt holds words of the output in their order, whatever the spaces between them."""
    printed = "error  1.44 mm\n  RMS over\n560 readings"
    assert not missing_lines("error 1.44 mm RMS\n560   readings", printed)
    assert missing_lines("560 readings\nerror 1.45 mm\nerror 1.44 mm", printed) == ["error 1.45 mm", "error 1.44 mm"]


def names(text: str) -> set[str]:
    """What a document says that `import ctcr` offers, such as `ctcr.load(path)`; an import statement names modules."""
    spans = re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL))
    code = " ".join(span for span in spans if "import" not in span)
    return set(re.findall(r"(?<![/\w])ctcr(?!\.hpp)(?:\.[^\W\d]\w*)+", code))


def test_names_exist():
    """Names that documents write as `ctcr.name` are there after `import ctcr` alone."""
    said = names("`ctcr.load(x)` and `a =\nctcr.frames.product(b)`, ctcr.no, `from ctcr.track import a`")
    assert said == {"ctcr.load", "ctcr.frames.product"}
    said = {each for document in DOCUMENTS for each in names(document.read_text())}
    assert {"ctcr.load", "ctcr.user_effects.load"} <= said
    look_up = "import operator, sys, ctcr\nfor name in sys.argv[1:]: operator.attrgetter(name[5:])(ctcr)"
    subprocess.run([sys.executable, "-c", look_up, *sorted(said)], check=True)


@pytest.mark.parametrize("document", [path for path in DOCUMENTS if blocks(path, "sh")], ids=name)
def test_commands(document, project):
    """They run, and print what the document shows behind them."""
    usage = run([ROOT / "tools/dev", "--help"], project)
    printed = ""
    for language, body in all_blocks_of(document):
        if language == "output":
            assert not missing_lines(body, printed), printed
        elif language == "sh":
            printed = ""
            for command in commands(body):
                if command.startswith("tools/dev"):
                    _, subcommand, *rest = command.split()
                    for word in (subcommand, *(word for word in rest if word.startswith("-"))):
                        assert re.search(rf"(?<![\w-]){word}(?![\w-])", usage), f"{command}: not in tools/dev"
                else:
                    printed += run(["bash", "-c", command], project)


@pytest.mark.parametrize("block", all_blocks("python"))
def test_python_block(block, project):
    """Every Python block of the documents runs."""
    run([sys.executable, "-c", block], project)


@pytest.mark.parametrize("example", sorted((ROOT / "examples").glob("*.py")), ids=name)
def test_python_example(example, project):
    """Every Python example runs."""
    run([sys.executable, example], project)


def as_program(block: str) -> str:
    """A block without main is the body of one, below its own includes."""
    if "int main(" in block:
        return block
    lines = block.splitlines()
    includes = [line for line in lines if line.startswith("#include")]
    return "\n".join([*includes, "int main() {", *(line for line in lines if line not in includes), "}\n"])


def is_quoted(block: str) -> bool:
    """Whether all lines of a block stand, in this order, in an example, which is built and run with the C++ tests."""
    for example in sorted((ROOT / "examples").glob("*.cpp")):
        lines = iter([line.split(" //")[0].strip() for line in example.read_text().splitlines()])
        if all(line.split(" //")[0].strip() in lines for line in block.splitlines()):
            return True
    return False


def test_quotation():
    """A quotation holds the lines of an example in their order."""
    quotation = "#include <vector>\nint main() {"
    assert is_quoted(quotation)
    assert not is_quoted("\n".join(reversed(quotation.splitlines())))
    assert not is_quoted(quotation + "\nnot there")


@pytest.mark.parametrize("block", all_blocks("cpp"))
def test_cpp_block(block, project):
    """Also shows that the library works as a subdirectory of somebody's project."""
    if is_quoted(block):
        return
    if not shutil.which("cmake"):
        pytest.skip("cmake is not installed")
    (project / "main.cpp").write_text(as_program(block))
    (project / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\n"
        "project(reader LANGUAGES CXX)\n"
        f'add_subdirectory("{ROOT}" ctcr)\n'
        "add_executable(reader main.cpp)\n"
        "target_link_libraries(reader PRIVATE ctcr::ctcr)\n"
    )
    fast = "-DCMAKE_CXX_FLAGS=-DCTCR_FAST_COMPILE"  # and without a build type: the shortest to compile
    run(["cmake", "-G", "Ninja", "-B", "build", fast], project)
    run(["cmake", "--build", "build"], project)
    run([project / "build/reader"], project)


def test_scores_told_are_those_kept():
    """Of all noises together, as the page that the README names keeps them."""
    page, told = (ROOT / "docs" / "diagnosis_scores_unseen.md").read_text(), (ROOT / "README.md").read_text()

    def of(score):
        counts = re.findall(rf"^\| {score} \| \w+ \| (\d+)/(\d+) =", page, re.MULTILINE)
        assert counts
        return [sum(int(count) for count in column) for column in zip(*counts, strict=True)]

    right, sets = of("right class first")
    assert f"right effect first in {right} of {sets}" in " ".join(told.split())
    quiet, controls = of("controls: nothing named")
    assert f"none in {quiet} of {controls} that hide nothing" in " ".join(told.split())
    named, causes = np.add(of("varied, two causes: causes named"), of("varied, more: causes named"))
    assert f"{named} of {causes} causes where two to five act together" in " ".join(told.split())


def test_conventions_told_are_those_kept():
    """How often a wrong convention was named in the reporting half."""
    _, page = (ROOT / "docs" / "convention_study.md").read_text().split("## Reporting half")
    told = " ".join((ROOT / "README.md").read_text().split())
    kept = [
        re.search(rf"\| {wrong} \| (\d+)/(\d+) =", page).groups()
        for wrong in ("one", "one, of some runs alone", "nothing")
    ]
    one, some, none = ("{} of {}".format(*counts) for counts in kept)
    assert f"in {one}, in {some} where some runs alone had it, and none in {none} that had none" in told


@pytest.mark.parametrize("document", ["README.md", "docs/calibration.md"])
def test_coverage_told(document):
    """The share of true values within two standard deviations, as the page of the study keeps it."""
    page = (ROOT / "docs" / "calibration_study.md").read_text()
    counts = re.findall(r"^\| \w+ \| (\d+) \| (\d+)/(\d+) =", page, re.MULTILINE)
    robots, within, values = (sum(int(count) for count in column) for column in zip(*counts, strict=True))
    told = " ".join((ROOT / document).read_text().replace("[", "").split())
    assert f"on {robots} random robots" in told.lower() and f"in {100 * within / values:.0f} % of the cases" in told


def test_origins():
    """Each page that a tool writes says by which, on which day and at which commit, as the shared sentence does."""
    form = re.compile(r"Written by `(\S+) ?[^`]*` on \d{4}-\d\d-\d\d, commit ([0-9a-f]{7,}( and changes)?|unknown)\b")
    assert form.fullmatch(origin.written_by("tools/score.py --keep").rstrip("."))
    pages = {path.stem: " ".join(path.read_text().split()) for path in (ROOT / "docs").glob("*.md")}
    written = {name: page for name, page in pages.items() if "Written by `tools/" in page}
    assert len(written) >= 9
    for name, page in written.items():
        assert (said := form.search(page)), name
        assert "unknown" not in said[0] and (ROOT / said[1]).exists(), name
    tools = [path for path in (ROOT / "tools").glob("*.py") if 'ROOT / "docs" / ' in path.read_text()]
    assert [path.name for path in tools if "written_by(" not in path.read_text()] == ["real_data_study.py"]


def test_demonstration_told():
    """How wrong the model without friction is, with the robot file as it is and with the true parameters."""
    folder = ROOT / "examples" / "data" / "demo"
    told = (folder / "README.md").read_text()
    rows = re.findall(r"^\| ([^|,]+),? \S+ \|([\d.| -]+)\|$", told, re.MULTILINE)
    truth = {name: [float(value) for value in values.split("|")] for name, values in rows}
    frame = [
        [float(number) for number in re.search(rf"{words} \(([^)]+)\)", told).group(1).split(",")]
        for words in ("position", r"rotation\s+vector")
    ]

    def error(robot):
        off = 1e3 * (ctcr.predict(robot, table, frame="tracker").position - table.position)
        return f"{np.sqrt(np.mean(np.sum(off**2, axis=1))):.1f} mm"

    robot, table = ctcr.load(folder / "robot.yaml"), ctcr.read(folder / "measurements.csv")
    believed = error(robot)
    for i, tube in enumerate(robot.tubes):
        tube.youngs_modulus_GPa, tube.length_mm = truth["Young's modulus"][i], truth["length"][i]
        tube.curved_length_mm, tube.curvature_per_m = truth["curved length"][i], truth["curvature"][i]
    homes = robot.actuation
    homes.recorded_home_translation_mm = homes.home_translation_mm
    homes.recorded_home_rotation_deg = homes.home_rotation_deg
    homes.home_translation_mm = list(np.add(homes.home_translation_mm, truth["translation offset"]))
    homes.home_rotation_deg = list(np.add(homes.home_rotation_deg, truth["rotation offset"]))
    robot.tracker.position_mm, robot.tracker.rotation_vector_rad = frame
    words = f"wrong by {error(robot)} RMS, with `robot.yaml` as it is by {believed}"
    assert words in " ".join(told.split())
