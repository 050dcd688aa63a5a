"""The columns of a log in use, as numbers in SI units, with what was guessed and noted on the way."""

import numpy as np

from ctcr.arrays import Array
from ctcr.errors import Problem
from ctcr.intake import fields, units
from ctcr.intake.choices import Choices
from ctcr.intake.log import Log
from ctcr.intake.mapping import Mapping
from ctcr.intake.names import quantity
from ctcr.intake.units import Unit, named
from ctcr.table.csv_table import Faults

LONGEST_M = 3.0  # of a joint or a position: larger numbers are millimetres
STRONGEST_N = 10.0  # at the tip of a robot of this kind: larger numbers are in another unit
RAD_UP_TO, DEG_FROM = 1.01 * 2 * np.pi, 4 * np.pi  # between them, angles without a unit may be either


class Columns:
    """Gives numbers by role; collects faults of fields, notes, and the units of all that was read."""

    def __init__(self, log: Log, mapping: Mapping, choices: Choices, beside: bool = False):
        self.log, self.mapping, self.choices = log, mapping, choices
        self.beside = beside  # whether another log has a part: a choice of units may concern that one
        self.faults, self.notes = Faults(str(log.path)), [*log.notes, *mapping.notes]
        self.doubts: list[Problem] = []
        self.units: dict[str, tuple[Unit, str]] = {}  # of each role, and how it is known

    def values(self, role: str) -> Array:
        """The numbers (M,) of a role as they stand in the log."""
        return fields.numbers(self.log, self.mapping.used[role].column, self.choices.missing, self.faults)

    def has(self, role: str) -> bool:
        return role in self.mapping.used

    @property
    def unused(self) -> list[str]:
        """Names of the columns without a role."""
        used = {one.column for one in self.mapping.used.values()}
        return [name for i, name in enumerate(self.log.names) if i not in used]

    def name(self, role: str) -> str:
        """The column of a role, for errors."""
        column = self.mapping.used[role].name if self.has(role) else role
        return column if column.startswith(role) else f"{column} ({role})"

    def si(self, group: str, roles: list[str], guess) -> Array:
        """The columns (M, roles) of a group in SI units; `guess(largest size)` is the unit where none is stated."""
        raw = {role: self.values(role) for role in roles}
        silent = [role for role in roles if self._stated(role, group) is None]
        largest = max((np.nanmax(np.abs(raw[role]), initial=0.0) for role in silent), default=0.0)
        guessed = (guess(float(largest)), "values") if silent else None
        for role in roles:
            self.units[role] = self._stated(role, group) or guessed
        return np.column_stack([raw[role] * self.units[role][0].size for role in roles])

    def _stated(self, role: str, group: str) -> tuple[Unit, str] | None:
        for key in (role, group):
            if key in self.choices.units:
                kind = quantity(role.removeprefix("ref_")) or "length"
                return units.parsed(self.choices.units[key], kind, f"--unit {key}"), "option"
        unit = self.mapping.used[role].unit
        return (unit, self.mapping.used[role].how) if unit else None


def length_unit(size: float) -> Unit:
    """The unit of lengths up to `size`."""
    return named("mm" if size > LONGEST_M else "m")


def angle_unit(size: float) -> Unit:
    """The unit of angles up to `size`."""
    return named("deg" if size > RAD_UP_TO else "rad")
