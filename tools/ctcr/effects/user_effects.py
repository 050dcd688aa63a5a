"""Effects that users write in a Python file, which needs no compiler: `--effects my_effects.py`.

    import numpy as np
    from ctcr.user_effects import Effect, Parameter

    HOME = np.array([-0.298, -0.2205, -0.145])  # [m] translations at which the angles are set to zero

    class Pickup(Effect):
        id = "rotation_pickup"
        title = "Rotation picked up with translation"
        physics = "The carriage twists a tube a little while it pushes it."
        parameters = [Parameter("gain", unit="rad/m", sigma=1.0, bounds=(-5, 5), per_tube=True)]

        def joints(self, rows, values):
            return rows.beta, rows.alpha + values.gain * (rows.beta - HOME)

Values are SI: a number, or an array (N,) where a parameter is per tube, innermost first. At the neutral values of its
amplitudes an effect must change nothing. Hooks, any of them; M rows in the order measured, N tubes:

    joints(rows, values) -> beta (M, N) [m], alpha (M, N) [rad]
        the joints that the tubes reach where the controller asks for rows.beta and rows.alpha
    force(rows, values) -> (M, 3) [N]
        force at the robot tip, base frame, added to the known one
    base(rows, values) -> position (M, 3) [m], rotation vector (M, 3) [rad]
        pose of the base in the base frame of the file; the weight of the tubes themselves does not turn with it
    curvature(tube, along, values) -> (K, 2) [1/m]
        curvature of the free tube (1: innermost) about its x and y axes, added to that of the robot file, at the arc
        lengths `along` (K,) [m] from the grasped point; smooth over some millimetres
    stiffness(tube, along, values) -> (K,)
        factor on the tube's bending stiffness at the same arc lengths
    reading(position, rotation, rows, values) -> position, rotation
        pose that the tracker reads for the sensor's pose (M, 3) [m], (M, 3, 3), tracker frame; row by row

No form is exact: `form_error` is the part of the amplitude of an effect's signal, as a calibration leaves it, by which
its form errs, as a standard deviation; 0.15 where the class does not say.

Standard output carries the results of a command: neither the file nor a hook prints there. One call may take a minute.
"""

import importlib.util
import io
import re
import shlex
import signal
import sys
import threading
import traceback
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from ctcr import inputs
from ctcr.arguments import checked
from ctcr.arrays import Array, Integers
from ctcr.effects import catalogue, watched
from ctcr.errors import InputError, Problem, shown
from ctcr.robot import robot_file
from ctcr.robot.description import Robot
from ctcr.table.measurements import Measurements

