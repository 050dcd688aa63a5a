"""How long the joint fit and a diagnosis take, and the memory they need, by the number of rows.

Simulated sessions of the robot of Table II, whose parameters are off by 0.7 of what the robot file allows: stops with
loads, or a stream at 8 Hz whose poses come 60 ms late. Each case runs in a process of its own, on all cores. Times of
other machines are not comparable; what counts is how they grow.
"""

import argparse
import json
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
CASES = [("fit", 337), ("fit", 2_000), ("fit", 20_000), ("diagnose", 337), ("diagnose stream", 1_600)]
LONG = [("diagnose", 20_000)]


def session(kind: str, rows: int):
    """The robot as described, and the readings of the true one."""
    from ctcr.effects import catalogue
    from ctcr.model import parameters, simulation
    from ctcr.robot import robot_file
    from ctcr.table import measurements

    rng = np.random.default_rng(1)
    robot = robot_file.load(EXAMPLES / "robots" / "table2.yaml")
    names = parameters.expand("standard", robot)
    mean, sd, *_ = parameters.priors(robot, names)
    true = parameters.applied(robot, names, mean + 0.7 * sd * rng.standard_normal(len(names)))
    plan = measurements.load(EXAMPLES / "data" / "plan.csv", robot.n_tubes)
    stream = "stream" in kind
    if stream:
        true = catalogue.with_values(true, ["delay"], {"effects.delay.delay": 0.06})
    runs = [np.flatnonzero(plan.run == run) for run in np.unique(plan.run)]
    made: list[dict] = []
    while sum(len(run["t"]) for run in made) < rows:
        chosen = runs[rng.integers(len(runs))]
        at = np.linspace(0, len(chosen) - 1, 8 * len(chosen)) if stream else np.arange(len(chosen))
        joints = {
            name: np.column_stack(
                [
                    np.interp(at, np.arange(len(chosen)), column)
                    for column in (getattr(plan, name)[chosen] + rng.uniform(-reach, reach, robot.n_tubes)).T
                ]
            )
            for name, reach in (("beta", 2e-3), ("alpha", np.pi))
        }
        start = made[-1]["t"][-1] + 10 if made else 0.0
        step = 0.125 if stream else 2.0
        made.append(
            joints
            | {
                "t": start + step * np.arange(len(at)),
                "run": np.full(len(at), len(made)),
                "force": np.repeat(plan.force[chosen[:1]], len(at), axis=0),
            }
        )
    columns = {name: np.concatenate([run[name] for run in made])[:rows] for name in made[0]}
    table = replace(plan, **columns, position=None, quaternion=None, row=np.arange(rows) + 2)
    return robot, simulation.simulate(true, table, "jitter", steps=2)


def measured(kind: str, rows: int) -> dict:
    """Seconds and megabytes of one case, the making of the readings not counted as time."""
    from ctcr.diagnose.pipeline import diagnose
    from ctcr.fit import joint

    robot, readings = session(kind, rows)
    began = perf_counter()
    if kind == "fit":
        fit = joint.fit(robot, readings)
        said = f"{len(fit.names)} parameters, {fit.status}, chi-square {fit.reduced_chi_square:.3f}"
    else:
        result = diagnose(robot, readings)
        said = f"{result.verdict.word} {' '.join(a.id for a in result.accepted)}".rstrip()
    return {
        "seconds": perf_counter() - began,
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "said": said,
    }


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--long", action="store_true", help="a diagnosis of 20 000 rows too: minutes")
    options.add_argument("--case", nargs=2, metavar=("KIND", "ROWS"), help="one case, as JSON")
    given = options.parse_args()
    if given.case:
        print(json.dumps(measured(given.case[0], int(given.case[1]))))
        return
    print(f"{'':16} {'rows':>7} {'s':>8} {'ms a row':>9} {'MB':>6}")
    for kind, rows in CASES + (LONG if given.long else []):
        command = [sys.executable, __file__, "--case", kind, str(rows)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(done.stderr)
        found = json.loads(done.stdout.splitlines()[-1])
        print(
            f"{kind:16} {rows:7d} {found['seconds']:8.2f} {1e3 * found['seconds'] / rows:9.2f} "
            f"{found['megabytes']:6.0f}  {found['said']}",
            flush=True,
        )


if __name__ == "__main__":
    main()
