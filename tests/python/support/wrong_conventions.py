"""Wrong conventions of any kind, drawn at random, put into the table or the robot file of a right session."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from conventions_bench import design, session
from ctcr import settings
from ctcr.conventions import tips
from ctcr.conventions.calibrated import calibrated
from ctcr.conventions.hypotheses import with_frame
from ctcr.conventions.orientation import mirror
from ctcr.conventions.review import Review
from ctcr.effects import catalogue
from ctcr.frames import conjugate, matrix_from_quaternion, of_sensor, product
from ctcr.model.model import Model
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements, group_columns
from scipy.spatial.transform import Rotation

PHYSICS = {  # per tube or not, as a real robot may well have them
    "friction.coefficient": 0.2,
    "backlash_rotation.play": 0.05,
    "tip_load.mass": 2e-3,
    "sensor_offset.x": 1e-3,
    "torsional_compliance.compliance": 1.0,
    "frame_drift.x": 1e-3,
    "straight_curvature.bend_x": 0.2,
}
UNDO = (  # kinds of which two together may be a third: all angles reversed in a mirror are a frame that turned
    {"mirrored", "joint_sign", "frame_wrong"},
    {"frame_inverse", "frame_wrong"},
)


@dataclass(frozen=True)
class Case:
    """A robot file and its readings."""

    robot: Robot
    readings: Measurements
    about: str = ""


@dataclass(frozen=True)
class Fault:
    """What is wrong, as a finding should say it, and how it spoils a case."""

    kind: str
    columns: tuple[str, ...]
    spoil: Callable[[Case], Case]
    runs: tuple[int, ...] = ()

    def agrees(self, finding) -> bool:
        of_runs = () if self.kind == "frozen" else tuple(finding.runs)
        return (finding.kind, sorted(finding.columns), of_runs) == (self.kind, sorted(self.columns), self.runs)


def right_case(random: np.random.Generator, n_tubes: int | None = None) -> Case:
    """A session as a real bench may give it: noise, hidden effect, loads, runs and columns are drawn."""
    n_tubes = n_tubes or int(random.integers(1, 5))
    robot = design(random, n_tubes)
    effect = random.choice([None, None, None, *PHYSICS])

    def hidden(built: Robot) -> Robot:
        if effect is None:
            return built
        identity, values = effect.split(".")[0], catalogue.value_of(built) if built.effects else {}
        names = [name for name in catalogue.names_of(n_tubes) if name.startswith(f"effects.{effect}")]
        values = {name: PHYSICS[effect] * random.uniform(0.5, 1.5) for name in names}
        return catalogue.with_values(built, [identity], values)

    how = {
        "noise": str(random.choice(["jitter", "realistic"])),
        "runs": int(random.choice([1, 3, 8, 8, 12])),
        "stops": int(random.choice([14, 28])),
        "weight": float(random.choice([0.0, 0.1])),
    }
    about = ", ".join([f"{n_tubes} tubes", *(f"{key} {value}" for key, value in how.items()), str(effect)])
    case = Case(robot, session(robot, random, hidden=hidden, **how), about)
    if random.random() < 0.2:
        case = replace(case, readings=replace(case.readings, quaternion=None), about=f"{case.about}, positions only")
    return wrong_sheet(case, random) if random.random() < 0.25 else case


def wrong_sheet(case: Case, random: np.random.Generator) -> Case:
    """A robot file that is wrong by many of its standard deviations: curvature 18 %, E 30 %, homes 8 deg, frame 8 mm
    and 5 deg."""
    robot, readings = case.robot, case.readings
    signs = random.choice([-1, 1], (5, max(3, robot.n_tubes)))
    curvature, modulus, home, place, tilt = signs * random.uniform(0.5, 1, signs.shape)
    tubes = [
        tube.model_copy(
            update={
                "curvature_per_m": tube.curvature_per_m * (1 + 0.18 * curvature[i]),
                "youngs_modulus_GPa": tube.youngs_modulus_GPa * (1 + 0.3 * modulus[i]),
            }
        )
        for i, tube in enumerate(robot.tubes)
    ]
    turn = Rotation.from_rotvec(np.deg2rad(3) * tilt[:3]).as_matrix()
    moved = with_frame(robot, turn @ robot.tracker.rotation, robot.tracker.position + 5e-3 * place[:3])
    turned = replace(readings, alpha=readings.alpha + np.deg2rad(8) * home[: robot.n_tubes])
    return Case(moved.model_copy(update={"tubes": tubes}), turned, f"{case.about}, wrong sheet")


def faults(random: np.random.Generator, case: Case, kinds: Sequence[str]) -> list[Fault]:
    """A fault of each kind that the case has room for and that shows; no two of the same joints, and none that undoes
    another."""
    found, taken = [], set()
    for kind in kinds:
        if any({kind, one.kind} <= alike for one in found for alike in UNDO):
            continue
        tries = (one for _ in range(20) if (one := DRAWN[kind](random, case)) and not taken & {*one.columns})
        drawn = next((one for one in tries if _shows(case, one)), None)
        if drawn:
            found.append(drawn)
            taken |= {*drawn.columns} if kind.startswith("joint") or kind == "run_offset" else set()
    return found


def spoiled(case: Case, wrong: Sequence[Fault]) -> Case:
    for one in sorted(wrong, key=lambda one: one.kind == "quaternion_order"):  # the order of columns comes last
        case = one.spoil(case)
    return case


def _shows(case: Case, wrong: Fault) -> bool:
    """Whether a fault of joints or loads moves the predicted positions by more than a right table leaves of errors."""
    if not wrong.kind.startswith(("joint", "force", "run", "tube")):
        return True
    bad = wrong.spoil(case)
    moved = np.linalg.norm(tips.predicted(bad.robot, bad.readings) - tips.predicted(case.robot, case.readings), axis=1)
    moved = np.nan_to_num(moved, nan=np.inf)  # it cannot be predicted at all
    if wrong.kind == "tube_changed":
        moved = np.nan_to_num(np.linalg.norm(bad.readings.position - case.readings.position, axis=1))
    rows, error = moved > 0, calibrated(case.robot, case.readings).error
    return bool(rows.any() and np.mean(moved[rows] ** 2) > np.nanmean(error[rows] ** 2))


def mended(case: Case, found: Review) -> float:
    """Error of the corrected case over that of the right one, both calibrated: 1 where the fix is right."""
    rows = np.flatnonzero(np.isfinite(found.readings.positions).all(axis=1))
    rows = rows[:: max(1, len(rows) // 200)]
    right = calibrated(case.robot, case.readings.rows(rows))
    return calibrated(found.robot, found.readings.rows(rows)).typical / right.typical


def in_table(change: Callable[[Measurements], Measurements]) -> Callable[[Case], Case]:
    return lambda case: replace(case, readings=change(case.readings))


def scaled(group: str, factor) -> Callable[[Measurements], Measurements]:
    return lambda m: replace(m, **{group: getattr(m, group) * np.array(factor)})


def _some(random: np.random.Generator, n: int) -> np.ndarray:
    return np.sort(random.choice(n, int(random.integers(1, n + 1)), replace=False))


def _names(kind: str, tubes) -> tuple[str, ...]:
    return tuple(f"{kind}{i + 1}" for i in tubes)


def _joint_sign(random, case):
    n = case.robot.n_tubes
    kind, tubes, sign = str(random.choice(["alpha", "beta"])), _some(random, n), np.ones(n)
    tubes = np.arange(n) if kind == "beta" else tubes
    sign[tubes] = -1
    return Fault("joint_sign", _names(kind, tubes), in_table(scaled(kind, sign)))


def _joint_offset(random, case):
    n = case.robot.n_tubes
    if n == 1:
        return None  # of a single tube it is the tracker frame that turned
    tube, size = int(random.integers(n)), np.deg2rad(random.choice([90, 180, -90, random.uniform(40, 140)]))
    return Fault(
        "joint_offset",
        _names("alpha", [tube]),
        in_table(lambda m: replace(m, alpha=m.alpha - size * (np.arange(n) == tube))),
    )


def _joint_unit(random, case):
    units = [("alpha", 180 / np.pi), ("alpha", 1 / (2 * np.pi)), ("beta", 1e3), ("beta", 1e2), ("beta", 1 / 0.0254)]
    kind, factor = units[random.integers(len(units))]
    return Fault("joint_unit", _names(kind, range(case.robot.n_tubes)), in_table(scaled(kind, factor)))


def _joint_order(random, case):
    n = case.robot.n_tubes
    moved = [i for i in range(n) if i != n - 1 - i]
    groups = [("beta", "alpha"), ("alpha",)][random.integers(2)]
    names = tuple(name for kind in groups for name in _names(kind, moved))
    swap = in_table(lambda m: replace(m, **{kind: getattr(m, kind)[:, ::-1] for kind in groups}))
    return Fault("joint_order", names, swap) if moved else None


def _joint_relative(random, case):
    n = case.robot.n_tubes
    groups = [("beta", "alpha"), ("beta",), ("alpha",)][random.integers(3)]

    def spoil(m):
        outer = {kind: np.append(getattr(m, kind)[:, 1:], np.zeros((len(m), 1)), axis=1) for kind in groups}
        return replace(m, **{kind: getattr(m, kind) - outer[kind] for kind in groups})

    names = tuple(name for kind in groups for name in _names(kind, range(n - 1)))
    return Fault("joint_relative", names, in_table(spoil)) if n > 1 else None


def _pose_inverse(random, case):
    def spoil(m):
        back = conjugate(m.quaternion)
        return replace(m, position=-np.einsum("mij,mj->mi", matrix_from_quaternion(back), m.position), quaternion=back)

    columns = group_columns(1)["position"] + group_columns(1)["quaternion"]
    return None if case.readings.quaternion is None else Fault("pose_inverse", columns, in_table(spoil))


def _frame_inverse(random, case):
    def spoil(case):
        rotation, origin = case.robot.tracker.rotation, case.robot.tracker.position
        return replace(case, robot=with_frame(case.robot, rotation.T, -rotation.T @ origin))

    return Fault("frame_inverse", (), spoil)


def _frame_wrong(random, case):
    turn, shift = Rotation.random(random_state=int(random.integers(2**31))).as_matrix(), random.uniform(-0.3, 0.3, 3)

    def spoil(case):
        tracker = case.robot.tracker
        return replace(case, robot=with_frame(case.robot, turn @ tracker.rotation, tracker.position + shift))

    return Fault("frame_wrong", (), spoil)


def _mirrored(random, case):
    axis, sign = int(random.integers(3)), np.ones(3)
    sign[axis] = -1

    def spoil(m):
        turned = m.quaternion if m.quaternion is None else mirror(m.quaternion, axis)
        return replace(m, position=m.position * sign, quaternion=turned)

    return Fault("mirrored", ("xyz"[axis] + "_m",), in_table(spoil))


def _of_quaternions(kind: str, change):
    def draw(random, case):
        columns = group_columns(1)["quaternion"]
        here = case.readings.quaternion is not None
        return Fault(kind, columns, in_table(lambda m: replace(m, quaternion=change(m.quaternion)))) if here else None

    return draw


def _force_sign(random, case):
    loaded = case.readings.force.any()
    return Fault("force_sign", group_columns(1)["force"], in_table(scaled("force", -1))) if loaded else None


def _force_unit(random, case):
    loaded, factor = case.readings.force.any(), random.choice([1e3, 1e3 / 9.80665])
    return Fault("force_unit", group_columns(1)["force"], in_table(scaled("force", factor))) if loaded else None


def _position_unit(random, case):
    factor = random.choice([1e3, 1e2, 1 / 0.0254])
    return Fault("position_unit", group_columns(1)["position"], in_table(scaled("position", factor)))


def _time_unit(random, case):
    return Fault("time_unit", ("t_s",), in_table(scaled("t", random.choice([1e3, 1e6, 1e9]))))


def _run_offset(random, case):
    runs, n = np.unique(case.readings.run), case.robot.n_tubes
    kind, tube, run = str(random.choice(["alpha", "beta"])), int(random.integers(n)), int(random.choice(runs))
    size = random.choice([-1, 1]) * (
        random.uniform(2e-3, 8e-3) if kind == "beta" else np.deg2rad(random.uniform(8, 90))
    )

    def spoil(m):
        off = np.where((m.run == run)[:, None], size * (np.arange(n) == tube), 0.0)
        return replace(m, **{kind: getattr(m, kind) - off})

    return Fault("run_offset", _names(kind, [tube]), in_table(spoil), (run,)) if len(runs) >= 4 else None


def _frozen(random, case):
    m = case.readings
    first = int(random.integers(0, len(m) - 8))
    rows = np.arange(first + 1, first + 1 + int(random.integers(2, 7)))
    rows = rows[m.run[rows] == m.run[first]]

    def spoil(m):
        poses = {name: np.array(old) for name in ("position", "quaternion") if (old := getattr(m, name)) is not None}
        for old in poses.values():
            old[rows] = old[first]
        return replace(m, **poses)

    columns = [group_columns(1)[name] for name in ("position", "quaternion") if getattr(m, name) is not None]
    return Fault("frozen", sum(columns, ()), in_table(spoil)) if len(rows) else None


def _tube_changed(random, case):
    """Another tube, of another curvature."""
    tube, factor = int(random.integers(case.robot.n_tubes)), float(random.choice([0.75, 1.3]))

    return Fault("tube_changed", (), in_table(lambda m: with_other_tube(case.robot, m, tube, factor)))


def with_other_tube(robot: Robot, m: Measurements, tube: int, factor: float) -> Measurements:
    """The readings moved and turned as far as the model moves and turns the tip by another curvature of a tube."""
    other = robot.model_copy(deep=True)
    other.tubes[tube].curvature_per_m *= factor
    (old, turned), (new, turned_new) = (_predicted(r, m) for r in (robot, other))
    position = m.position + np.nan_to_num((new - old) @ robot.tracker.rotation.T)
    if m.quaternion is None:
        return replace(m, position=position)
    turn = product(conjugate(turned), turned_new)
    quaternion = np.where(np.isfinite(turn), product(m.quaternion, turn), m.quaternion)
    return replace(m, position=position, quaternion=quaternion)


def _predicted(robot: Robot, m: Measurements):
    """Positions (M, 3) [m] and quaternions (M, 4) of the sensor, base frame."""
    beta, alpha = robot.joints_of_table(m.beta, m.alpha)
    found = Model(robot.standard).predict(beta, alpha, m.force)
    return of_sensor(robot.tracker, found.position, found.quaternion)


def in_some_runs(random: np.random.Generator, case: Case, kind: str) -> Fault | None:
    """A fault of this kind in one run alone, or another tube in the last runs; None where there is no room for it."""
    runs = np.unique(case.readings.run)
    fault = OF_RUNS[kind](random, case) if len(runs) >= settings.FEWEST_RUNS else None
    if fault is None:
        return None
    first = int(random.integers(len(runs) // 2 + 1, len(runs)))
    some = runs[first:] if kind == "tube_changed" and random.random() < 0.5 else runs[[first]]

    def spoil(m):
        bad, here = fault.spoil(replace(case, readings=m)).readings, np.isin(m.run, some)[:, None]
        parts = {name: getattr(m, name) for name in ("beta", "alpha", "force", "position", "quaternion")}
        return replace(m, **{k: np.where(here, getattr(bad, k), old) for k, old in parts.items() if old is not None})

    one = Fault(kind, fault.columns, in_table(spoil), tuple(map(int, some)))
    return one if _shows(case, one) else None


OF_RUNS = {
    "joint_sign": _joint_sign,
    "joint_unit": _joint_unit,
    "joint_order": _joint_order,
    "mirrored": _mirrored,
    "force_sign": _force_sign,
    "position_unit": _position_unit,
    "tube_changed": _tube_changed,
}
DRAWN = {
    "joint_sign": _joint_sign,
    "joint_offset": _joint_offset,
    "joint_unit": _joint_unit,
    "joint_order": _joint_order,
    "joint_relative": _joint_relative,
    "frame_inverse": _frame_inverse,
    "frame_wrong": _frame_wrong,
    "mirrored": _mirrored,
    "quaternion_order": _of_quaternions("quaternion_order", lambda q: np.roll(q, -1, 1)),
    "quaternion_inverse": _of_quaternions("quaternion_inverse", conjugate),
    "pose_inverse": _pose_inverse,
    "force_sign": _force_sign,
    "force_unit": _force_unit,
    "position_unit": _position_unit,
    "time_unit": _time_unit,
    "run_offset": _run_offset,
    "frozen": _frozen,
}
