"""The meaning of a column by its name: "tube2_rot [deg]" is the rotation of tube 2 in degrees."""

import re
import unicodedata
from dataclasses import dataclass, replace

from ctcr.intake import units
from ctcr.intake.units import Unit, named

LARGEST = 9  # number of a tube: a larger one counts something else
INNER, MIDDLE, OUTER = -3, -2, -1  # numbers of tubes that a name gives as a word

_GREEK = {"α": "alpha", "β": "beta", "θ": "theta", "φ": "phi", "ψ": "psi", "ρ": "rho"}


def _set(words: str) -> set[str]:
    return set(words.split())


TIP_WORDS = _set("tip sensor probe ee effector end tool distal spitze")
RUN = _set("run runs trial trials path experiment trajectory traj sequence messung versuch lauf bahn")
_TIME = _set("t time times timestamp timestamps stamp datetime elapsed secs clock zeit zeitstempel uhrzeit")
_DAY = _set("date datum")  # of the clock in another column
_BETA = _set("beta betas b d trans translation translations translational linear lin ins insertion tr ext extension")
_BETA |= _set("slide rho l s advance displacement disp stroke vorschub verschub vortrieb weg verschiebung")
_ALPHA = _set("alpha alphas a theta thetas rot rotation rotations rotational roll psi phi angle angles ang winkel")
_ALPHA |= _set("drehwinkel drehung")
_STRONG = _set("beta betas alpha alphas insertion translation extension")  # without a number: of one tube
_SHORT = _set("a b d l s")  # joints where the name says nothing else
_WORDS = {"one": 1, "two": 2, "three": 3, "four": 4}
_WORDS |= dict.fromkeys(_set("i in inner innermost innen innenrohr"), INNER)
_WORDS |= dict.fromkeys(_set("middle mid mitte mittelrohr"), MIDDLE)
_WORDS |= dict.fromkeys(_set("o out outer outermost aussen außen aussenrohr außenrohr"), OUTER)
_SEEN = _set("ok valid visible tracked seen state status visibility isvalid validity")
_COMMANDED = _set("cmd command commanded des desired target goal setpoint set demand demanded sp nominal planned ideal")
_COMMANDED |= _set("pred predicted prediction model sim simulated simulation calc calculated computed")
_COMMANDED |= _set("theory theoretical fk soll")
_GIVEN = 100  # rank of a column that a command, a target or a model gives
_MEASURED = _set("meas measured actual act fb feedback enc encoder real exp true gt ist")
_ROTATION = _set("rot rotation orientation ori orient quat quaternion q euler attitude angle rpy rotvec rvec rodrigues")
_ROTATION |= {"axang"}
_FORCE = _set("force load kraft")
_WEIGHT = _set("weight mass load payload gewicht masse")  # hung at the tip
_UNSIZED = _set("count counts cnt cnts step steps tick ticks pulse pulses inc increments")
_UNSIZED |= {"grad"}  # degrees in German, gon in English
_PARTS = _set("nsec nsecs nanosec nanosecs")  # of the second that another column counts, as ROS writes stamps
_EULER = {"roll": "rx", "pitch": "ry", "yaw": "rz", "nick": "ry", "gier": "rz", "elevation": "ry", "azimuth": "rz"}
_MATRIX = _set("r rot m t h tf mat matrix g rotation transform pose")
_NOISE = _set("field pose pos position positions data log msg joint joints tube tubes motor axis value values tracker")
_NOISE |= _set("coordinate coord p translation header of vector xyz is tracking mean avg rohr rohre achse") | _ROTATION
_ELSE = _set("vel velocity speed rate acc acceleration current voltage torque temperature temp error err std sd var")
_ELSE |= _set("variance cov covariance rms residual quality")
_REMARKS = _set("base reference left right x y z w utc gmt local unix epoch")  # in brackets they are no units
_REMARKS |= TIP_WORDS.union(_TIME, RUN, _BETA, _ALPHA, _SEEN, _COMMANDED, _MEASURED, _FORCE, _WEIGHT, _NOISE)
_REMARKS |= {*_WORDS, *_EULER}
_DATE = re.compile(r"([dtmjyhs]+[./-])+[dtmjyhs]+")  # how a date is written: TT.MM.JJJJ
_RATE = re.compile(r"([^\W\d_]+)\s*/\s*(?:s|sec|min|h)[\W\d]*$")  # such as mm/s: neither a joint nor a pose
_AXIS = re.compile(r"[tp]?[xyz]|q[xyzw]|[rfw][xyz]")


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

    @property
    def is_given(self) -> bool:
        """Whether a command, a target or a model gives the column."""
        return self.rank >= _GIVEN


