"""The whole suite of sets with hidden causes, for scoring: every set fixed by this table, whole or absent on disk.

    python tools/oracle/make_suite.py [--out build/suite] [--only GROUP] [--jobs 2] [--shift K]

writes FOLDER/s001/robot.yaml and measurements.csv (nothing there tells what is hidden), FOLDER/truth/s001.yaml and
FOLDER/truth/index.csv. Run again, it makes what is missing. Even seeds are for tuning, odd ones for reporting.

Who has looked at the scores of a suite can no longer judge by it: --shift K adds 10000 K to all seeds, and makes
another one of the same kinds.
"""

import argparse
import csv
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import count, cycle
from pathlib import Path
from time import monotonic

for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # the matrices are too small for more
    os.environ.setdefault(_threads, "1")

import numpy as np  # noqa: E402
from hidden import CAUSES  # noqa: E402
from kernel import NoEquilibriumError  # noqa: E402
from make_set import Order, write_set  # noqa: E402
from session import Habit  # noqa: E402

SUITE = Path(__file__).resolve().parents[2] / "build" / "suite"
SIZES = (0.5, 1.0, 2.0)
EFFECTS = tuple(
    (
        "friction backlash_rotation backlash_translation delay tip_load precurvature_profile softening anisotropy "
        "straight_curvature clearance torsional_compliance sensor_offset field_distortion frame_drift frame_jump "
        "periodic_rotation periodic_translation entry_compliance entry_clearance helical_precurvature contact"
    ).split()
)
LATER_EFFECTS = ("creep",)  # their sets are the last, so that the names of the others stay
# The realistic noise contains a distorted field, so that a further one is no question there.
REALISTIC_EFFECTS = tuple(name for name in EFFECTS if name != "field_distortion")
SEPARABLE_PAIRS = (
    ("friction", "tip_load"),
    ("delay", "clearance"),
    ("softening", "precurvature_profile"),
    ("friction", "softening"),
    ("anisotropy", "sensor_offset"),
    ("entry_compliance", "frame_drift"),
    ("backlash_rotation", "tip_load"),
    ("clearance", "sensor_offset"),
    ("straight_curvature", "backlash_rotation"),
    ("frame_jump", "entry_clearance"),
    ("contact", "friction"),
    ("helical_precurvature", "periodic_rotation"),
)
ALIASED_PAIRS = (
    ("shear_stiffness", "drive_compliance"),
    ("tip_mass", "tip_force"),
    ("translation_ratio", "bending_plane"),
    ("tracker_yaw", "bending_plane"),
    ("tip_load", "bending_plane"),
    ("drive_compliance", "translation_ratio"),
)
# A cause and its look-alike, with the same bench, plan and noise: the same answer is right.
LOOK_ALIKES = (("shear_stiffness", "drive_compliance"), ("tip_mass", "tip_force"), ("bending_plane", "tracker_yaw"))
UNLOADED_LOOK_ALIKES = ("entry_compliance", "entry_clearance")
STRANGE = (
    "rotation_with_translation",
    "material_hysteresis",
    "cable_pull",
    "temperature",
    "plate_vibration",
    "insertion_stick_slip",
    "tooth_error",
    "load_not_as_known",
    "grip_slip",
)
WRONG_SHEETS = (
    (),
    ("friction",),
    ("backlash_rotation",),
    ("softening",),
    ("sensor_offset",),
    ("tip_load",),
    ("torsional_compliance",),
    ("entry_compliance",),
    ("precurvature_profile",),
    ("friction", "tip_load"),
)
# Causes that exclude each other: at most one of each group acts. Tubes in bores take no other mechanical cause yet.
IN_BORES = (
    "friction softening anisotropy clearance torsional_compliance entry_compliance entry_clearance contact "
    "precurvature_profile straight_curvature helical_precurvature"
).split()
EXCLUSIVE = (
    ("precurvature_profile", "straight_curvature", "helical_precurvature"),
    ("entry_compliance", "entry_clearance"),
    ("softening", "anisotropy"),  # a section of the oracle has one law
    *(("loose_bores", name) for name in IN_BORES),
)
OF_SEVERAL_TUBES = ("friction", "clearance", "loose_bores", "torsional_compliance")
# Runs and stops of each: 28 to 1000 rows on paths, 40 to 400 scattered.
PATHS, SCATTERED = ((12, 14), (1, 14), (3, 20), (25, 20), (6, 10)), ((1, 40), (1, 120), (8, 25), (10, 40), (4, 15))
VARIED = 48
ROBOTS = ("table2", "B", "table2", "two_tubes", "table2", "four_tubes", "table2", "B", "table2")  # in turn


