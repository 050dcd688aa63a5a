"""What a stranger does first with the package that pip installed, in an empty folder: a program for `tools/dev check`.

It knows nothing of the checkout. Exit code 1 where something fails."""

import subprocess
import sys
import time
from pathlib import Path

import ctcr
import numpy as np

ROBOT, TABLE = "ctcr_demo/robot.yaml", "ctcr_demo/measurements.csv"
PREDICT = f"""
robot, table = ctcr.load("{ROBOT}"), ctcr.read("{TABLE}")
tips = ctcr.Model(robot).predict(table.beta, table.alpha, table.force).position
"""


def run(*command: str) -> None:
    started = time.perf_counter()
    done = subprocess.run([sys.executable, "-m", *command], capture_output=True, text=True)
    print(f"{time.perf_counter() - started:6.1f} s  {' '.join(command)}", flush=True)
    if done.returncode:
        sys.exit(f"{done.stdout}{done.stderr}{' '.join(command)}: exit code {done.returncode}")


def same_predictions() -> None:
    """The module for every processor says what the one for this processor does."""
    names = {"ctcr": ctcr}
    exec(PREDICT, names)
    print(f"the module that this processor runs: {sys.modules['ctcr._core'].__file__}")
    plain = f"import ctcr, numpy\nctcr.__path__[:] = ctcr.__path__[-1:]\n{PREDICT}\nnumpy.save('tips.npy', tips)"
    subprocess.run([sys.executable, "-c", plain], check=True)
    np.testing.assert_allclose(np.load("tips.npy"), names["tips"], atol=1e-9)


def the_api() -> None:
    robot, table = ctcr.load(ROBOT), ctcr.read(TABLE)
    found = ctcr.diagnose(robot, table)
    better = ctcr.add(robot, found, table)
    print(f"{found!r}\n{ctcr.compare(better.robot, table)!r}")


if __name__ == "__main__":
    run("ctcr", "demo")
    run("ctcr", "compare", ROBOT, TABLE, "--report", "report.html")
    same_predictions()
    the_api()
    run("pip", "install", "--quiet", "ctcr[bench]")
    run("ctcr", "demo", "bench", "--short")
    assert Path("build/bench_demo/report.html").stat().st_size < 1e6