def with_middle(names: tuple[str, ...]) -> list[str]:
    """The names, with a lone m spelled out as middle where other names have an i and an o in its place: there it is the
    middle tube, and not metres."""
    made = []
    for name in names:
        places = [found.start() for found in re.finditer(r"(?<![^\W_])m(?![^\W_])", name)]
        places = [k for k in places if all(name[:k] + tube + name[k + 1 :] in names for tube in "io")]
        made.append(f"{name[: places[0]]}middle{name[places[0] + 1 :]}" if places else name)
    return made


def meaning(name: str) -> Meaning | None:
    """The meaning that a name suggests, None without any. Some roles are settled only with the neighbouring columns.

    ox, oy, oz, ow: orientation, a quaternion where there is an ow, else angles. m1 to m16, or m11 to m44: a matrix.
    """
    name = unicodedata.normalize("NFKC", name)  # subscripts become digits
    unit, text = _unit(name)
    words = _words(name)
    rate = _RATE.search(name)
    if set(words) & _ELSE or (rate and named(rate[1])):
        return None
    if words and words[-1] in _PARTS:
        return Meaning("nsec", named("ns"))
    made = _meaning(text, unit)
    wanted = made and quantity(made.role)
    if not made or not unit or unit.quantity == wanted:
        return made
    if not wanted:
        return replace(made, unit=None)
    if len(unit.text) == 1 and name.rstrip()[-1].isalpha():  # stands for a word, such as measured
        return _meaning(name, None)
    return replace(made, unit=units.unknown(unit.text), rank=made.rank + 1)


def _meaning(text: str, unit: Unit | None) -> Meaning | None:
    """The meaning that a name without its unit suggests."""
    words = _words(text)
    rank = _GIVEN * bool(_COMMANDED & set(words))
    words = [word for word in words if word not in _COMMANDED | _MEASURED]
    if not words:  # a name such as [s] is all unit
        return Meaning("t", unit, rank=rank) if unit and unit.quantity == "time" else None
    found = _matrix(words) or _pose(words) or _joint(words) or _other(words)
    if found is None:
        return None
    role, tube, rest = found
    marker = " ".join(word for word in rest if word not in _NOISE) if not tube else ""
    return Meaning(role, unit, marker, rank + len(rest), tube)


def quantity(role: str) -> str | None:
    """The quantity of a role: time, length, angle, force; None for numbers without a unit."""
    kinds = {"t": "time", "nsec": "time", "beta": "length", "alpha": "angle", "weight": "force"}
    kinds |= {"f": "force", "force": "force", "r": "angle", "o": "angle"}
    if role in ("x", "y", "z"):
        return "length"
    return kinds.get(role.rstrip("0123456789")) or (kinds.get(role[0]) if role[1:] in ("x", "y", "z") else None)


def unit(name: str) -> Unit | None:
    """The unit that a name states."""
    return _unit(unicodedata.normalize("NFKC", name))[0]