HOOKS = ("joints", "force", "base", "reading", "curvature", "stiffness")
ACTS_ON = dict(zip(HOOKS, ("joints", "tip", "rod", "reading", "rod", "rod"), strict=True))  # where each hook acts
HOOK_SECONDS = 60  # that the file, or one call of a hook, may take; 100 000 rows take less than a second
TEXTS = ("title", "physics", "signature", "measure", "reference")  # of an effect
_NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect, SI. `name`: small letters, digits and _, a letter first; `sigma`: prior standard
    deviation; values beyond `bounds` are impossible.

    A `shape` parameter changes nothing by itself: it is fitted once the effect has been accepted.
    """

    name: str
    unit: str = ""
    sigma: float = 1.0
    bounds: tuple[float, float] = (-inf, inf)
    neutral: float = 0.0
    per_tube: bool = False
    shape: bool = False
    usual: tuple[float, float] | None = None  # values beyond suggest another cause; by default 5 sigma
    meaning: str = ""


@dataclass(frozen=True)
class Rows:
    """Rows of the table that a hook gets, in the order measured. They cannot be written to."""

    t: Array  # (M,) [s], NaN where unknown
    run: Integers  # (M,)
    beta: Array  # (M, N) [m]
    alpha: Array  # (M, N) [rad]
    force: Array  # (M, 3) [N], base frame

    @classmethod
    def of(cls, measurements: Measurements) -> "Rows":
        views = [getattr(measurements, name).view() for name in cls.__dataclass_fields__]
        for view in views:
            view.flags.writeable = False
        return cls(*views)


class Effect:
    """Base class of users' effects; see the top of this file."""

    id: ClassVar[str] = ""
    title: ClassVar[str] = ""
    physics: ClassVar[str] = ""
    signature: ClassVar[str] = ""
    measure: ClassVar[str] = ""
    look_alikes: ClassVar[tuple[str, ...]] = ()
    reference: ClassVar[str] = ""
    needs: ClassVar[tuple[str, ...]] = ()
    form_error: ClassVar[float] = 0.15  # as most effects of the library
    parameters: ClassVar[list[Parameter]] = []

    @property
    def hooks(self) -> list[str]:
        return [name for name in HOOKS if callable(getattr(self, name, None))]

    def described(self, n_tubes: int) -> catalogue.Effect:
        """The description as that of the library's effects in the catalogue."""
        kept = ("name", "unit", "meaning", "per_tube")
        parameters = tuple(
            catalogue.EffectParameter(
                **{name: getattr(p, name) for name in kept},
                neutral=float(p.neutral),
                sigma=float(p.sigma),
                soft=p.usual or (p.neutral - 5 * p.sigma, p.neutral + 5 * p.sigma),
                hard=p.bounds,
                kind="shape" if p.shape else "amplitude",
                full_names=catalogue.full_names(self.id, p.name, p.per_tube, n_tubes),
            )
            for p in self.parameters
        )
        return catalogue.Effect(
            id=self.id,
            **{name: " ".join(getattr(self, name).split()) for name in TEXTS},
            look_alikes=tuple(self.look_alikes),
            needs=frozenset(self.needs),
            form_error=self.form_error,
            acts_on=frozenset(ACTS_ON[hook] for hook in self.hooks),
            parameters=parameters,
        )

    def values(self, n_tubes: int, given: dict[str, float]) -> SimpleNamespace:
        """The values that hooks get: those `given` by full name, else neutral ones."""
        made = {}
        for p in self.described(n_tubes).parameters:
            numbers = np.array([given.get(name, p.neutral) for name in p.full_names])
            made[p.name] = numbers if p.per_tube else float(numbers[0])
        return SimpleNamespace(**made)

    def call(self, hook: str, *arguments: Any) -> Any:
        """The answer of a hook. Raises InputError with the line of the user's file where it failed."""
        module = type(self).__module__
        file = getattr(sys.modules.get(module), "__file__", None) or module
        with _users_code(file, f"{type(self).__name__}.{hook}"):
            return getattr(self, hook)(*arguments)


@checked
def load(path: str | Path) -> list[Effect]:
    """The effects of a Python file, which is run; from then on robot files may hold them.

    Raises InputError with all faults of the file.
    """
    module = _module(Path(path))
    classes = [
        found
        for found in vars(module).values()
        if isinstance(found, type) and issubclass(found, Effect) and found.__module__ == module.__name__
    ]
    if not classes:
        raise InputError(Problem("holds no effect: a class derived from ctcr.user_effects.Effect", str(path)))
    problems = [problem for found in classes for problem in _faults(found, str(path))]
    ids = Counter(found.id for found in classes)
    problems += [
        Problem("two effects of the file have this id", str(path), field=name)
        for name, count in ids.items()
        if name and count > 1
    ]
    if problems:
        raise InputError(problems)
    with _users_code(str(path)):
        made = [found() for found in classes]
    robot_file.user_effects.update((effect.id, effect) for effect in made)
    inputs.shared[str(path)] = None
    return made


def command(*words: str) -> str:
    """A command line to copy, which knows the effects of the files that were loaded."""
    return shlex.join(["ctcr", *words, *(word for file in inputs.shared for word in ("--effects", file))])


def used_by(robot: Robot, names: Sequence[str] = ()) -> list[Effect]:
    """The effects of loaded files that a robot has or that some of the parameters belong to."""
    loaded = robot_file.user_effects
    wanted = [*robot.effects, *(name.split(".")[1] for name in names if name.startswith("effects."))]
    return [loaded[identity] for identity in dict.fromkeys(wanted) if identity in loaded]


def _module(path: Path) -> ModuleType:
    """The file, run as a module of its own name."""
    inputs.read(path, "this is not a file of effects")
    name = f"ctcr_user_effects_{re.sub(r'[^0-9a-zA-Z_]', '_', str(path.resolve()))}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None:
        raise InputError(Problem("is not a Python file: its name must end in .py", str(path)))
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    writes = sys.dont_write_bytecode
    sys.dont_write_bytecode = True  # no __pycache__ beside the user's file
    try:
        with _users_code(str(path)):
            spec.loader.exec_module(module)
    except InputError:
        del sys.modules[name]
        raise
    finally:
        sys.dont_write_bytecode = writes
    return module


