"""One measurement set with something hidden in it, and its answer in another folder.

    python tools/oracle/make_set.py --effect softening --size 1 --seed 3 --noise jitter --robot table2 --out FOLDER

writes FOLDER/robot.yaml (the bench as described, not as it is), FOLDER/measurements.csv, and the answer to
FOLDER/../truth/NAME.yaml (elsewhere with --truth).
"""

import argparse
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from benches import DRAWN, ROBOTS, describe, joint_range
from detectable import THINNED, Calibration, calibration_of, detectability, thinned
from hidden import hide
from hidden_cause import CAUSES, Truth
from mechanics import Mechanics
from robot import from_description
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation
from session import Habit, Noise, Plan, Setup, draw_noise, draw_plan, run_session
from simulate import Bench, draw_bench
from tables import POSE, pose_fields, write_robot, write_table

NOISES = ("jitter", "realistic")
WRONG_SHEET_MARGIN = 12e-3  # [m] between ends of tubes whose lengths and homes are wrong by far
DESIGN = 1000  # part of the seed that draws a robot: beyond those of the hidden causes


@dataclass(frozen=True)
class Order:
    """What to measure. The same order always gives the same set."""

    effects: tuple[tuple[str, float], ...]  # name and size
    seed: int
    noise: str = "jitter"
    robot: str = "table2"
    habit: Habit = field(default_factory=Habit)
    modulus_scatter: float = 1.0  # of the true moduli, relative to what the description promises
    wrong_sheet: bool = False  # whether the description is wrong by far more than it says

    def __post_init__(self) -> None:
        if any(CAUSES[name].streamed for name, _ in self.effects):
            object.__setattr__(self, "habit", replace(self.habit, stream=True, scattered=False))


@dataclass(frozen=True)
class Session:
    """A measured set. Poses are in the tracker frame."""

    description: dict
    bench: Bench
    plan: Plan
    position: np.ndarray  # (R, 3) [m] without noise
    rotation: Rotation  # (R) without noise
    noise: Noise
    truths: list[Truth]

    def rows(self) -> list[list[float]]:
        """Rows (t, run, joints, force, pose) of the table."""
        position = self.position + self.noise.position + self.noise.field_position
        rotation = Rotation.from_rotvec(self.noise.rotation + self.noise.field_rotation) * self.rotation
        force = self.plan.mass[:, None] * np.array(self.description["gravity"])
        leading = zip(self.plan.time, self.plan.run, self.plan.joints, force, strict=True)
        return [
            [time, run, *joints, *load, *pose_fields(place, turn)]
            for (time, run, joints, load), place, turn in zip(leading, position, rotation.as_matrix(), strict=True)
        ]


def measure(order: Order, *, even: bool = False) -> Session:
    """Simulate the session. Bench, plan, noise and hidden causes are drawn apart: with other causes the rest stays.

    even: without the chance in what is hidden (readings that lag unequally), which is noise to every model.
    """
    bench_rng, plan_rng, noise_rng, *hidden_rng = (
        np.random.default_rng([order.seed, part]) for part in range(3 + len(order.effects))
    )
    description = describe(order.robot, np.random.default_rng([order.seed, DESIGN]))
    allowed = joint_range(description)
    if order.wrong_sheet and order.robot in DRAWN:  # the others were chosen so that theirs is enough
        allowed = replace(allowed, margin=WRONG_SHEET_MARGIN)
    plan = draw_plan(allowed, plan_rng, order.habit)
    promised = description | {"uncertainty": dict(description["uncertainty"])}
    promised["uncertainty"]["youngs_modulus_percent"] *= order.modulus_scatter
    bench = draw_bench(promised, bench_rng, wrong=order.wrong_sheet)
    setup = Setup(bench, plan, Mechanics(from_description(bench.description)))
    truths = [hide(setup, name, size, rng) for (name, size), rng in zip(order.effects, hidden_rng, strict=True)]
    if even:
        setup.lag_noise = Setup.lag_noise
    poses = list(run_session(setup))
    position, rotation = np.array([p for p, _ in poses]), Rotation.concatenate([r for _, r in poses])
    noise = draw_noise(description["tracker"], position, order.noise, noise_rng)
    return Session(description, bench, plan, position, rotation, noise, truths)


