"""The hypotheses on joints, loads, positions and the tracker frame: each a change that would make them right."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, combinations

import numpy as np
from scipy.constants import g as G
from scipy.spatial.transform import Rotation

from ctcr import settings
from ctcr.arrays import Array
from ctcr.audit import sensor_pose
from ctcr.frames import inverse_pose
from ctcr.model import parameters
from ctcr.robot.checks import path_text
from ctcr.robot.description import Robot
from ctcr.show.wording import join, listed
from ctcr.table.measurements import Measurements, group_columns

Change = Callable[[Measurements], Measurements]

OTHER_UNITS = {  # of a group of columns: unit, factor to SI
    "alpha": (("deg", np.pi / 180), ("rev", 2 * np.pi)),
    "beta": (("mm", 1e-3), ("cm", 1e-2), ("inch", 0.0254)),
    "force": (("g", 1e-3 * G), ("mN", 1e-3), ("kg", G)),
    "position": (("mm", 1e-3), ("cm", 1e-2), ("inch", 0.0254)),
}
POSE, QUATERNION, FORCE = (group_columns(1)[name] for name in ("position", "quaternion", "force"))


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A convention that may be wrong, and the correction of the table or of the robot file."""

    kind: str
    text: str
    columns: tuple[str, ...]
    fix: str
    change: Change = lambda m: m
    frame: tuple[Array, Array] | None = None  # R_tracker_base and origin [m] instead of the file's
    file: Robot | None = None  # the robot file as it should be
    registers: bool = False  # the tracker frame is taken from the readings
    sensor: Array | None = None  # (3,) [m] of the sensor in the frame of the tip instead of the file's
    # A home of another size: "alpha" or "beta", tube from 0, SI; of some runs also "curvature", by the logarithm.
    offset: tuple[str, int, float] | None = None
    scale: float = 1.0  # of the positions that it makes, over those of the table
    doubts: int = 1  # how much is wrong by it: of two that explain the readings alike, the lesser is named

    @property
    def of_positions(self) -> bool:
        """Whether it is of the positions that the tracker reads."""
        return self.kind in ("position_unit", "mirrored", "pose_inverse")

    @property
    def of_tracker(self) -> bool:
        """Whether it is of these or of the tracker frame, and not of what the model predicts."""
        return bool(self.of_positions or self.frame or self.registers)

    @property
    def of_robot(self) -> bool:
        """Whether it is of the robot file and not of the table."""
        return self.file is not None or self.frame is not None or self.registers or self.sensor is not None

    @property
    def home(self) -> str:
        """The parameter of the robot that its offset moves."""
        kind, tube, _ = self.offset
        return f"actuation.home_{'rotation' if kind == 'alpha' else 'translation'}.{tube + 1}"

    @property
    def frees(self) -> tuple[str, ...]:
        """How the names of the parameters begin of which nothing is known by it."""
        if self.registers:
            return parameters.OF_FRAME
        if self.sensor is not None:
            return ("tracker.sensor_position.",)
        return (self.home,) if self.offset else ()

    def robot(self, robot: Robot) -> Robot:
        if self.file is not None:
            return self.file
        if self.sensor is not None:
            tracker = robot.tracker.model_copy(update={"sensor_position_mm": (1e3 * self.sensor).tolist()})
            return robot.model_copy(update={"tracker": tracker})
        return with_frame(robot, *self.frame) if self.frame else robot


def hypotheses(robot: Robot, readings: Measurements) -> list[Hypothesis]:
    """All that the table and the robot have room for."""
    parts = (
        *(_signs, _zeros, _offsets, _units, _orders, _relative, _forces),
        *(_file_units, _radii, _tubes_of_sensor, _positions, _poses, _frames, _sensor),
    )
    return [one for part in parts for one in part(robot, readings)]


def with_frame(robot: Robot, rotation: Array, origin: Array) -> Robot:
    """A copy with another tracker frame."""
    vector = Rotation.from_matrix(rotation).as_rotvec()
    new = {"position_mm": (1e3 * origin).tolist(), "rotation_vector_rad": vector.tolist()}
    return robot.model_copy(update={"tracker": robot.tracker.model_copy(update=new)})


