"""How often `ctcr calibrate fit` finds the truth within two of its standard deviations, on random robots of the oracle.

Each robot has a data sheet of its own, differs from it by normal draws of all of the stated uncertainties, and hides
no effect. Half of the sets have the noise of single readings alone, half the tracker's smooth field error and outliers
too. Sets are kept in build/calibration_study, so that an interrupted study goes on. Writes docs/calibration_study.md
with --keep.
"""

import argparse
import os
import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # the matrices are too small for more
    os.environ.setdefault(_threads, "1")

import numpy as np  # noqa: E402
from coverage import truth_of  # noqa: E402
from origin import ROOT, written_by  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402
from score import wilson  # noqa: E402

sys.path.insert(0, str(ROOT / "tools" / "oracle"))

SETS = ROOT / "build" / "calibration_study"
KEPT = ROOT / "docs" / "calibration_study.md"
NOISES = ("jitter", "realistic")
WIDTH = 2.0  # sd
# Of a data sheet, about those of a bench.
SIZES = {"length_mm": 0.06, "curved_length_mm": 0.2, "curvature_per_m": 0.25}
MODULUS = (40.0, 80.0)  # [GPa]


@dataclass(frozen=True)
class Answer:
    """What a calibration said of one robot."""

    noise: str
    pulls: dict[str, float]  # error over sd by parameter
    held_out_mm: float
    floor_mm: float
    chi_square: float


def description(robot: str, rng: np.random.Generator) -> dict[str, Any]:
    """A data sheet that no other robot has."""
    from benches import describe

    sheet = describe(robot)
    scale = 1 + SIZES["length_mm"] * rng.uniform(-1, 1)  # of all tubes: nested ones keep their order
    for i, tube in enumerate(sheet["tubes"]):
        grasped = sheet["actuation"]["home_translation_mm"][i]
        tube["length_mm"] = round(scale * (tube["length_mm"] + grasped) - grasped, 1)
        for key in ("curved_length_mm", "curvature_per_m"):
            tube[key] = round(tube[key] * (1 + SIZES[key] * rng.uniform(-1, 1)), 1)
        tube["youngs_modulus_GPa"] = round(rng.uniform(*MODULUS), 1)
    sheet["name"] = f"random_{robot}"
    return sheet


