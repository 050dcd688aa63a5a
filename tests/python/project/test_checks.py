"""The checks of tools/ find what is planted, and nothing else; the benchmark comparison computes what it says."""

import importlib.util
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


def load(name: str, folder: str = "tools"):
    spec = importlib.util.spec_from_file_location(name, ROOT / folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


layers = load("check_layers")
text = load("check_text")
bench = load("bench_against")
counting = load("count_instructions", "bench")


def plant(root: Path, path: str, content: str) -> Path:
    file = root / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content)
    return file


LAYERS = ["low", "left", "right", "high"]
TABLES = """\
## Layers

| folder | what it knows |
|---|---|
| `low` | a |
| `left`, `right` | b |
| `high` | c |

In `low`, from the outside in:

| header | its one idea |
|---|---|
| `x.hpp`, `y.hpp` | beside `z.hpp` |

In `left`, which has a room:

| room | header | its one idea |
|---|---|---|
| room | `w.hpp` | beside `z.hpp` |
| | `x.hpp` | |
"""


def library(root: Path, **headers: str) -> Path:
    """Headers in the layers low, left and right beside each other, and high; `headers` are texts by name: low__x."""
    plant(root, "ctcr/README.md", TABLES)
    plant(root, "ctcr/ctcr.hpp", "#include <ctcr/high/x.hpp>\n")
    for name in ("low__x", "low__y", "left__x", "left__room__w", "right__x", "high__x", *headers):
        plant(root, f"ctcr/{name.replace('__', '/')}.hpp", headers.get(name, "#pragma once\n"))
    return root


@pytest.mark.parametrize(
    ("own", "seen"), [("low", ["low"]), ("left", ["low", "left"]), ("right", ["low", "right"]), ("high", LAYERS)]
)
@pytest.mark.parametrize("form", ["<ctcr/{}/x.hpp>", '"ctcr/{}/x.hpp"', '"../{}/x.hpp"'])
def test_layers(tmp_path, own, seen, form):
    """A header includes its own layer and those above it in the table, and no other one."""
    for other in LAYERS:
        library(tmp_path, **{f"{own}__x": f"#pragma once\n#include {form.format(other)}\n"})
        wrong = f"{tmp_path}/ctcr/{own}/x.hpp:2: layer '{own}' must not include layer '{other}'"
        assert layers.header_problems(tmp_path) == ([] if other in seen else [wrong])


@pytest.mark.parametrize(
    ("planted", "found"),
    [
        ("shed__x", "layer 'shed' is missing"),
        ("low__new", "'low/new.hpp' is missing in its table"),
        ("left__room__new", "'left/new.hpp' is missing in its table"),
        ("high__new", ""),
    ],
)
def test_tables_of_layers(tmp_path, planted, found):
    """A folder without a row, and a header without one in the table of its folder, if it has a table."""
    said = layers.header_problems(library(tmp_path, **{planted: "#pragma once\n"}))
    assert len(said) == bool(found) and all(found in text for text in said)


def test_tables_name_what_exists(tmp_path):
    """Names in a table whose header or folder was removed."""
    library(tmp_path)
    (tmp_path / "ctcr/low/y.hpp").unlink()
    for path in ("x.hpp", ""):
        getattr(tmp_path / "ctcr/high" / path, "unlink" if path else "rmdir")()
    said = layers.header_problems(tmp_path)
    assert len(said) == 2 and "layer 'high' has no folder" in said[0] and "'low/y.hpp' does not exist" in said[1]


def package(root: Path, **modules: str) -> Path:
    """A Python package with the rooms low and high; `modules` are texts by name, such as low__a."""
    plant(root, "ctcr/README.md", "## Rooms\n\n| `low` | a |\n| `high` | b |\n")
    for name, content in modules.items():
        plant(root, f"ctcr/{name.replace('__', '/')}.py", content)
    return root


@pytest.mark.parametrize(
    ("low", "high", "found"),
    [
        ("import math", "from ctcr.low import a", ""),
        ("from ctcr.high import b", "", "room 'low' must not import room 'high'"),
        ("def f():\n    import math", "", "imports math inside a function"),
        ("def f():\n    import serial", "", ""),
        ("from ctcr.low import c", "", "modules import each other"),
    ],
)
def test_rooms(tmp_path, low, high, found):
    """An import is refused where it points upwards, stands in a function or closes a circle, and only there."""
    package(tmp_path, low__a=low, low__c="from ctcr.low import a" if "low import c" in low else "", high__b=high)
    said = layers.python_problems(tmp_path)
    assert len(said) == bool(found) and all(found in text for text in said)


