"""What the tools say of real robots that others measured and published.

FOLDER holds a folder for each robot, with robot.yaml and measurements.csv. As a user would do it, a wrong convention is
corrected as `ctcr compare` says; then the robot is compared, calibrated and diagnosed without options. Two further
calibrations have one tracker frame for all runs, and a frame for each run with a sensor of unknown place on the tip.
Answers are kept in build/real_data_study, so that an interrupted study goes on. The data have no licence: they stay
where they are, and only figures of them come here. Writes the table of docs/real_data.md and the picture beside it with
--keep.
"""

import argparse
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # the matrices are too small for more
    os.environ.setdefault(_threads, "1")

import ctcr  # noqa: E402
import numpy as np  # noqa: E402
from ctcr.api.reviewed import reviewed  # noqa: E402
from ctcr.conventions import Review  # noqa: E402
from ctcr.show.output import atomic_writer, write_json  # noqa: E402
from ctcr.show.palette import ERROR, FAINT, GOOD, NOISE  # noqa: E402
from ctcr.show.style import picture  # noqa: E402
from ctcr.show.wording import most, short  # noqa: E402
from origin import ROOT  # noqa: E402

ANSWERS = ROOT / "build" / "real_data_study"
PAGE = ROOT / "docs" / "real_data.md"
PICTURE = PAGE.with_suffix(".svg")
BEGIN, END = "<!-- written by tools/real_data_study.py -->\n", "<!-- end -->\n"
BARS = {  # errors in the answer of a diagnosis
    "robot file": ("nominal", FAINT),
    "calibrated": ("calibrated", ERROR),
    "with the effects found": ("with_effects", GOOD),
    "expected error": ("expected_error_mm", NOISE),
}
DIAGNOSED = {"western_2023": 5}  # every so many readings of a long table, whose diagnosis takes minutes
EXPLANATIONS = 3  # that the table holds
Answer = dict[str, Any]  # `name` of the robot's folder, and what --json writes, by question


def sets(folder: Path) -> list[Path]:
    """The folders of robots in `folder`."""
    return sorted(path.parent for path in folder.glob("*/robot.yaml") if (path.parent / "measurements.csv").exists())


def corrected(folder: Path) -> Review:
    """Robot and table of a folder without wrong conventions, and these."""
    robot = ctcr.load(folder / "robot.yaml")
    return reviewed(robot, ctcr.read(folder / "measurements.csv", robot.n_tubes))


def questions(found: Review, every: int) -> dict[str, Callable[[], Any]]:
    """What is asked of a robot, by name; a diagnosis of one of `every` so many readings."""
    robot, table = found.robot, found.readings
    tracker = robot.tracker.model_copy(update={"sensor_position_mm": None})
    anywhere = robot.model_copy(update={"tracker": tracker})
    return {
        "conventions": lambda: [one.as_dict() for one in found.wrong],
        "compared": lambda: ctcr.compare(robot, table).as_dict(),
        "calibrated": lambda: ctcr.calibrate(robot, table).as_dict(),
        "one_frame": lambda: ctcr.calibrate(robot, table, frame_per_run=False).as_dict(),
        "sensor_anywhere": lambda: ctcr.calibrate(anywhere, table, frame_per_run=True).as_dict(),
        "diagnosed": lambda: ctcr.diagnose(robot, table.rows(slice(None, None, every))).as_dict(),
    }


def study(folder: Path) -> Answer:
    """The answers on one robot, from the disk where they are."""
    answers = ANSWERS / folder.name
    answers.mkdir(parents=True, exist_ok=True)
    found: Answer = {"name": folder.name}
    for name, ask in questions(corrected(folder), DIAGNOSED.get(folder.name, 1)).items():
        target = answers / f"{name}.json"
        if not target.exists():
            write_json(ask(), str(target))
        found[name] = json.loads(target.read_text(encoding="utf-8"))
    return found


def size(answer: Answer, bar: str) -> float:
    """RMS position error [mm] on the held-out readings of the diagnosis."""
    found = answer["diagnosed"]
    return (found | found["rms_mm"])[BARS[bar][0]]


def own_frames(answer: Answer) -> str:
    """Whether each run has a tracker frame of its own."""
    if len(answer["compared"]["runs"]) < 2:
        return "there is one run"
    frames = answer["calibrated"]["frames"]
    if not frames:
        return "no"
    return "yes, and homes" if "home_translation_mm" in frames[0] else "yes"