def joints(kind: str, tubes: tuple[int, ...]) -> tuple[str, ...]:
    """Names of joints as people write them: alpha2; tubes count from 0."""
    return tuple(f"{kind}{i + 1}" for i in tubes)


def named(kind: str, tubes: tuple[int, ...], n_tubes: int) -> str:
    """The joints of these tubes as the subject of a sentence."""
    return f"all {kind}s" if len(tubes) == n_tubes > 1 else join(joints(kind, tubes))


def changed(group: str, change: Callable[[Array], Array]) -> Change:
    """The change of a group of columns (M, K) of a table."""

    def apply(m: Measurements) -> Measurements:
        old = getattr(m, group)
        return m if old is None else replace(m, **{group: change(np.array(old))})

    return apply


def _some(n: int) -> Iterator[tuple[int, ...]]:
    """All sets of tubes but the empty one, small ones first."""
    return chain.from_iterable(combinations(range(n), size) for size in range(1, n + 1))


def _signs(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    n = robot.n_tubes
    homes = {"alpha": np.deg2rad(robot.actuation.home_rotation_deg)}
    homes["beta"] = 1e-3 * np.array(robot.actuation.home_translation_mm)
    for kind in ("alpha", "beta"):
        for tubes in _some(n):
            verb = "count" if len(tubes) > 1 else "counts"
            flip = " ".join(f"--flip {name}" for name in joints(kind, tubes))
            sign = np.ones(n)
            sign[list(tubes)] = -1.0
            text = f"{named(kind, tubes, n)} {verb} the other way"
            fix = f"ctcr import {flip}, or reverse the sign of the ratio in the controller"
            names = joints(kind, tubes)
            doubts = 1 if len(tubes) == n else len(tubes)
            yield Hypothesis("joint_sign", text, names, fix, changed(kind, lambda q, s=sign: q * s), doubts=doubts)
            if (home := homes[kind] * (sign < 0)).any():
                what = f"{text}, from home on"
                twice, unit = (2 * np.rad2deg(home), "deg") if kind == "alpha" else (2e3 * home, "mm")
                moves = " ".join(f"--offset {kind}{i + 1}={twice[i]:.6g}{unit}" for i in np.flatnonzero(home))
                fix = f"ctcr import {flip} {moves}, or correct the sign of the motor"
                change = changed(kind, lambda q, s=sign, h=home: 2 * h + q * s)
                yield Hypothesis("joint_sign", what, names, fix, change, doubts=doubts + 1)


def _zeros(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    """Insertion counted from elsewhere: tips flush with the plate, or home."""
    length = np.array([tube.length for tube in robot.tubes])
    home = 1e-3 * np.array(robot.actuation.home_translation_mm)
    names = joints("beta", tuple(range(robot.n_tubes)))
    for where, zero, kind in (
        ("where the tips are flush with the plate", -length, "from-flush"),
        ("home", home, "from-home"),
    ):
        for way, sign in (("", 1.0), (", outwards negative", -1.0)):
            text = f"all betas count from {where}{way}"
            fix = f"ctcr import --translation {kind} --robot ROBOT{' --flip beta' if sign < 0 else ''}"
            change = changed("beta", lambda q, z=zero, s=sign: z + s * q)
            yield Hypothesis("joint_offset", text, names, fix, change, doubts=2)


def _offsets(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    step = settings.CONVENTION_OFFSET_STEP_DEG
    turns = np.deg2rad(np.arange(step - 180, 181, step))
    shifts = 1e-3 * np.outer((1, -1), settings.CONVENTION_SHIFTS_MM).ravel()
    for kind, sizes in (("alpha", turns[turns != 0]), ("beta", shifts)):
        for i in range(robot.n_tubes):
            any_offset = Hypothesis("joint_offset", "", joints(kind, (i,)), "", offset=(kind, i, 0.0), doubts=2)
            yield from (offset_by(any_offset, float(size), robot.n_tubes) for size in sizes)


def offset_by(hypothesis: Hypothesis, size: float, n_tubes: int) -> Hypothesis:
    """An offset of the same joint by another size, SI."""
    kind, tube, _ = hypothesis.offset
    move = size * (np.arange(n_tubes) == tube)
    return replace(hypothesis, offset=(kind, tube, size), change=changed(kind, lambda q: q + move))


def _units(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    """Of one joint that moves, as another unit of one at rest is another home, and of all that are not 0 throughout."""
    n = robot.n_tubes
    for kind in ("alpha", "beta"):
        values = getattr(readings, kind)
        moving, every = np.flatnonzero(np.ptp(values, axis=0)), tuple(np.flatnonzero(values.any(axis=0)).tolist())
        sets = dict.fromkeys([*((int(i),) for i in moving), *([every] if len(every) > 1 else [])])
        for unit, factor in OTHER_UNITS[kind]:
            for tubes in sets:
                names, scale = joints(kind, tubes), np.ones(n)
                scale[list(tubes)] = factor
                verb, given = "are" if len(tubes) > 1 else "is", "m" if kind == "beta" else "rad"
                text = f"{named(kind, tubes, n)} {verb} in {unit}, not in {given}"
                fix = "ctcr import " + " ".join(f"--unit {name}={unit}" for name in names)
                yield Hypothesis("joint_unit", text, names, fix, changed(kind, lambda q, s=scale: q * s))


def _file_units(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    """All values of the robot file that are unusual in their unit and usual in another one, converted from that."""
    mended, fields, units = robot.model_copy(deep=True), [], []
    for path, quantity, value in robot.unusual():
        if (meant := quantity.meant(value)) is None:
            continue
        unit, size = meant
        section, last = parameters.value_at(mended, path[:-1]), path[-1]
        if isinstance(last, int):
            section[last] = size * value
        else:
            setattr(section, last, size * value)
        fields.append(f"{path_text(path)}: {size * value:g}")
        units.append(unit)
    if fields:
        text = f"values of the robot file are in {join([*dict.fromkeys(units)])}, not in the unit of their field"
        yield Hypothesis("file_unit", text, (), f"write {listed(fields, 12)}", file=mended)


def _radii(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    """Radii of curvature in mm in the place of curvatures: of tubes one sees bent, the radius is the larger number."""
    given = [tube.curvature_per_m for tube in robot.tubes]
    large = tuple(i for i, k in enumerate(given) if k * k > 1e3)
    for tubes in dict.fromkeys([*((i,) for i in large), large]):
        if not tubes:
            continue
        file = robot.model_copy(update={"tubes": [tube.model_copy() for tube in robot.tubes]})
        for i in tubes:
            file.tubes[i].curvature_per_m = 1e3 / given[i]
        numbers, verb = join([str(i + 1) for i in tubes]), "s are radii" if len(tubes) > 1 else " is a radius"
        text = f"the curvature{verb} in mm, not 1/m, of tube{'s' * (len(tubes) > 1)} {numbers}"
        fix = "write " + ", ".join(f"tubes[{i}].curvature_per_m: {1e3 / given[i]:g}" for i in tubes)
        yield Hypothesis("file_unit", text, (), fix, file=file)


def _tubes_of_sensor(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    """The sensor on another tube."""
    given = robot.tracker.sensor_on_tube
    for tube in range(1, robot.n_tubes + 1):
        if tube != given:
            tracker = robot.tracker.model_copy(update={"sensor_on_tube": tube})
            text = f"the sensor is on tube {tube}, not on tube {given}"
            fix = f"set tracker.sensor_on_tube to {tube}"
            yield Hypothesis("sensor_tube", text, (), fix, file=robot.model_copy(update={"tracker": tracker}), doubts=2)


def _orders(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    n = robot.n_tubes
    own = tuple(range(n))
    exchanged = {tuple(b if i == a else a if i == b else i for i in own) for a, b in combinations(own, 2)}
    for order in sorted(exchanged | {own[::-1]} - {own}):
        reverse, moved = order == own[::-1], [i for i in own if order[i] != i]
        for groups in (("beta", "alpha"), ("alpha",), ("beta",)):
            names = tuple(name for kind in groups for name in joints(kind, tuple(moved)))
            of = "joints" if len(groups) == 2 else f"{groups[0]}s"
            text = f"the {of} stand {'outermost tube first' if reverse else 'in another order'}"
            columns = [(kind, group_columns(n)[kind]) for kind in groups]
            swap = (f"--column {kind}{i + 1}={called[order[i]]}" for kind, called in columns for i in moved)
            fix = f"ctcr import {'--order outermost-first' if reverse and len(groups) == 2 else ' '.join(swap)}"

            def change(m: Measurements, order=order, groups=groups) -> Measurements:
                return replace(m, **{kind: getattr(m, kind)[:, order] for kind in groups})

            yield Hypothesis("joint_order", text, names, fix, change, doubts=1 if reverse else 2)


def _relative(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    """Each joint counted from that of the next outer tube."""
    n = robot.n_tubes
    for groups in (("beta", "alpha"), ("beta",), ("alpha",)) if n > 1 else ():
        names = tuple(name for kind in groups for name in joints(kind, tuple(range(n - 1))))
        text = f"{join(names)} count{'s' * (len(names) == 1)} from the joint of the next outer tube"
        sums = (" + ".join(joints(kind, tuple(range(i, n)))) for kind in groups for i in range(n - 1))
        fix = "write " + ", ".join(f"{total} in place of {name}" for name, total in zip(names, sums, strict=True))

        def change(m: Measurements, groups=groups) -> Measurements:
            return replace(m, **{kind: np.cumsum(getattr(m, kind)[:, ::-1], axis=1)[:, ::-1] for kind in groups})

        yield Hypothesis("joint_relative", text, names, fix, change, doubts=2)


def _forces(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    if not readings.force.any():
        return
    text, fix = "the force columns hold the reaction", "ctcr import --flip force negates them"
    yield Hypothesis("force_sign", text, FORCE, fix, changed("force", np.negative))
    for unit, factor in OTHER_UNITS["force"]:
        text, fix = f"forces are in {unit}, not in N", f"ctcr import --unit force={unit}"
        yield Hypothesis("force_unit", text, FORCE, fix, changed("force", lambda f, factor=factor: factor * f))


def _positions(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    for unit, factor in OTHER_UNITS["position"]:
        text, fix = f"positions are in {unit}, not in m", f"ctcr import --unit position={unit}"
        yield Hypothesis("position_unit", text, POSE, fix, changed("position", lambda p, f=factor: p * f), scale=factor)
    for axis, name in enumerate("xyz"):
        sign = np.ones(3)
        sign[axis] = -1.0
        text = f"the tracker frame of the table is left-handed: {name} is mirrored"
        fix = f"ctcr import --unit {name}=-1m"  # of the position alone
        yield Hypothesis("mirrored", text, (POSE[axis],), fix, changed("position", lambda p, s=sign: p * s))


def _poses(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    """The tracker in the frame of the sensor in place of the sensor in that of the tracker."""
    if readings.oriented.any():
        text = "the poses are the inverse ones, of the tracker in the frame of the sensor"

        def change(m: Measurements) -> Measurements:
            position, quaternion = inverse_pose(m.positions, m.quaternions)
            return replace(m, position=position, quaternion=quaternion)

        yield Hypothesis("pose_inverse", text, (*POSE, *QUATERNION), "ctcr import --invert-pose", change)


def _frames(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    rotation, origin = robot.tracker.rotation, robot.tracker.position
    text = "the tracker frame in the robot file is the inverse one, of the tracker in the base frame"
    yield Hypothesis("frame_inverse", text, (), "", frame=(rotation.T, -rotation.T @ origin))
    yield Hypothesis("frame_wrong", "the tracker frame in the robot file is wrong", (), "", registers=True, doubts=3)


def _sensor(robot: Robot, readings: Measurements) -> Iterator[Hypothesis]:
    """The sensor beside where the file has it, unless that says itself that it does not know."""
    if not any(name.startswith("tracker.sensor_position.") for name in parameters.of_sensor(robot)):
        place = sensor_pose.position(robot, readings)
        yield Hypothesis("sensor_position", "the sensor is not where the robot file has it", (), "", sensor=place)