def make(number: int) -> Path:
    """The set of a number, from the disk where it is; its folder."""
    from benches import ROBOTS, joint_range
    from make_set import Session, bench_facts
    from mechanics import Mechanics
    from robot import from_description
    from ruamel.yaml import YAML
    from session import Habit, Setup, draw_noise, draw_plan, run_session
    from simulate import SHARE_OF_UNCERTAINTY, draw_bench
    from tables import write_robot, write_table

    folder = SETS / f"{number:03d}"
    if (folder / "truth.yaml").exists():
        return folder
    rng = np.random.default_rng([77, number])
    sheet = description(ROBOTS[number % len(ROBOTS)], rng)
    wide = {key: value / SHARE_OF_UNCERTAINTY for key, value in sheet["uncertainty"].items()}
    bench = draw_bench(sheet | {"uncertainty": wide}, rng)
    plan = draw_plan(joint_range(sheet), rng, Habit())
    poses = list(run_session(Setup(bench, plan, Mechanics(from_description(bench.description)))))
    position, rotation = np.array([p for p, _ in poses]), Rotation.concatenate([r for _, r in poses])
    kind = NOISES[number // len(ROBOTS) % 2]
    noise = draw_noise(sheet["tracker"], position, kind, rng)
    session = Session(sheet, bench, plan, position, rotation, noise, [])
    write_robot(folder / "robot.yaml", sheet)
    write_table(folder / "measurements.csv", session.rows(), len(sheet["tubes"]), ("force",), ("t_s", "run"))
    truth = {"noise": kind, "bench": bench_facts(bench), "causes": []}
    unfinished = folder / "truth.unfinished"
    with unfinished.open("w", encoding="utf-8") as file:
        YAML(typ="safe").dump(truth, file)
    os.replace(unfinished, folder / "truth.yaml")
    return folder


def _truth(answers: dict[str, Any], robot: Any) -> dict[str, float]:
    """True values by the name of the parameter, SI; homes and the turn of the tracker against those of the file."""
    bench, nominal = answers["bench"], Rotation.from_rotvec(robot.tracker.rotation_vector_rad)
    turn = (Rotation.from_rotvec(bench["tracker_rotation_vector_rad"]) * nominal.inv()).as_rotvec()
    true = truth_of(answers)
    for kind, values in (("position", bench["tracker_position_m"]), ("rotation", turn)):
        true |= {f"tracker.{kind}.{axis}": float(value) for axis, value in zip("xyz", values, strict=True)}
    return true


def judge(number: int) -> Answer:
    """Makes a set where it is missing, calibrates, and compares with the truth."""
    from ctcr.calibrate import joint_fit
    from ctcr.robot import robot_file
    from ctcr.table import measurements
    from ruamel.yaml import YAML

    folder = make(number)
    robot = robot_file.load(folder / "robot.yaml")
    table = measurements.load(folder / "measurements.csv", robot.n_tubes)
    found = joint_fit.calibrate(robot, table, ["standard"], halves=False)
    answers, fit = YAML(typ="safe").load((folder / "truth.yaml").read_text()), found.fit
    true = _truth(answers, robot)
    pulls = {}
    for name, value, mean, sd in zip(fit.names, fit.values, fit.prior_mean, fit.sd, strict=True):
        since = mean if name.startswith("actuation.") else 0.0
        pulls[name] = float((value - since - true[name]) / sd)
    held = found.held_out
    return Answer(answers["noise"], pulls, held.error.rms_mm, held.floor.rms_mm, float(fit.reduced_chi_square))


def study(count: int, jobs: int = 2, tell=print) -> list[Answer]:
    """The answers on robots 0 to count - 1."""
    answers = []
    with ProcessPoolExecutor(jobs) as pool:
        for number, answer in enumerate(pool.map(judge, range(count))):
            within = np.mean(np.abs(list(answer.pulls.values())) <= WIDTH)
            tell(
                f"{number:03d} {answer.noise}: {within:.0%} of {len(answer.pulls)} within {WIDTH:g} sd; held out "
                f"{answer.held_out_mm:.3f} mm, floor {answer.floor_mm:.3f} mm"
            )
            answers.append(answer)
    return answers


def within(answers: list[Answer], noise: str) -> tuple[int, int]:
    """True values inside WIDTH standard deviations, of how many."""
    pulls = [p for a in answers if a.noise == noise for p in a.pulls.values()]
    return int(np.sum(np.abs(pulls) <= WIDTH)), len(pulls)


def errors_mm(answers: list[Answer], noise: str) -> tuple[float, float]:
    """Held-out and expected error, RMS of all robots with this noise."""
    chosen = [a for a in answers if a.noise == noise]
    held, floor = (
        float(np.sqrt(np.mean(np.square([getattr(a, n) for a in chosen])))) for n in ("held_out_mm", "floor_mm")
    )
    return held, floor


def summary(answers: list[Answer]) -> str:
    """As Markdown."""
    lines = [
        f"# Calibration of {len(answers)} random robots of the oracle, without hidden effects",
        "",
        "Each robot has its own data sheet and differs from it by normal draws of the uncertainty that its file",
        f"states; 336 poses, 12 runs, three weights. Share of true values within {WIDTH:g} standard deviations of",
        "those that `ctcr calibrate fit` finds (95.4 % of a normal distribution), with the 95 % Wilson interval, and",
        "the error on held-out runs over that expected of a right model. `jitter`: noise of single readings;",
        "`realistic`: with the tracker's smooth field error and outliers too.",
        written_by("tools/calibration_study.py --keep"),
        "",
        "| noise | robots | within | mean square error / variance | held out, mm RMS | expected | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for noise in NOISES:
        chosen = [a for a in answers if a.noise == noise]
        pulls = [p for a in chosen for p in a.pulls.values()]
        held, floor = errors_mm(answers, noise)
        lines.append(
            f"| {noise} | {len(chosen)} | {wilson(*within(answers, noise))} | {np.mean(np.square(pulls)):.2f} "
            f"| {held:.3f} | {floor:.3f} | {held / floor:.2f} |"
        )
    lines += ["", "| parameters | noise | within | mean square error / variance |", "|---|---|---|---|"]
    kinds: dict[tuple[str, str], list[float]] = defaultdict(list)
    for a in answers:
        for name, pull in a.pulls.items():
            parts = name.split(".")
            kind = {"tubes": parts[-1], "actuation": parts[1]}.get(parts[0], f"tracker {parts[1]}")
            kinds[kind, a.noise].append(pull)
    for (kind, noise), pulls in sorted(kinds.items()):
        hits = int(np.sum(np.abs(pulls) <= WIDTH))
        lines.append(f"| {kind} | {noise} | {wilson(hits, len(pulls))} | {np.mean(np.square(pulls)):.2f} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", action="store_true")
    given = parser.parse_args()
    text = summary(study(given.robots, given.jobs, partial(print, flush=True)))
    print(text)
    if given.keep:
        KEPT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
