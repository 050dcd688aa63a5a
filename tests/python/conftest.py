"""What all tests share.

One BLAS thread a process: the tests run in parallel processes, whose BLAS threads would only wait for each other.
Ctrl+C as in a terminal: a shell lets what it starts in the background ignore it, and programs that tests interrupt
would inherit that.
"""

import os
import signal

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
signal.signal(signal.SIGINT, signal.default_int_handler)

from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402
import pytest  # noqa: E402

EXAMPLES = Path(__file__).parents[2] / "examples"
DEMO = EXAMPLES / "data" / "demo" / "measurements.csv"


@pytest.fixture(scope="module")
def robot():
    """That of the paper's Table II; in tests that run_on_bench runs, the one on the bench."""
    from ctcr.robot import robot_file

    return robot_file.load(os.environ.get("ROBOT_FILE", EXAMPLES / "robots" / "table2.yaml"))


@pytest.fixture(scope="module")
def plan():
    """80 rows in 8 runs of the demonstration, out and back, with loads."""
    return demonstration(runs=8, every=4)


@pytest.fixture(scope="module")
def recorded():
    """280 rows in 14 runs of the demonstration."""
    return demonstration(runs=14, every=2)


def demonstration(runs: int, every: int):
    """Its first runs, and of these every n-th row."""
    from ctcr.table import measurements

    table = measurements.load(DEMO, 3)
    kept = np.flatnonzero((table.run < runs) & (np.arange(len(table)) % every == 0))
    names = ("t", "run", "beta", "alpha", "force", "position", "quaternion", "row")
    return replace(table, **{name: getattr(table, name)[kept] for name in names})


@pytest.fixture(scope="session")
def hidden():
    """hidden(robot, friction__coefficient="0.01"): the robot with effects that a test hides in its readings."""
    from ctcr.effects import catalogue
    from ctcr.effects.settings import settings

    def with_them(robot, **given):
        values = settings([f"{name.replace('__', '.')}={value}" for name, value in given.items()], robot)
        return catalogue.with_values(robot, list(dict.fromkeys(name.split(".")[1] for name in values)), values)

    return with_them


@pytest.fixture
def run(capsys):
    """run("info", path): exit code, standard output and standard error of a command."""
    from ctcr import cli

    def run(*arguments) -> tuple[int, str, str]:
        code = cli.run([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return run
