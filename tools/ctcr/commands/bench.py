"""`ctcr bench`: how fast the model is on this machine."""

import os
import time

import click

from ctcr.commands import options

ROWS = 20_000
REPEATS = 5
SECONDS = 1.0  # that a repeat may take: the model gives some configurations up only after many iterations
SAMPLE = 100  # configurations that are timed first, to choose how many a repeat takes


@click.command(name="bench")
@click.argument("robot", type=options.read, required=False)
@options.json
def command(robot: str | None, out) -> None:
    """Time the model on random joints.

    ROBOT is by default the robot of the paper's Table II. The times hold for this machine at this moment: absolute
    times mean nothing across machines. The benchmark of the library itself, beside the paper's method, is
    `tools/dev bench`.

    A robot that is slow to solve gets fewer configurations.

    Example: ctcr bench robot.yaml
    """
    from ctcr.model.model import Model
    from ctcr.robot import robot_file
    from ctcr.robot.table_ii import table_ii

    loaded = robot_file.load(robot, compiled=True) if robot else table_ii()
    model = Model(loaded)
    results = [
        _timed(model, loaded, loads, derivatives, threads)
        for loads in ("none", "tip force")
        for derivatives in (False, True)
        for threads in dict.fromkeys((1, os.cpu_count() or 1))
    ]
    out.write_json({"robot": loaded.name, "rows": ROWS, "results": results})
    rows = [
        [
            result["load"],
            "pose, J, C" if result["derivatives"] else "pose",
            str(result["threads"]),
            f"{result['per_second']:,.0f}",
            f"{result['per_second_and_thread']:,.0f}",
            f"{result['solved_percent']:.1f}",
        ]
        for result in results
    ]
    columns = ["load", "result", "threads", "configurations/s", "per thread", "solved %"]
    out.table(f"{loaded.name}: at most {ROWS} random configurations from a cold start", columns, rows, 2)
    out.say("Best of 5. Absolute times mean nothing across machines.")


def _timed(model, robot, load: str, derivatives: bool, threads: int) -> dict:
    import numpy as np

    random = np.random.default_rng(1)
    beta, alpha = random_joints(robot, ROWS, random)
    force = random.uniform(-0.1, 0.1, (ROWS, 3)) if load == "tip force" else np.zeros((ROWS, 3))

    def solved(rows: int) -> tuple[float, float]:
        """Seconds for the first rows, and the percentage that is solved."""
        start = time.perf_counter()
        answer = model.predict(beta[:rows], alpha[:rows], force[:rows], derivatives=derivatives, threads=threads)
        return time.perf_counter() - start, 100 * float(np.mean(np.asarray(answer.status) == 0))

    rows = min(ROWS, max(SAMPLE, round(SAMPLE * SECONDS / solved(SAMPLE)[0])))
    seconds, percent = zip(*(solved(rows) for _ in range(REPEATS)), strict=True)
    rate = rows / min(seconds)
    return {
        "load": load,
        "derivatives": derivatives,
        "threads": threads,
        "rows": rows,
        "per_second": rate,
        "per_second_and_thread": rate / threads,
        "solved_percent": percent[0],
    }


def random_joints(robot, rows: int, random):
    """Joints (rows, N), (rows, N) [m], [rad] that the robot can reach, uniform in the range that neighbours leave."""
    import numpy as np

    lengths = robot.lengths
    ends = np.empty((rows, robot.n_tubes))  # arc lengths of the tips; beta = end - length
    least = np.zeros(rows)
    for i in reversed(range(robot.n_tubes)):
        most = lengths[i] + (ends[:, i + 1] - lengths[i + 1] if i + 1 < robot.n_tubes else 0.0)
        ends[:, i] = random.uniform(least, np.minimum(most, least + 0.1))
        least = ends[:, i]
    return ends - lengths, random.uniform(-np.pi, np.pi, (rows, robot.n_tubes))
