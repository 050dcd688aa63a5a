"""The examples of all help pages are accepted, and what they show works."""

import shutil
from pathlib import Path

import pytest
from command_line import all_pages, example, parse

ROOT = Path(__file__).parents[3]
PAGES = [pytest.param(path, found, id=" ".join(path) or "ctcr") for path, found in all_pages()]
# These need a bench, a log, an effect in the robot file, or tell a long story that other tests tell.
NOT_RUN = "demo devices import join move next record remove reproduce sim stop".split()
SECONDS = {("add",), ("bench",), ("diagnose",), ("track",), ("calibrate", "fit")}  # that some of them take


def runs():
    for path, command in all_pages():
        if not {*path[:1], *example(command)[:1]} & set(NOT_RUN):
            words = example(command)
            marks = [pytest.mark.slow] if any(tuple(words[: len(slow)]) == slow for slow in SECONDS) else []
            yield pytest.param(words, id=" ".join(path) or "ctcr", marks=marks)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the files that the examples name."""
    shutil.copytree(ROOT / "examples" / "data" / "calibration", tmp_path, dirs_exist_ok=True)
    shutil.copy(ROOT / "examples" / "data" / "plan.csv", tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("path", "command"), PAGES)
def test_accepted(path, command):
    """Every help page, also that of a group, ends with an example of its command, which the command accepts."""
    words = example(command)
    assert words and parse(words)[: len(path)] == path


@pytest.mark.parametrize("words", list(runs()))
def test_runs(words, folder, run):
    """The example does its work, and nothing in what it writes looks wrong."""
    if words[0] == "init":
        (folder / "robot.yaml").unlink()
    code, out, err = run(*words)
    assert code == 0, err
    assert words[0] != "init" or "Doubt" not in out
