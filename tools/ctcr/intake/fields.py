"""Fields of a log as numbers: words for what is missing, decimal commas, clocks."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np

from ctcr.arrays import Array, Mask
from ctcr.errors import shown
from ctcr.intake.log import Log
from ctcr.intake.units import CLOCK, Unit, named
from ctcr.table.csv_table import Faults

MISSING = {"", "nan", "na", "n/a", "#n/a", "#nv", "none", "null", "nil", "-", "--", "---", "missing", "miss", "invalid"}
MISSING |= {"disabled", "lost", "out of volume", "not visible", "nat", "inf", "-inf", "+inf", "<null>", "undefined"}
SEEN_WORDS = {"ok", "1", "1.0", "true", "yes", "valid", "visible", "tracked", "seen", "enabled", "good"}
BEYOND = 1e20  # trackers write numbers beyond it, such as -3.697314e28, where they see nothing
STAMP_S = 1e6  # times beyond it are stamps: the table's clock begins with its first row
_STAMPS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))  # numbers beyond these are stamps since 1970 in this unit
_CLOCKS = ("%H:%M:%S.%f", "%H:%M:%S", "%I:%M:%S.%f %p", "%I:%M:%S %p")
_DAYS = ("%d-%b-%Y", "%Y/%m/%d", "%Y_%m_%d", "%d.%m.%Y", "%m/%d/%Y", "%d/%m/%Y")
_FORMATS = (*(f"{day} {clock}" for day in _DAYS for clock in _CLOCKS), *_CLOCKS)


def numbers(log: Log, column: int, words: Iterable[str], faults: Faults) -> Array:
    """A column as numbers (M,), NaN where a word or number for missing stands. Text goes to `faults` with its row."""
    raw = log.values[column]
    values = np.asarray(raw, dtype=float) if isinstance(raw, np.ndarray) else _floats(log, column, raw, words, faults)
    return np.where(np.abs(values) < BEYOND, values, np.nan)  # infinities and NaN too


def _floats(log: Log, column: int, raw: list[str], words: Iterable[str], faults: Faults) -> Array:
    texts = "\n".join(raw).replace("−", "-")
    if log.decimal_comma:
        texts = texts.replace(",", ".")
    fields = texts.split("\n") if len(raw) == texts.count("\n") + 1 else raw
    try:
        return np.fromiter(map(float, fields), float, count=len(fields))
    except ValueError:
        pass
    missing = MISSING | {word.strip().lower() for word in words}
    values, wrong = np.full(len(fields), np.nan), np.zeros(len(fields), dtype=bool)
    for i, text in enumerate(fields):
        try:
            values[i] = float(text)
        except ValueError:
            wrong[i] = _word(text) not in missing
    hint = ": is it a word for missing? --missing WORD"
    faults.where(wrong, log.rows, log.names[column], "number", lambda i: f"{shown(raw[i])} is not a number{hint}")
    return values


def _word(text: str) -> str:
    return text.strip().strip("\"'").strip().lower()


def is_text(log: Log, column: int) -> bool:
    """Whether no field of a column is a number, though some are filled."""
    raw = log.values[column]
    if isinstance(raw, np.ndarray):
        return False
    filled = [text for text in raw[:50] if _word(text) not in MISSING]
    return bool(filled) and not any(_is_number(text, log.decimal_comma) for text in filled)


def _is_number(text: str, decimal_comma: bool) -> bool:
    try:
        float(text.replace(",", ".") if decimal_comma else text)
    except ValueError:
        return False
    return True


def seen(log: Log, column: int) -> Mask:
    """Whether the tracker says that it saw a marker (M,)."""
    raw = log.values[column]
    if isinstance(raw, np.ndarray):
        return np.asarray(raw, dtype=float) > 0
    return np.array([_word(text) in SEEN_WORDS for text in raw])


def tells_seen(log: Log, column: int) -> bool:
    """Whether a column of states has a word or number for seen: else its words mean something else."""
    return bool(seen(log, column).any())


def labels(log: Log, column: int, faults: Faults) -> tuple[Array, list[str]]:
    """Numbers of runs (M,); texts are numbered in their order, and returned in it."""
    raw = log.values[column]
    if isinstance(raw, np.ndarray) or all(_is_number(text, log.decimal_comma) for text in raw):
        return numbers(log, column, (), faults), []
    texts = [text.strip() for text in raw]
    named_in_order = list(dict.fromkeys(texts))
    place = {text: float(i) for i, text in enumerate(named_in_order)}
    return np.array([place[text] for text in texts]), named_in_order


@dataclass(frozen=True)
class Times:
    """Times of a column."""

    seconds: Array  # (M,) [s]
    zero: float  # what the log's clock showed at zero [s]
    unit: Unit
    guessed: bool  # whether the unit is guessed from the numbers
    start: str  # what stood there at zero, "" where that is zero too


def times(log: Log, column: int, unit: Unit | None, words: Iterable[str], faults: Faults) -> Times:
    """The times of a column. Stamps and clocks are counted from the first row, other times are kept."""
    if (unit and unit.is_clock) or (unit is None and is_text(log, column)):
        seconds, start, zero = _clock(log, column, words, faults)
        return Times(seconds, zero, named(CLOCK), unit is None, start)
    exact = _whole(log, column)
    values = numbers(log, column, words, faults) if exact is None else exact.astype(float)
    finite = values[np.isfinite(values)]
    size = np.median(np.abs(finite)) if len(finite) else 0.0
    known = unit or named(next((name for least, name in _STAMPS if size > least), "s"))
    if not len(finite) or abs(finite[0] * known.size) <= STAMP_S:
        return Times(values * known.size, 0.0, known, unit is None, "")
    since = values - finite[0] if exact is None else (exact - exact[0]).astype(float)
    start = repr(float(finite[0])) if exact is None else str(exact[0])
    return Times(since * known.size, float(finite[0]) * known.size, known, unit is None, f"{start} {known.text}")


def _whole(log: Log, column: int):
    """Whole numbers exactly: nanoseconds since 1970 have more digits than a float."""
    raw = log.values[column]
    if isinstance(raw, np.ndarray):
        return raw.astype(np.int64) if raw.dtype.kind in "iu" else None
    if not raw or not re.fullmatch(r"\s*\d{15,19}\s*", raw[0]):
        return None
    try:
        return np.array([int(text) for text in raw], dtype=np.int64)
    except (ValueError, OverflowError):
        return None


def _clock(log: Log, column: int, words: Iterable[str], faults: Faults) -> tuple[Array, str, float]:
    """Times since the first one [s], that one as it stands there, and it in seconds since 1970."""
    raw = [text.strip().strip("\"'") for text in log.values[column]]
    missing = MISSING | {word.strip().lower() for word in words}
    first = next((text for text in raw if _word(text) not in missing), "")
    read = next((reader for reader in _readers() if _try(reader, first)), None)
    start = _try(read, first) if read else None
    wrong, seconds, days, last = np.zeros(len(raw), dtype=bool), np.full(len(raw), np.nan), timedelta(), None
    for i, text in enumerate(raw):
        moment = _try(read, text) if read else None
        if moment is None or (moment.tzinfo is None) != (start.tzinfo is None):
            wrong[i] = _word(text) not in missing
            continue
        if moment.year == 1900 and last is not None and moment + days < last - timedelta(hours=12):
            days += timedelta(days=1)  # a clock without days at midnight
        last = moment + days
        seconds[i] = (last - start).total_seconds()
    faults.where(wrong, log.rows, log.names[column], "time", lambda i: f"{shown(raw[i])} is no time such as {first}")
    zero = (
        (start.replace(tzinfo=start.tzinfo or UTC) - datetime.fromtimestamp(0, UTC)).total_seconds() if start else 0.0
    )
    return seconds, first, zero


def _readers():
    yield datetime.fromisoformat
    for form in _FORMATS:
        yield lambda text, form=form: datetime.strptime(_six_digits(text), form)


def _six_digits(text: str) -> str:
    """A fraction of a second as datetime reads it: a point, at most six digits."""
    return re.sub(r"(:\d\d)[.,](\d{1,6})\d*", r"\1.\2", text)


def _try(reader, text: str) -> datetime | None:
    try:
        return reader(text)
    except ValueError:
        return None