def again(distance: str) -> Callable[[Answer], str]:
    """The median of a distance over all pairs of runs with the same joints."""

    def cell(answer: Answer) -> str:
        pairs = answer["compared"]["same_joints"]
        return short(float(np.median([pair[distance] for pair in pairs]))) if pairs else "no such runs"

    return cell


def explanations(answer: Answer) -> str:
    """The most probable ones, without those that are as good as impossible."""
    weighed = answer["diagnosed"]["explanations"][:EXPLANATIONS]
    return "; ".join(f"{one['text']} ({most(one['probability'])})" for one in weighed if one["probability"] >= 1e-3)


def verdict(answer: Answer) -> str:
    return f"`{answer['diagnosed']['verdict']}` ({most(answer['diagnosed']['probability'])})"


def calibration(question: str, stage: str) -> Callable[[Answer], str]:
    """The error at a stage of a calibration."""
    return lambda answer: short(answer[question]["rms_mm"][stage])


def diagnosis(bar: str) -> Callable[[Answer], str]:
    return lambda answer: short(size(answer, bar))


ROWS: dict[str, Callable[[Answer], str]] = {
    "readings": lambda answer: str(answer["compared"]["position_mm"]["count"]),
    "runs": lambda answer: str(len(answer["compared"]["runs"])),
    "measured": lambda answer: "position, orientation" if answer["compared"]["angle_deg"] else "position",
    "wrong conventions": lambda answer: "; ".join(one["text"] for one in answer["conventions"]) or "none",
    "robot file, all readings": lambda answer: short(answer["compared"]["position_mm"]["rms"]),
    "calibrated, all readings": calibration("calibrated", "calibrated"),
    "calibrated, held out": calibration("calibrated", "held_out"),
    "a tracker frame for each run": own_frames,
    "one frame for all runs, held out": calibration("one_frame", "held_out"),
    "sensor anywhere on the tip, held out": calibration("sensor_anywhere", "held_out"),
    "diagnosis: robot file": diagnosis("robot file"),
    "diagnosis: calibrated": diagnosis("calibrated"),
    "diagnosis: with the effects found": diagnosis("with the effects found"),
    "sensor jitter, as stated": lambda answer: short(answer["diagnosed"]["sensor_jitter_mm"]),
    "expected error": diagnosis("expected error"),
    "same joints in two runs, apart": again("apart_mm"),
    "the same after a rigid motion": again("moved_mm"),
    "scatter of repeated readings": lambda answer: short(answer["compared"]["noise"]["rms_mm"]),
    "verdict": verdict,
    "explanations": explanations,
}


def summary(answers: list[Answer]) -> str:
    """A column a robot, as Markdown."""
    lines = [["", *(answer["name"] for answer in answers)], ["---"] * (1 + len(answers))]
    lines += [[name, *(cell(answer) for answer in answers)] for name, cell in ROWS.items()]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def draw(figure, answers: list[Answer]) -> None:
    """The errors of each robot on held-out readings, on one linear scale, and the verdict."""
    axes, step = figure.subplots(), len(BARS) + 1
    for k, (bar, (_, colour)) in enumerate(BARS.items()):
        where, length = [i * step + k for i in range(len(answers))], [size(answer, bar) for answer in answers]
        bars = axes.barh(where, length, color=colour, height=0.84, label=bar)
        said = [answer["diagnosed"]["verdict"] if bar == "with the effects found" else "" for answer in answers]
        labels = [f"{short(value)} {word}".rstrip() for value, word in zip(length, said, strict=True)]
        axes.bar_label(bars, labels, padding=3, fontsize=9)
    axes.set_yticks([i * step + (len(BARS) - 1) / 2 for i in range(len(answers))], [a["name"] for a in answers])
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    axes.set_xlabel("RMS position error on held-out readings, mm")
    axes.grid(axis="y", visible=False)
    figure.legend(loc="outside upper center", ncols=len(BARS))


def kept(page: str, table: str) -> str:
    """The page with this table."""
    before, rest = page.split(BEGIN)
    return before + BEGIN + table + END + rest.split(END)[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="with a folder for each robot")
    parser.add_argument("--keep", action="store_true", help="write docs/real_data.md and its picture")
    given = parser.parse_args()
    found = sets(given.folder)
    if not found:
        parser.error(f"{given.folder} holds no folder with robot.yaml and measurements.csv")
    answers = [study(folder) for folder in found]
    table = summary(answers)
    print(table)
    if given.keep:
        PAGE.write_text(kept(PAGE.read_text(encoding="utf-8"), table), encoding="utf-8")
        with atomic_writer(PICTURE) as file:
            file.write(picture(draw, answers, 7.6, 5.2)._repr_svg_())


if __name__ == "__main__":
    main()
