"""What the name of a column suggests: "tube2_rot [deg]" is the rotation of tube 2 in degrees."""

import re
import unicodedata
from dataclasses import dataclass

from ctcr.intake.units import Unit, named

LARGEST = 9  # number of a tube: a larger one counts something else
INNER, MIDDLE, OUTER = -3, -2, -1  # numbers of tubes that a name gives as a word

_GREEK = {"α": "alpha", "β": "beta", "θ": "theta", "φ": "phi", "ψ": "psi", "ρ": "rho"}
_TIME = {"t", "time", "timestamp", "timestamps", "stamp", "datetime", "elapsed", "secs", "clock", "times"}
RUN = {"run", "trial", "path", "experiment", "trajectory", "traj", "sequence", "runs", "trials"}
_BETA = {"beta", "b", "d", "trans", "translation", "translations", "translational", "linear", "lin", "ins", "insertion"}
_BETA |= {"tr", "ext", "extension", "slide", "rho", "l", "s", "advance", "displacement", "disp", "stroke", "betas"}
_ALPHA = {"alpha", "a", "theta", "rot", "rotation", "rotations", "rotational", "roll", "psi", "phi", "angle", "ang"}
_ALPHA |= {"alphas", "thetas", "angles"}
_STRONG = {"beta", "alpha", "insertion", "translation", "extension", "betas", "alphas"}  # without a number: of one tube
_WORDS = {
    "one": 1,
    "two": 2,
    "three": 3,
    "four": 4,
    "i": INNER,
    "in": INNER,
    "o": OUTER,
    "out": OUTER,
    "inner": INNER,
    "innermost": INNER,
    "middle": MIDDLE,
    "mid": MIDDLE,
    "outer": OUTER,
    "outermost": OUTER,
}
_SEEN = {"valid", "visible", "tracked", "seen", "state", "status", "visibility", "isvalid", "validity"}
_COMMANDED = {
    "cmd",
    "command",
    "commanded",
    "des",
    "desired",
    "target",
    "goal",
    "setpoint",
    "set",
    "demand",
    "demanded",
}
_COMMANDED |= {"sp", "nominal", "planned", "pred", "predicted", "model", "sim"}
_MEASURED = {"meas", "measured", "actual", "act", "fb", "feedback", "enc", "encoder", "real"}
_ROTATION = {"rot", "rotation", "orientation", "ori", "orient", "quat", "quaternion", "q", "euler", "attitude"}
_FORCE = {"f", "force", "load"}
_WEIGHT = {"weight", "mass", "load", "payload"}  # hung at the tip
_PARTS = {"nsec", "nsecs", "nanosec", "nanosecs"}  # of the second that another column counts, as ROS writes stamps
_EULER = {"roll": "rx", "pitch": "ry", "yaw": "rz"}
_MATRIX = {"r", "rot", "m", "t", "h", "tf", "mat", "matrix", "g", "rotation", "transform", "pose"}
_NOISE = {"field", "pose", "pos", "position", "positions", "data", "log", "msg", "joint", "joints", "tube", "tubes"}
_NOISE |= {"motor", "axis", "value", "values", "tracker", "coordinate", "coord", "p", "translation", "header", "of"}
_NOISE |= {"vector", "xyz"} | _ROTATION
_ELSE = {
    "vel",
    "velocity",
    "speed",
    "rate",
    "acc",
    "acceleration",
    "current",
    "voltage",
    "torque",
    "temperature",
    "temp",
}
_ELSE |= {"error", "err", "std", "sd", "var", "variance", "cov", "covariance", "rms", "residual", "quality", "counts"}
_SHORT = {"a", "b", "d", "l", "s"}  # joints where the name says nothing else


@dataclass(frozen=True)
class Meaning:
    """`role` is what a column holds, such as t, beta2, x or qw; `marker` the tracked body that a pose belongs to.

    Lower ranks come first where several columns could have one role: measured ones before commanded ones.
    """

    role: str
    unit: Unit | None = None
    marker: str = ""
    rank: int = 0
    tube: int = 0  # of a joint, as the name numbers it; INNER, MIDDLE, OUTER


def meaning(name: str) -> Meaning | None:
    """What a name suggests, None for nothing. Some roles wait for their neighbours.

    ox, oy, oz, ow: orientation, a quaternion where there is an ow, else angles. m1 to m16, or m11 to m44: a matrix.
    """
    unit, text = _unit(unicodedata.normalize("NFKC", name))  # subscripts become digits
    words = _words(text)
    rank = 100 * bool(_COMMANDED & set(words))
    words = [word for word in words if word not in _COMMANDED | _MEASURED]
    last = re.findall(r"[a-z]+", name.lower())[-1:]
    if last and last[0] in _PARTS:
        return Meaning("nsec", named("ns"), rank=rank)
    if set(words) & _ELSE:
        return None
    if not words:  # a name such as [s] is all unit
        return Meaning("t", unit, rank=rank) if unit and unit.quantity == "time" else None
    found = _matrix(words) or _pose(words) or _joint(words) or _other(words)
    if found is None:
        return None
    role, tube, rest = found
    if unit and unit.quantity != quantity(role):
        unit = None
    marker = " ".join(word for word in rest if word not in _NOISE) if not tube else ""
    return Meaning(role, unit, marker, rank + len(rest), tube)


