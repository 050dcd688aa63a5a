"""A physical quantity of an input file: its unit, possible and usual values, and a guess of the unit that was meant."""

from dataclasses import dataclass
from math import pi

LARGEST = 1e15  # beyond any quantity here in any unit that people write

# unit -> (unit that people write instead, its size in our unit)
_OTHER_UNITS = {
    "m": (("mm", 1e-3), ("um", 1e-6)),
    "mm": (("m", 1e3), ("um", 1e-3)),
    "1/m": (("1/mm", 1e3),),
    "GPa": (("Pa", 1e-9), ("MPa", 1e-3)),
    "kg/m^3": (("g/cm^3", 1e3),),
    "N": (("mN", 1e-3),),
    "N m^2": (("N mm^2", 1e-6),),
    "deg": (("rad", 180 / pi),),
    "rad": (("deg", pi / 180),),
    "m/s^2": (("mm/s^2", 1e-3), ("g", 9.80665)),
    "mm/s": (("m/s", 1e3),),
    "mm/s^2": (("m/s^2", 1e3),),
    "g": (("kg", 1e3),),
    "deg/s": (("rad/s", 180 / pi),),
    "Hz": (("kHz", 1e3),),
}


@dataclass(frozen=True)
class Quantity:
    """Values are possible above `above` (exclusive), from `least` to `most`; `usual` bounds their size unless zero.

    `count` names the number of values in messages.
    """

    unit: str
    usual: tuple[float, float] | None = None
    count: str = "a number"
    above: float | None = None
    least: float | None = None
    most: float | None = None

    @property
    def expected(self) -> str:
        """The value needed, for messages."""
        signs = {">": self.above, ">=": self.least, "<=": self.most}
        bounds = [f"{sign} {bound:g}" for sign, bound in signs.items() if bound is not None]
        unit = f"in {self.unit}" if self.unit else "without unit"
        return f"{self.count} {unit}" + (f", {' and '.join(bounds)}" if bounds else "")

    def is_possible(self, value: float) -> bool:
        return abs(value) <= LARGEST and not (
            (self.above is not None and not value > self.above)
            or (self.least is not None and not value >= self.least)
            or (self.most is not None and not value <= self.most)
        )

    def is_usual(self, value: float) -> bool:
        return self.usual is None or value == 0 or self.usual[0] <= abs(value) <= self.usual[1]

    def meant(self, value: float) -> tuple[str, float] | None:
        """The unit in which an unusual value would be a usual one, and its size in our unit."""
        if self.is_usual(value):
            return None
        others = _OTHER_UNITS.get(self.unit, ())
        return next((one for one in others if self.is_usual(value * one[1]) and self.is_possible(value * one[1])), None)

    def doubt(self, value: float) -> str:
        """Message on an unusual value, with the unit that was probably meant."""
        text = f"{value:g} {self.unit}".rstrip()
        if meant := self.meant(value):
            return f"{text}: is this {meant[0]}?"
        low, high = self.usual or (0, 0)
        return f"{text} is unusual (usual: {low:g} to {high:g} {self.unit})".replace(" )", ")")