@dataclass(frozen=True)
class Entry:
    """One set of the suite."""

    name: str
    group: str
    order: Order


def orders(shift: int = 0) -> Iterator[tuple[str, Order]]:
    """(group, order) of every set. New ones go to the end, so that the names of the others stay."""
    robots, seeds = cycle(ROBOTS), count(10000 * shift + 1000)

    def order(*effects: tuple[str, float], noise: str = "jitter", seed: int | None = None, **rest: object) -> Order:
        robot = str(rest.pop("robot", None) or next(robots))
        return Order(effects, next(seeds) if seed is None else seed, noise, robot, **rest)

    for name in EFFECTS:
        for size in SIZES:
            for _ in range(2):
                yield "single", order((name, size))
    for noise, n in (("jitter", 12), ("realistic", 12)):
        for k in range(n):
            scatter = 1.35 if k in (4, 5) else 1.0
            habit = Habit(loads=k not in (6, 7), stream=k == 11)
            yield "control", order(noise=noise, modulus_scatter=scatter, habit=habit)
    for k, name in enumerate(REALISTIC_EFFECTS):
        for n, size in enumerate(SIZES):
            seed = 10000 * shift + 3000 + 10 * k + 2 * n + (k + n) % 2
            yield "single", order((name, size), noise="realistic", seed=seed)
    for noise in ("jitter", "realistic"):
        for pair in SEPARABLE_PAIRS:
            yield "pair", order(*((name, 1.0) for name in pair), noise=noise)
    for pair in ALIASED_PAIRS:
        yield "aliased_pair", order(*((name, 1.0) for name in pair))
    for alike in LOOK_ALIKES:
        for _ in range(2):
            seed = next(seeds)
            for name in alike:
                yield "look_alike", order((name, 1.5), seed=seed, robot="table2")
    for name in UNLOADED_LOOK_ALIKES:
        for _ in range(2):
            yield "look_alike", order((name, 1.0), habit=Habit(loads=False))
    for noise in ("jitter", "realistic"):
        for name in STRANGE:
            yield "strange", order((name, 1.0), noise=noise)
    for noise in ("jitter", "realistic"):
        for hidden in WRONG_SHEETS:
            for _ in range(2):
                yield "wrong_sheet", order(*((name, 1.0) for name in hidden), noise=noise, wrong_sheet=True)
    for noise in ("jitter", "realistic"):
        for share_of_gap in (0.1, 0.3, 1.0):
            for _ in range(2):
                yield "fuller_model", order(("loose_bores", share_of_gap), noise=noise)
    for _ in range(VARIED):
        yield "varied", varied(next(seeds))
    for noise in ("jitter", "realistic"):
        for name in LATER_EFFECTS:
            for size in SIZES:
                for _ in range(2):
                    yield "single", order((name, size), noise=noise)