def test_package_names_its_rooms(tmp_path):
    """The package's own file names what lies in rooms that import it, and closes no circle."""
    package(tmp_path, low__a="from ctcr import settings", settings="")
    plant(tmp_path, "ctcr/__init__.py", "from ctcr.low import a")
    assert not layers.python_problems(tmp_path)


def test_room_without_row(tmp_path):
    """A folder that the table of rooms does not name is refused."""
    said = layers.python_problems(package(tmp_path, shed__x=""))
    assert len(said) == 1 and "room 'shed' is missing" in said[0]


# Written in pieces, so that this file passes the check itself.
@pytest.mark.parametrize("line", ["/" + "home/ann/data", '"/' + 'tmp/x"', "pypi" + ".org", "see issue " + "#3"])
def test_forbidden_text(tmp_path, line):
    """Forbidden text is found with its line."""
    file = plant(tmp_path, "include/ctcr/x.hpp", f"#pragma once\n// {line}\n")
    assert [problem.rsplit(":", 1)[0] for problem in text.problems(tmp_path)] == [f"{file}:2"]


@pytest.mark.parametrize("line", ["include/" + "home/x", "${prefix}/" + "tmp/x", "~/" + "work/x", "tissue 3", "1/home"])
def test_harmless_text(tmp_path, line):
    """Text that only resembles forbidden text passes."""
    plant(tmp_path, "tools/x.py", f"# {line}\n")
    assert text.problems(tmp_path) == []


def test_benchmark_ratios_are_paired_by_round():
    """The machine slows down fivefold, the new program takes 0.8 of the old one's time: the ratio shows only that."""
    pairs = [({"solve": 100.0 * k}, {"solve": 80.0 * k, "added": 1.0}) for k in (1, 2, 3, 5)]
    solve, added = bench.summary(pairs)
    assert solve.split()[1:] == ["250.0", "200.0", "0.800", "[0.800,", "0.800]", "faster"]
    assert added.endswith("only in one commit")


def test_benchmark_report():
    """A benchmark report is read in nanoseconds, without runs that failed."""
    report = {
        "benchmarks": [
            {"name": "a", "run_type": "iteration", "cpu_time": 2.0, "time_unit": "us"},
            {"name": "b", "run_type": "iteration", "cpu_time": 2.0, "time_unit": "ns", "error_occurred": True},
            {"name": "a_mean", "run_type": "aggregate", "cpu_time": 2.0, "time_unit": "us"},
        ]
    }
    assert bench.cpu_times(report) == {"a": 2000.0}


def test_instructions_told():
    """The README of the library tells the counts that are recorded."""
    rows = re.findall(r"^\| (?:instructions|with every effect).*", (ROOT / "include/ctcr/README.md").read_text(), re.M)
    told = [int(cell) for row in rows for cell in row.split("|") if cell.strip().isdigit()]
    assert told == list(json.loads(counting.BASELINE.read_text())["instructions_per_step"].values())


@pytest.mark.parametrize(
    ("growth", "left_out", "compiler", "code"),
    [(1.029, None, "g++ 1", 0), (1.031, None, "g++ 1", 1), (1.0, "effects", "g++ 1", 1), (2.0, None, "g++ 2", 0)],
)
def test_instruction_limit(tmp_path, monkeypatch, capsys, growth, left_out, compiler, code):
    """More instructions than recorded are refused, for the same compiler."""
    recorded = {case: 1000 for case in counting.CASES if case != left_out}
    baseline = tmp_path / "instructions.json"
    baseline.write_text(json.dumps({"compiler": "g++ 1", "instructions_per_step": recorded}))
    monkeypatch.setattr(counting, "BASELINE", baseline)
    monkeypatch.setattr(counting, "run", lambda command: compiler)
    monkeypatch.setattr(counting, "per_step", lambda driver, case: round(1000 * (growth if case == "loaded" else 1.0)))
    monkeypatch.setattr("sys.argv", ["count_instructions", "--driver", "x"])
    assert counting.main() == code
    named = left_out or ("loaded" if code else None)
    assert named is None or f"\n{named}: " in capsys.readouterr().out