def _unit(name: str) -> tuple[Unit | None, str]:
    """The unit that a name states, and the name without it."""
    bracketed = re.search(r"[\[(<{]\s*([^\])>}]+?)\s*[\])>}]\s*$", name)
    if bracketed and (found := units.multiple(bracketed[1]) or _unknown(bracketed[1])):
        return found, name[: bracketed.start()]
    last = re.search(r"(?:(?<=[\w)])[\s_/.,\-]+|(?<=\d)(?=\D\D))(\d*\.\d+[^\W\d_]+|[^\W\d_]+)\s*$", name)
    inner = last and last[1].lower() == "in" and not re.search(r"(\d|(?<![a-z])[xyz])$", name[: last.start()].lower())
    if last and not inner and (found := units.multiple(last[1])):
        return found, name[: last.start()]
    camel = re.search(r"(?<=[a-z0-9])(Deg|Rad|Mm|Sec|Ms)$", name)
    if camel:
        return named(camel[1]), name[: camel.start()]
    unsized = re.search(rf"(?<![a-z])({'|'.join(_UNSIZED)})(?![a-z])", name.lower())
    return (units.unknown(unsized[1]), name[: unsized.start()] + name[unsized.end() :]) if unsized else (None, name)


def _unknown(text: str) -> Unit | None:
    """The text in brackets as an unknown unit, where it is one word without another meaning."""
    is_word = re.fullmatch(r"[\d.]*\s*[^\W\d_][\w./^]*", text) and not set(_words(text)) & _REMARKS
    is_word = is_word and not _DATE.fullmatch(text.lower())
    return units.unknown(text) if is_word else None


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
    """The one word of an axis may stand anywhere, the others name the marker; a numbered tube is one of a joint."""
    at = [i for i, word in enumerate(words) if _AXIS.fullmatch(word)]
    if not at and (words[-1] in _EULER or not _numbers(words)):
        at = [i for i, word in enumerate(words) if word in _EULER or word == "w"]
    if len(at) == 1 and (at[0] >= len(words) - 1 - words[-1].isdigit() or not _joint(words)):
        axis, rest = words[at[0]], words[: at[0]] + words[at[0] + 1 :]
        if axis in _EULER:
            return _EULER[axis], 0, rest
        if len(axis) == 2:  # w turns
            return axis[1] if axis[0] in "tp" else "r" + axis[1] if axis[0] == "w" else axis, 0, rest
        if set(rest) & _FORCE or words[max(at[0] - 1, 0)] == "f":
            return f"f{axis}", 0, [word for word in rest if word not in {"f"} | _FORCE]
        return f"o{axis}" if axis == "w" or set(rest) & _ROTATION else axis, 0, rest
    if len(words) > 1 and words[-2] in ("q", "quat", "quaternion") and re.fullmatch(r"\d", words[-1]):
        return f"q{words[-1]}", 0, words[:-2]
    return None


def _numbers(words: list[str]) -> list[int]:
    """The numbers of tubes among the words."""
    return [int(word) if word.isdigit() else _WORDS[word] for word in words if word.isdigit() or word in _WORDS]


def _joint(words: list[str]) -> Found:
    numbers = _numbers(words)
    rest = [word for word in words if not word.isdigit() and word not in _WORDS]
    kinds = {"beta": [w for w in rest if w in _BETA], "alpha": [w for w in rest if w in _ALPHA]}
    if bool(kinds["beta"]) == bool(kinds["alpha"]) or len(numbers) > 1 or max(numbers, default=0) > LARGEST:
        return None
    kind = "beta" if kinds["beta"] else "alpha"
    if not numbers and (not set(kinds[kind]) & _STRONG or any(map(_AXIS.fullmatch, rest))):
        return None
    others = [word for word in rest if word not in kinds[kind] and word not in _NOISE]
    if set(others) & _FORCE or others and set(kinds[kind]) <= _SHORT:
        return None
    return kind, numbers[0] if numbers else 1, others  # tube 0 is settled with all names


def _other(words: list[str]) -> Found:
    known_words = ("t", _TIME), ("date", _DAY), ("run", RUN), ("seen", _SEEN), ("weight", _WEIGHT), ("force", _FORCE)
    for role, known in known_words:
        if set(words) & known:
            rest = [word for word in words if word not in known and not word.isdigit()]
            return None if role == "force" and set(rest) - TIP_WORDS - _NOISE else (role, 0, rest)
    return None
