"""The summary of an import: the meaning that each column was given, and the choices for the next log."""

from collections.abc import Sequence
from dataclasses import dataclass

from ctcr.intake.bodies import EULER, GRID, QUATERNION, SEQUENCE, TRANSLATION
from ctcr.intake.choices import Choices, grouped
from ctcr.intake.columns import Columns
from ctcr.intake.sensor import MATRIX
from ctcr.table import measurements

_HOW = {"format": "stated", "name": "guessed: name", "option": "option"}
_UNIT_HOW = {"values": "guessed: unit", "option": "unit: option"}
_OTHER = {"seen": "whether the pose counts", "date": "t_s (the day)", "nsec": "t_s (below 1 s)", "weight": "fx_N..fz_N"}
_OURS = {name.partition("_")[0]: name for name in measurements.column_names(9)}


@dataclass(frozen=True)
class Row:
    """A column of the log, its unit, what it becomes and how that is known."""

    column: str
    unit: str
    becomes: str
    how: str


def rows(columns: Columns) -> list[Row]:
    """All columns in use, in the order of the log."""
    shown = []
    for role, used in sorted(columns.mapping.used.items(), key=lambda item: item[1].column):
        unit, known = columns.units.get(role) or columns.units.get(MATRIX if role in TRANSLATION else "", (None, ""))
        how = "our format" if used.how == "name" and used.name == _OURS.get(role) else _HOW[used.how]
        also = _UNIT_HOW.get(known, "") if known != used.how else ""
        said = f"{how}, unit" if how == _HOW["name"] and known == "values" else f"{how}, {also}".strip(", ")
        shown.append(Row(used.name, unit.text if unit else "", _becomes(role, columns.choices.quaternion), said))
    return shown


def _becomes(role: str, quaternion: str | None) -> str:
    plain = role.removeprefix("ref_")
    if quaternion == "xyzw" and plain in QUATERNION:  # a role is then a place in that order
        plain = f"q{quaternion[QUATERNION.index(plain)]}"
    if plain in _OTHER:
        name = _OTHER[plain]
    elif plain in EULER or plain in GRID:
        name = "qw..qz"
    elif plain in SEQUENCE or plain in TRANSLATION:
        name = "x_m..qz" if plain in SEQUENCE else f"{'xyz'[TRANSLATION.index(plain)]}_m"
    else:
        name = _OURS[plain]
    return f"reference: {name}" if role.startswith("ref_") else name


def resolved(choices: Choices, sources: Sequence[Columns]) -> Choices:
    """The choices with the columns and units that were found: the next log decides nothing by its numbers.

    The unit of times is kept where all logs have the same.
    """
    columns = {role: used.name for source in sources for role, used in source.mapping.used.items()}
    columns |= {role: name for role, name in choices.columns.items() if role == "t"}  # of one of two logs
    units = dict(choices.units)
    for source in sources:
        for role, (unit, _) in source.units.items():
            key = "position" if role == MATRIX else role
            if not key.startswith("ref_"):
                units.setdefault(key, unit.text)
    if len({source.units["t"][0] for source in sources if "t" in source.units}) > 1 and "t" not in choices.units:
        units.pop("t")
    settled = {"order": None, "sensor": None, "relative_to": None}  # the columns say it
    return choices.model_copy(update={"columns": columns, "units": grouped(units)} | settled)