def quantity(role: str) -> str | None:
    """The quantity of a role: time, length, angle, force; None for numbers without a unit."""
    kinds = {"t": "time", "nsec": "time", "beta": "length", "alpha": "angle", "weight": "force"}
    kinds |= {"f": "force", "r": "angle", "o": "angle"}
    if role in ("x", "y", "z"):
        return "length"
    return kinds.get(role.rstrip("0123456789")) or (kinds.get(role[0]) if role[1:] in ("x", "y", "z") else None)


def _unit(name: str) -> tuple[Unit | None, str]:
    """The unit at the end of a name, and the name without it."""
    bracketed = re.search(r"[\[(<{]\s*([^\])>}]+?)\s*[\])>}]\s*$", name)
    if bracketed and (unit := named(bracketed[1])):
        return unit, name[: bracketed.start()]
    last = re.search(r"(?<=[\w)])[\s_/.,\-]+([^\W_]+)\s*$", name)
    if last and (unit := named(last[1])):
        return unit, name[: last.start()]
    camel = re.search(r"(?<=[a-z0-9])(Deg|Rad|Mm|Sec|Ms)$", name)
    return (named(camel[1]), name[: camel.start()]) if camel else (None, name)


def _words(text: str) -> list[str]:
    for letter, spelled in _GREEK.items():
        text = text.replace(letter, f" {spelled} ")
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    words = re.findall(r"[^\W\d_]+|\d+", text.lower())
    return [word for word in words if word != "s" or len(words) <= 2]


Found = tuple[str, int, list[str]] | None  # role, tube, words that say something else


def _matrix(words: list[str]) -> Found:
    *rest, word, number = words if len(words) > 1 else ("", "", "")
    if word.isdigit() and number.isdigit() and rest and rest[-1] in _MATRIX:  # r_1_2
        *rest, word, number = *rest[:-1], rest[-1], word + number
    if word in _MATRIX and re.fullmatch(r"[0-4][0-4]|1[0-6]|[0-9]", number) and word not in ("rot", "rotation"):
        return f"m{int(number):02d}" if len(number) == 2 else f"m{number}", 0, rest
    if word in ("rot", "rotation") and re.fullmatch(r"[0-4][0-4]", number):
        return f"m{number}", 0, rest
    return None


def _pose(words: list[str]) -> Found:
    *rest, last = words
    if last.isdigit() and rest and re.fullmatch(r"[tp]?[xyz]|q[xyzw]", rest[-1]):  # x1 is the first marker's
        *rest, last = *rest[:-1], last, rest[-1]
    if last in _EULER:
        return _EULER[last], 0, rest
    if re.fullmatch(r"[tp][xyz]|[fqr][xyz]|qw", last):
        role = last[1] if last[0] in "tp" else last
        return role, 0, rest
    if last in ("x", "y", "z", "w"):
        if rest and rest[-1] in _FORCE:
            return f"f{last}", 0, rest[:-1]
        if set(rest) & _ROTATION:
            return f"o{last}", 0, rest
        return (last, 0, rest) if last != "w" else ("ow", 0, rest)
    if len(words) > 1 and words[-2] in ("q", "quat", "quaternion") and last in ("0", "1", "2", "3", "4"):
        return f"q{last}", 0, words[:-2]
    return None


def _joint(words: list[str]) -> Found:
    numbers = [int(word) for word in words if word.isdigit()] + [_WORDS[word] for word in words if word in _WORDS]
    rest = [word for word in words if not word.isdigit() and word not in _WORDS]
    kinds = {"beta": [w for w in rest if w in _BETA], "alpha": [w for w in rest if w in _ALPHA]}
    if bool(kinds["beta"]) == bool(kinds["alpha"]) or len(numbers) > 1 or max(numbers, default=0) > LARGEST:
        return None
    kind = "beta" if kinds["beta"] else "alpha"
    if not numbers and not set(kinds[kind]) & _STRONG:
        return None
    others = [word for word in rest if word not in kinds[kind] and word not in _NOISE]
    if others and set(kinds[kind]) <= _SHORT:
        return None
    return kind, numbers[0] if numbers else 1, others  # tube 0 is settled with all names


def _other(words: list[str]) -> Found:
    for role, known in (("t", _TIME), ("run", RUN), ("seen", _SEEN), ("weight", _WEIGHT)):
        if set(words) & known:
            return role, 0, [word for word in words if word not in known and not word.isdigit()]
    return None