def answer(order: Order, session: Session) -> dict:
    """The content of the truth file."""
    few = thinned(session.plan)
    plain = list(run_session(Setup(session.bench, few, Mechanics(from_description(session.bench.description)))))
    moved = session.position[::THINNED] - np.array([position for position, _ in plain])
    turned = session.rotation[::THINNED] * Rotation.concatenate([rotation for _, rotation in plain]).inv()
    inliers = ~session.noise.outlier
    calibration = calibration_of(session.bench, few)
    left = detectability(calibration, session.description["tracker"], order.noise, moved, turned)
    alone = [left.chi_square] if len(order.effects) == 1 else _each_alone(order, session, calibration)
    ids = {name: CAUSES[name].ids for name, _ in order.effects}
    in_catalogue = sorted({i for name in ids for i in ids[name]})
    missing = [name for name in ids if not CAUSES[name].absorbed]
    strange = [name for name in missing if not ids[name]]
    uneven = any(CAUSES[name].uneven for name in ids)
    return {
        "verdict": "not_in_catalogue" if strange else "identified" if in_catalogue else "nothing_missing",
        "classes": in_catalogue,
        "causes": [
            {"name": name, "ids": list(ids[name]), "size": size, "chi_square": chi_square, "values": _plain(truth)}
            for (name, size), chi_square, truth in zip(order.effects, alone, session.truths, strict=True)
        ],
        "robot": order.robot,
        "noise": order.noise,
        "seed": order.seed,
        "half": "reporting" if order.seed % 2 else "tuning",
        "wrong_sheet": order.wrong_sheet,
        "loads": order.habit.loads,
        "streamed": order.habit.stream,
        "scattered": order.habit.scattered,
        "orientation": order.habit.orientation,
        "rows": len(session.plan.time),
        "outliers": np.flatnonzero(session.noise.outlier).tolist(),
        "rms_mm": {
            "effect": _rms_mm(moved),
            "effect_after_calibration": left.after_calibration_mm,
            "jitter": _rms_mm(session.noise.position[inliers]),
            "field": _rms_mm(session.noise.field_position),
            "chance": _rms_mm(session.position - measure(order, even=True).position) if uneven else 0.0,
        },
        "chi_square_after_calibration": left.chi_square,
        "bench": bench_facts(session.bench),
    }


def _each_alone(order: Order, session: Session, calibration: Calibration) -> list[float]:
    """Chi-square after calibration of what each cause adds to the others."""
    tracker, out = session.description["tracker"], []
    for k in range(len(order.effects)):
        others = tuple((name, size if j != k else 0.0) for j, (name, size) in enumerate(order.effects))
        without = measure(replace(order, effects=others))
        moved = (session.position - without.position)[::THINNED]
        turned = session.rotation[::THINNED] * without.rotation[::THINNED].inv()
        out.append(detectability(calibration, tracker, order.noise, moved, turned).chi_square)
    return out


def bench_facts(bench: Bench) -> dict:
    """What is really there, as truth files hold it."""
    return {
        "tubes": bench.description["tubes"],
        "beta_offset_m": bench.beta_offset.tolist(),
        "alpha_offset_rad": bench.alpha_offset.tolist(),
        "tracker_position_m": bench.tracker_position.tolist(),
        "tracker_rotation_vector_rad": bench.tracker_rotation.as_rotvec().tolist(),
    }


def _rms_mm(error: np.ndarray) -> float:
    return float(1e3 * np.sqrt(np.mean(np.sum(error**2, axis=1))))


def _plain(truth: Truth) -> dict:
    return {key: np.asarray(value).tolist() for key, value in truth.items()}


def write_set(order: Order, folder: Path, truth: Path) -> dict:
    """Write the set and its answer; the answer last, so that where it is the set is whole. Returns the answer."""
    session = measure(order)
    n_tubes = len(session.description["tubes"])
    write_robot(folder / "robot.yaml", session.description)
    pose = POSE if order.habit.orientation else POSE[:3]
    write_table(folder / "measurements.csv", session.rows(), n_tubes, ("force",), ("t_s", "run"), pose)
    content = answer(order, session)
    truth.parent.mkdir(parents=True, exist_ok=True)
    unfinished = truth.with_suffix(".unfinished")
    with unfinished.open("w", encoding="utf-8") as file:
        YAML(typ="safe").dump(content, file)
    os.replace(unfinished, truth)
    return content


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--effect", action="append", default=[], choices=sorted(CAUSES), help="may be repeated")
    parser.add_argument("--size", action="append", default=[], type=float, help="one for each effect; 1 if left out")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--noise", choices=NOISES, default="jitter")
    parser.add_argument("--robot", choices=(*ROBOTS, *DRAWN), default="table2", help="drawn3: a random one of 3 tubes")
    parser.add_argument("--runs", type=int, default=Habit.runs)
    parser.add_argument("--stops", type=int, default=Habit.stops, help="of a run on the way out")
    parser.add_argument("--loads", action=argparse.BooleanOptionalAction, default=True, help="hung masses")
    parser.add_argument("--stream", action="store_true", help="readings in motion, as a delay needs them")
    parser.add_argument("--scattered", action="store_true", help="random places instead of paths out and back")
    parser.add_argument("--orientation", action=argparse.BooleanOptionalAction, default=True, help="of the sensor")
    parser.add_argument("--wrong-sheet", action="store_true", help="robot.yaml is wrong by far more than it says")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--truth", type=Path)
    given = parser.parse_args(arguments)
    sizes = given.size or [1.0] * len(given.effect)
    if len(sizes) != len(given.effect):
        parser.error(f"{len(given.effect)} effects but {len(sizes)} sizes")
    effects = tuple(zip(given.effect, sizes, strict=True))
    habit = Habit(given.runs, given.stops, given.loads, given.stream, given.scattered, given.orientation)
    order = Order(effects, given.seed, given.noise, given.robot, habit, wrong_sheet=given.wrong_sheet)
    truth = given.truth or given.out.parent / "truth" / f"{given.out.name}.yaml"
    content = write_set(order, given.out, truth)
    print(f"{given.out}: {content['rows']} rows; effect {content['rms_mm']['effect']:.3f} mm RMS; answer in {truth}")


if __name__ == "__main__":
    main()
