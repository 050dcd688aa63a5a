"""The JSON of a command has the keys that docs/json.md lists, and the document lists no others."""

import json
import re
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from ctcr.cli import cli
from ctcr.model import simulation
from ctcr.robot import robot_file
from hidden_sessions import measured

ROOT = Path(__file__).parents[3]
ROBOT = ROOT / "examples" / "robots" / "table2.yaml"
PAGE = (ROOT / "docs" / "json.md").read_text()


def documented() -> dict[str, set[str]]:
    """The keys of each command: `a.{b, c}` are `a.b` and `a.c`."""
    found = {}
    for section in PAGE.split("\n## ")[1:]:
        title, body = section.split("\n", 1)
        keys = set()
        for cell in re.findall(r"^\| (`.*?`) \|", body, re.MULTILINE):
            for key in re.findall(r"`([^`]+)`", cell):
                head, _, rest = key.partition("{")
                names, _, tail = rest.partition("}")
                keys |= {head + name + tail for name in names.split(", ")}
        found[title] = keys
    return found


def leaves(data, at: str = "") -> dict[str, bool]:
    """Keys of everything below, and whether nothing is there, so that keys below it cannot be seen."""
    if isinstance(data, dict) and data:
        return {k: v for key, value in data.items() for k, v in leaves(value, f"{at}.{key}".lstrip(".")).items()}
    if isinstance(data, list) and data and isinstance(data[0], dict):
        return {k: v for entry in data for k, v in leaves(entry, f"{at}[]").items()}
    return {at: data in (None, [], {})}


def plain(key: str) -> str:
    """A key without marks of lists: whether a list has entries depends on the data."""
    return key.replace("[]", "")


def leads_to(key: str, path: str) -> bool:
    """Whether a path begins with a key, in which `*` is any name."""
    pattern = re.escape(plain(key)).replace(r"\*", ".+?")
    return re.match(rf"{pattern}(\.|$)", plain(path)) is not None


COMMANDS = {
    "compare": "compare robot.yaml measurements.csv",
    "calibrate fit": "calibrate fit robot.yaml measurements.csv",
    "diagnose": "diagnose robot.yaml measurements.csv",
    "add": "add robot.yaml tip_load --fit measurements.csv -o added.yaml",
    "next": "next robot.yaml measurements.csv",
    "history": "history added.yaml",
    "predict": "predict robot.yaml measurements.csv -o p.csv",
    "shape": "shape robot.yaml --beta-mm -330,-240,-165 --alpha-deg 50,-40,-60 --all",
    "info": "info robot.yaml",
}


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """What each command writes, of a robot with a weight at its tip."""
    folder, found = tmp_path_factory.mktemp("json"), {}
    robot = robot_file.load(ROBOT)
    simulation.write(
        measured(robot, np.random.default_rng(2), {"effects.tip_load.mass": 2e-3}), folder / "measurements.csv"
    )
    (folder / "robot.yaml").write_bytes(ROBOT.read_bytes())
    with chdir(folder):
        for title, command in COMMANDS.items():
            done = CliRunner().invoke(cli, [*command.split(), "--json", "out.json"], catch_exceptions=False)
            assert done.exit_code == 0, done.output
            found[title] = leaves(json.loads(Path("out.json").read_text()))
    return found


def test_commands_documented():
    """docs/json.md describes the JSON of every command."""
    assert set(COMMANDS) == set(documented())


@pytest.mark.parametrize("title", COMMANDS)
def test_keys(answers, title):
    """Every key is described, and every described key is there or below something empty."""
    said, found = documented()[title], answers[title]
    whole = {key for key in said if not any(key != other and leads_to(key, other) for other in said)}

    def describes(key, path):
        is_it = leads_to(key, path) and (key in whole or plain(key) == plain(path))
        return is_it or (found[path] and leads_to(path, key))

    assert [path for path in found if not any(describes(key, path) for key in said)] == []
    assert [key for key in said if not any(leads_to(key, path) or describes(key, path) for path in found)] == []
