"""Units that logs use, and how texts name them."""

import re
from dataclasses import dataclass
from math import pi

from ctcr.errors import InputError, Problem

SI = {"time": "s", "length": "m", "angle": "rad", "force": "N"}
CLOCK = "clock"  # the unit of times such as 2026-05-04T10:15:30.25 and 10:15:30.25
_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "day": 86400.0, CLOCK: 1.0}
_LENGTHS = {"m": 1.0, "dm": 1e-1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "inch": 25.4e-3}
_ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "cdeg": pi / 18000, "rev": 2 * pi, "pi": pi, "gon": pi / 200}
_ANGLES |= {"arcmin": pi / 10800, "arcsec": pi / 648000}
_FORCES = {"N": 1.0, "kN": 1e3, "cN": 1e-2, "mN": 1e-3}
_FORCES |= {"kgf": 9.80665, "gf": 9.80665e-3, "mgf": 9.80665e-6, "lbf": 4.4482216152605, "ozf": 0.27801385095378125}
_QUANTITIES = {"time": _TIMES, "length": _LENGTHS, "angle": _ANGLES, "force": _FORCES}
_SIZES = {unit: (quantity, size) for quantity, sizes in _QUANTITIES.items() for unit, size in sizes.items()}
_ALSO = {
    "s": "sec secs second seconds",
    "ms": "msec msecs millisecond milliseconds millis",
    "us": "usec microsecond microseconds µs μs",
    "ns": "nsec nsecs nanosec nanosecond nanoseconds",
    "min": "minute minutes mins",
    "h": "hr hrs hour hours",
    "day": "days",
    "m": "meter meters metre metres",
    "cm": "centimeter centimeters centimetre centimetres",
    "mm": "millimeter millimeters millimetre millimetres",
    "um": "micrometer micrometers micron microns µm μm",
    "dm": "decimeter decimeters decimetre decimetres",
    "inch": "in inches",
    "rad": "radian radians rads",
    "deg": "degree degrees degs °",
    "rev": "revs revolution revolutions turn turns",
    "pi": "π",
    "N": "n newton newtons",
    "kN": "kn kilonewton kilonewtons",
    "cN": "cn centinewton centinewtons",
    "mN": "mn millinewton millinewtons",
    "kgf": "kg kilogram kilograms",
    "gf": "g gram grams gramm",
    "mgf": "mg milligram milligrams",
    "lbf": "lb lbs pound pounds",
    "ozf": "oz ounce ounces",
    CLOCK: "iso datetime",
}
_NAMED = {unit: unit for unit in _SIZES} | {other: unit for unit, others in _ALSO.items() for other in others.split()}


@dataclass(frozen=True)
class Unit:
    """`text` as a user writes it, such as mm or 0.0025mm; `size` in the SI unit of the quantity."""

    text: str
    quantity: str  # time, length, angle, force; "" of a unit that is not known, such as counts
    size: float

    @property
    def is_clock(self) -> bool:
        return self.text == CLOCK


def named(text: str) -> Unit | None:
    """The unit of a name such as mm, Millimeters or deg; None where it is none."""
    text = text.strip()
    unit = _NAMED.get(text) or _NAMED.get(text.lower())
    return Unit(unit, *_SIZES[unit]) if unit else None


def multiple(text: str) -> Unit | None:
    """The unit of a text such as 0.1 mm or mm; None where it is none."""
    found = re.fullmatch(r"\s*(\d*\.?\d+)?\s*(\D+?)\s*", text)
    unit = named(found[2]) if found else None
    return Unit(text.strip(), unit.quantity, float(found[1]) * unit.size) if unit and found[1] else unit


def unknown(text: str) -> Unit:
    """A unit that a name states without a size, such as counts: an option must give it."""
    return Unit(text.strip(), "", float("nan"))


def of(quantity: str) -> str:
    """The units of a quantity, as texts name them."""
    return ", ".join(_QUANTITIES[quantity])


def parsed(text: str, quantity: str, where: str) -> Unit:
    """The unit of an option, which may begin with a number: 0.0025mm is one count of an encoder.

    Raises InputError that names the option `where` and the units of the quantity.
    """
    unit = _amount(text, quantity, where)
    if not unit.size:
        raise InputError(Problem(f"{text} makes all numbers 0: give one of {of(quantity)}", field=where))
    return unit


def value(text: str, quantity: str, where: str) -> float:
    """A quantity of an option, such as 90deg or -12mm, in SI units; a bare 0 needs no unit. Raises InputError."""
    try:
        if float(text) == 0:
            return 0.0
    except ValueError:
        return _amount(text, quantity, where).size
    usual = {"length": "mm", "angle": "deg"}.get(quantity, SI[quantity])
    raise InputError(Problem(f"{text} has no unit: write {text}{usual}", field=where))


def _amount(text: str, quantity: str, where: str) -> Unit:
    """A unit with or without a number before it."""
    found = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)?\s*(\S*?)\s*", text)
    unit = named(found[2]) if found else None
    if unit is None or unit.quantity != quantity:
        raise InputError(Problem(f"{text} is no unit of {quantity}: give one of {of(quantity)}", field=where))
    return Unit(text.strip(), quantity, float(found[1]) * unit.size) if found[1] else unit
