"""How often `ctcr compare` names wrong conventions right, and none where there is none, on random robots.

Sessions of the model and of the oracle: robots with one to four tubes, with and without smooth errors of the field,
hidden effects, loads, wrong data sheets and orientations, in few and many rows. Of four one has no fault, one has one,
one has two, one has one in some of its runs alone. Even seeds are for tuning, odd ones for reporting. Writes
docs/convention_study.md with --keep.
"""

import argparse
import os
import sys
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # the matrices are too small for more
    os.environ.setdefault(_threads, "1")

import numpy as np  # noqa: E402
from origin import ROOT, written_by  # noqa: E402
from score import wilson  # noqa: E402

sys.path[:0] = [str(ROOT / "tests" / "python" / "support"), str(ROOT / "tools" / "oracle")]

KEPT = ROOT / "docs" / "convention_study.md"
SAME_ERROR = 1.1  # of a corrected table over that of the right one: another 10 % is the chance of a calibration
FROM_ORACLE = 0.25  # fraction of the sessions
ORACLE_EFFECTS = ("backlash_rotation", "tip_load", "sensor_offset", "clearance", "periodic_rotation", "frame_jump")
HALVES = ("tuning", "reporting")
ASKED = ((0, False), (1, False), (2, False), (1, True))  # faults, and whether of some runs alone
OF_RUNS_ALONE = ", of some runs alone"


@dataclass(frozen=True)
class Answer:
    """What is wrong in a session, and what was named there."""

    seed: int
    about: str
    wrong: tuple[str, ...]  # kinds
    named: bool  # all that is wrong and nothing else, by kind, columns and runs
    mended: float  # error of the corrected table over that of the right one
    said: tuple[str, ...]

    @property
    def right(self) -> bool:
        return self.named and self.mended < SAME_ERROR


def oracle_case(random: np.random.Generator):
    """A right session of the oracle; None where there is none: no equilibrium, or tubes that cannot stand so."""
    from benches import ROBOTS
    from ctcr.robot import robot_file
    from ctcr.table import measurements
    from kernel import NoEquilibriumError
    from make_set import NOISES, Order, write_set
    from session import Habit
    from wrong_conventions import Case

    effect = random.choice([None, *ORACLE_EFFECTS])
    order = Order(
        effects=() if effect is None else ((str(effect), 1.0),),
        seed=int(random.integers(2**31)),
        noise=str(random.choice(NOISES)),
        robot=str(random.choice(ROBOTS)),
        habit=Habit(loads=bool(random.integers(2))),
        wrong_sheet=bool(random.random() < 0.25),
    )
    with TemporaryDirectory() as folder:
        try:
            write_set(order, Path(folder) / "set", Path(folder) / "truth.yaml")
        except (NoEquilibriumError, ValueError):
            return None
        robot = robot_file.load(Path(folder) / "set" / "robot.yaml")
        return Case(robot, measurements.load(Path(folder) / "set" / "measurements.csv", robot.n_tubes), str(order))


def judge(seed: int) -> Answer:
    """The answer on the session of a seed."""
    from ctcr.conventions import review
    from wrong_conventions import DRAWN, OF_RUNS, faults, in_some_runs, mended, right_case, spoiled

    random, (number, of_runs) = np.random.default_rng([31, seed]), ASKED[seed // 2 % len(ASKED)]
    kinds = [*(OF_RUNS if of_runs else DRAWN)]
    draw, first = right_case if random.random() > FROM_ORACLE else oracle_case, kinds[seed // 8 % len(kinds)]
    others = random.permutation([kind for kind in kinds if kind != first]).tolist()

    def drawn(case):
        if of_runs:
            return [*filter(None, [in_some_runs(random, case, first)])]
        return faults(random, case, [first, *others])[:number]

    while (case := draw(random)) is None or len(wrong := drawn(case)) < number:
        pass  # no equilibrium, or no room for such faults
    bad = spoiled(case, wrong)
    found = review(bad.robot, bad.readings)
    named = len(found.findings) == len(wrong) and all(any(map(one.agrees, found.findings)) for one in wrong)
    texts = (f"{' '.join((one.kind, *one.columns))} {one.runs or ''}".strip() for one in wrong)
    about = f"{case.about}: {'; '.join(texts) or 'nothing wrong'}"
    said = tuple(one.sentence for one in found.findings)
    kinds = tuple(one.kind + OF_RUNS_ALONE * of_runs for one in wrong)
    return Answer(seed, about, kinds, named, mended(case, found), said)


def study(seeds: Iterable[int], tell=print) -> Iterator[Answer]:
    """The answers on the sessions of some seeds; tells of those that are not right."""
    with ProcessPoolExecutor() as pool:
        for answer in pool.map(judge, seeds):
            if not answer.right:
                tell(
                    f"{answer.seed}: {answer.about}; error of the corrected table x {answer.mended:.2f}",
                    *answer.said,
                    sep="\n    ",
                )
            yield answer


def summary(answers: list[Answer]) -> str:
    """As Markdown."""
    lines = [
        f"# Wrong conventions in {len(answers)} sessions of random robots",
        "",
        "Robots of one to four tubes; with and without the tracker's smooth field error and outliers, hidden effects,",
        "loads, wrong data sheets and orientations; 1 to 12 runs of 14 or 28 rows. Three of four sessions are of the",
        "library's own model, the others of the independent oracle (`tools/oracle`). Named: what is wrong and nothing",
        "else, by kind, columns and runs. Corrected: and the corrected table has the error of the right one. With the",
        "95 % Wilson interval.",
        written_by("tools/convention_study.py --keep"),
    ]
    for part, half in enumerate(HALVES):
        mine = [one for one in answers if one.seed % 2 == part]
        lines += ["", f"## {half.capitalize()} half", "", "| wrong | named | named and corrected |", "|---|---|---|"]
        groups = {"nothing": [one for one in mine if not one.wrong]}
        groups |= {
            "one": [one for one in mine if len(one.wrong) == 1 and not one.wrong[0].endswith(OF_RUNS_ALONE)],
            "two": [one for one in mine if len(one.wrong) == 2],
            "one, of some runs alone": [one for one in mine if one.wrong and one.wrong[0].endswith(OF_RUNS_ALONE)],
        }
        for kind in sorted({kind for one in mine for kind in one.wrong}):
            name = kind if kind.endswith(OF_RUNS_ALONE) else f"{kind}, alone or with another"
            groups[name] = [one for one in mine if kind in one.wrong]
        for name, group in groups.items():
            hits = [wilson(sum(getattr(one, what) for one in group), len(group)) for what in ("named", "right")]
            lines.append(f"| {name} | {' | '.join(hits)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sessions", type=int, default=800)
    parser.add_argument("--half", choices=HALVES, help="this half alone")
    parser.add_argument("--keep", action="store_true")
    given = parser.parse_args()
    seeds = [seed for seed in range(given.sessions) if given.half in (None, HALVES[seed % 2])]
    text = summary(list(study(seeds)))
    print(text)
    if given.keep:
        KEPT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