def varied(seed: int) -> Order:
    """Anything that a laboratory may bring: any robot, any way to measure, none to five causes of any size."""
    rng = np.random.default_rng([seed, 77])
    n_tubes = int(rng.integers(1, 5))
    scattered = bool(rng.random() < 0.5)
    runs, stops = (SCATTERED if scattered else PATHS)[rng.integers(5)]
    loads, orientation = bool(rng.random() < 0.7), bool(rng.random() < 0.7)
    noise = ("jitter", "realistic")[rng.integers(2)]
    possible = [name for name in (*EFFECTS, "loose_bores") if n_tubes > 1 or name not in OF_SEVERAL_TUBES]
    if scattered:
        possible.remove("delay")
    if noise == "realistic":
        possible.remove("field_distortion")
    chosen: list[str] = []
    for name in rng.permutation(possible)[: rng.choice(6, p=(0.2, 0.3, 0.2, 0.1, 0.1, 0.1))].tolist():
        if not any(name in rivals and not set(rivals).isdisjoint(chosen) for rivals in EXCLUSIVE):
            chosen.append(name)
    effects = tuple((name, float(np.exp(rng.uniform(np.log(0.5), np.log(2.0))).round(2))) for name in chosen)
    habit = Habit(runs, stops, loads, scattered=scattered, orientation=orientation)
    return Order(effects, seed, noise, f"drawn{n_tubes}", habit, wrong_sheet=bool(rng.random() < 0.2))


def entries(shift: int = 0) -> list[Entry]:
    """The suite. Names say nothing about what is hidden."""
    return [Entry(f"s{k:03d}", group, order) for k, (group, order) in enumerate(orders(shift), start=1)]


def make(entry: Entry, folder: Path) -> tuple[str, str]:
    """Make one set; its name, and what went wrong or nothing. A drawn robot without an equilibrium gives no set."""
    try:
        write_set(entry.order, folder / entry.name, _truth(entry, folder))
    except NoEquilibriumError:
        return entry.name, "" if entry.group == "varied" else "no equilibrium was found"
    except Exception as error:  # one set that cannot be made must not lose the others
        return entry.name, f"{type(error).__name__}: {error}"
    return entry.name, ""


def _truth(entry: Entry, folder: Path) -> Path:
    return folder / "truth" / f"{entry.name}.yaml"


def write_index(folder: Path, suite: Sequence[Entry]) -> None:
    """truth/index.csv: what is in which set."""
    path = folder / "truth" / "index.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".unfinished")
    with unfinished.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("set", "group", "effects", "sizes", "noise", "robot", "seed", "half", "loads", "streamed"))
        for entry in suite:
            order = entry.order
            names, sizes = zip(*order.effects, strict=True) if order.effects else ((), ())
            half = "reporting" if order.seed % 2 else "tuning"
            writer.writerow(
                (
                    entry.name,
                    entry.group,
                    "+".join(names),
                    "+".join(map(str, sizes)),
                    order.noise,
                    order.robot,
                    order.seed,
                    half,
                    int(order.habit.loads),
                    int(order.habit.stream),
                )
            )
    os.replace(unfinished, path)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=SUITE)
    parser.add_argument("--only", action="append", help="a group; may be repeated")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--shift", type=int, default=0, help="other seeds; needs another folder")
    given = parser.parse_args(arguments)
    suite = entries(given.shift)
    write_index(given.out, suite)
    wanted = [entry for entry in suite if not given.only or entry.group in given.only]
    missing = [entry for entry in wanted if not _truth(entry, given.out).exists()]
    missing.sort(key=lambda entry: any(CAUSES[name].slow for name, _ in entry.order.effects))
    start, failed = monotonic(), []
    with ProcessPoolExecutor(given.jobs) as pool:
        jobs = [pool.submit(make, entry, given.out) for entry in missing]
        for done, job in enumerate(as_completed(jobs), start=len(wanted) - len(missing) + 1):
            name, problem = job.result()
            if problem:
                failed.append(name)
                print(f"\n{name}: {problem}")
            print(f"\r{done} of {len(wanted)} sets, {monotonic() - start:.0f} s", end="", flush=True)
    print(f"\n{len(wanted) - len(failed)} sets in {given.out}" + (f"; failed: {' '.join(failed)}" if failed else ""))
    if failed:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