class _TooLong(BaseException):
    """The user's code runs on."""


@contextmanager
def _time_limit() -> Iterator[None]:
    """Raises _TooLong after HOOK_SECONDS. Only the main thread has signals; commands run the user's code there."""

    def stop(*_) -> None:
        raise _TooLong

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, HOOK_SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@contextmanager
def _users_code(file: str, hook: str = "") -> Iterator[None]:
    """Runs code of the user's file, which must neither end the program nor print among its results.

    Raises InputError at the line of the file that was reached.
    """
    printed = io.StringIO()
    watched.note(f"{file}: {hook}".strip())
    try:
        with _time_limit(), redirect_stdout(printed):
            yield
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # also sys.exit(), which would look like success
        raise InputError(_fault(error, file, hook)) from error
    finally:
        watched.note("")
    if said := printed.getvalue():
        text = f"prints {shown(said)} to standard output, which carries the results: print to sys.stderr"
        raise InputError(Problem(f"{hook} {text}".strip(), file))


def _faults(found: type[Effect], file: str) -> list[Problem]:
    """Faults of a class of the file."""
    where, problems = found.id or found.__name__, []

    def say(text: str, field: str = "") -> None:
        problems.append(Problem(text, file, field=f"{where}.{field}" if field else where))

    if not isinstance(found.id, str) or not _NAME.fullmatch(found.id):
        say("needs an id of small letters, digits and _, such as rotation_pickup", "id")
    elif found.id in catalogue.catalogue():
        say("the library has an effect of this id: choose another one", "id")
    for name in TEXTS:
        given = getattr(found, name)
        if not isinstance(given, str) or (name in ("title", "physics") and not given.strip()):
            say("needs a text", name)
    for need in [need for need in found.needs if need not in catalogue.NEEDS][:1]:
        say(f"{shown(need)} is none of {', '.join(catalogue.NEEDS)}", "needs")
    if not isinstance(found.form_error, int | float) or not 0 < found.form_error < inf:
        say(f"{shown(found.form_error)}: needs a number above 0; no form is exact", "form_error")
    if not any(callable(getattr(found, name, None)) for name in HOOKS):
        say(f"needs at least one of the functions {', '.join(HOOKS)}")
    if not found.parameters or not all(isinstance(p, Parameter) for p in found.parameters):
        say('needs a list such as [Parameter("gain", unit="rad/m", sigma=1.0)]', "parameters")
        return problems
    if all(p.shape for p in found.parameters):
        say("needs one that is not a shape: an amplitude of the effect", "parameters")
    for p in found.parameters:
        for text in _parameter_faults(p):
            say(text, f"parameters.{p.name}")
    for name, count in Counter(p.name for p in found.parameters).items():
        if count > 1:
            say("two parameters have this name", f"parameters.{name}")
    return problems


def _parameter_faults(p: Parameter):
    if not isinstance(p.name, str) or not _NAME.fullmatch(p.name):
        yield "needs a name of small letters, digits and _"
    if not _is_number(p.sigma) or not p.sigma > 0:
        yield f"sigma = {shown(p.sigma)}: needs a number above 0, in {p.unit or 'no unit'}"
    if not _is_number(p.neutral):
        yield f"neutral = {shown(p.neutral)}: needs a number"
    elif not (isinstance(p.bounds, tuple) and len(p.bounds) == 2 and p.bounds[0] <= p.neutral <= p.bounds[1]):
        yield f"bounds = {shown(p.bounds)}: needs (lowest, highest) with the neutral value {p.neutral:g} between"
    elif p.bounds[0] == p.bounds[1]:
        yield "bounds leave no room"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and isfinite(value)


def _fault(error: BaseException, file: str, hook: str) -> Problem:
    """An exception of the user's code as an error at the last line of that code which was reached."""
    match error:
        case SystemExit():
            text = "ends the program with sys.exit(): raise an error that says what is wrong"
        case _TooLong():
            text = f"takes longer than {HOOK_SECONDS} s: is there a loop without end?"
        case _:
            reason = " ".join(str(getattr(error, "msg", None) or error).split()) or "no reason given"
            text = f"{'fails: ' if hook else ''}{reason} ({type(error).__name__})"
    line = getattr(error, "lineno", None)
    for frame in traceback.extract_tb(error.__traceback__):
        if frame.filename == file or Path(frame.filename).resolve() == Path(file).resolve():
            line = frame.lineno
    return Problem(f"{hook} {text}".strip(), file, line)
