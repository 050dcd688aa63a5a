"""tools/dev new-effect writes an effect that compiles and takes its place in the catalogue."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[3]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    shutil.copytree(PROJECT / "include", tmp_path / "include")
    shutil.copytree(PROJECT / "tests/support", tmp_path / "tests/support")
    (tmp_path / "tests/effects").mkdir()
    (tmp_path / "tools").mkdir()
    shutil.copy(PROJECT / "tools/new_effect.py", tmp_path / "tools")
    return tmp_path


def new_effect(tree: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(tree / "tools/new_effect.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_compiles(tree: Path) -> None:
    """The skeleton compiles without warnings and stands in the catalogue."""
    done = new_effect(tree, "cable_pull")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "include/ctcr/effects/cable_pull.hpp",
        "tests/effects/cable_pull_test.cpp",
        "include/ctcr/effects/catalogue.hpp",
    ]
    every = tree / "every.cpp"
    every.write_text(
        '#include "tests/effects/cable_pull_test.cpp"\n#include "ctcr/effects/catalogue.hpp"\n'
        "static_assert(std::is_same_v<decltype(std::get<ctcr::CablePull<2>>(ctcr::Catalogue::On<2>{}.list)),\n"
        "                             ctcr::CablePull<2>&&>);\n",
        encoding="utf-8",
    )
    compiler = shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        pytest.skip("there is no C++ compiler")
    eigen = ["-isystem", "/usr/include/eigen3"]
    flags = ["-std=c++20", "-fsyntax-only", "-Wall", "-Wextra", "-Wno-psabi", "-Werror"]
    command = [compiler, *flags, f"-I{tree}/include", f"-I{tree}/tests", f"-I{tree}", *eigen, str(every)]
    compiled = subprocess.run(command, capture_output=True, text=True, check=False)
    assert compiled.returncode == 0, compiled.stderr


@pytest.mark.parametrize(
    ("name", "why"),
    [("Cable", "is no id"), ("a-b", "is no id"), ("friction", "exists already"), ("frame_jump", "exists already")],
)
def test_refuses_names(tree: Path, name: str, why: str) -> None:
    """A name that cannot be is refused, and the catalogue stays as it is."""
    before = (tree / "include/ctcr/effects/catalogue.hpp").read_text()
    done = new_effect(tree, name)
    assert done.returncode != 0
    assert why in done.stderr
    assert (tree / "include/ctcr/effects/catalogue.hpp").read_text() == before
