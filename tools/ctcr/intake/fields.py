"""Fields of a log as numbers: words for what is missing, decimal commas, clocks."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np

from ctcr.arrays import Array, Mask
from ctcr.errors import shown
from ctcr.frames import BEYOND
from ctcr.intake.log import Log
from ctcr.intake.units import CLOCK, Unit, named, parsed
from ctcr.table.csv_table import Faults

MISSING = {"", "nan", "na", "n/a", "#n/a", "#nv", "none", "null", "nil", "-", "--", "---", "missing", "miss", "invalid"}
MISSING |= {"?", ".", "*", "n.a.", "n.d.", "nd", "<na>", "<none>"}
MISSING |= {"disabled", "lost", "out of volume", "not visible", "nat", "inf", "-inf", "+inf", "<null>", "undefined"}
_NOT_A_NUMBER = re.compile(r"[-+]?(nan(\(\w*\))?|1\.#[a-z]+\d*)")  # as C and Windows write it: nan(ind), -1.#IND
_FORTRAN = re.compile(r"([-+]?[\d.]+)[dD]([-+]?\d+)")  # 1.0D+02
SEEN_WORDS = {"ok", "1", "1.0", "true", "yes", "valid", "visible", "tracked", "seen", "enabled", "good"}
STAMP_S = 1e6  # times beyond it are stamps: the table's clock begins with its first row
# numbers beyond these are stamps in this unit since 1970; in 100 ns, since 1601 or 1, as Windows and .NET count
_STAMPS = ((1e18, "ns"), (1e17, "100ns"), (1e14, "us"), (1e11, "ms"))
_DATES = ((25569, 73050), (719529, 767010))  # 1970 to 2100 in days, as spreadsheets and MATLAB count them
_CLOCKS = ("%H:%M:%S.%f", "%H:%M:%S", "%I:%M:%S.%f %p", "%I:%M:%S %p")
_DAYS = ("%d-%b-%Y", "%Y/%m/%d", "%Y_%m_%d", "%d.%m.%Y", "%m/%d/%Y", "%d/%m/%Y", "%d.%m.%y", "%m/%d/%y", "%d/%m/%y")
_ISO, _MINUTES = "ISO", "%M:%S.%f"
_FORMATS = (_ISO, *(f"{day} {clock}" for day in _DAYS for clock in _CLOCKS), *_CLOCKS, _MINUTES)
_UNDERSTOOD = "2026-05-04 10:15:30.25, 04.05.2026 10:15:30, 5/4/26 10:15:30 AM, 10:15:30.25 or, with minutes, 15:30.25"


def numbers(log: Log, column: int, words: Iterable[str], faults: Faults) -> Array:
    """A column as numbers (M,), NaN where a word or number for missing stands. Text goes to `faults` with its row."""
    raw = log.values[column]
    values = np.asarray(raw, dtype=float) if isinstance(raw, np.ndarray) else _floats(log, column, raw, words, faults)
    absent = [float(word.replace(",", ".")) for word in words if _is_number(word, decimal_comma=True)]
    return np.where((np.abs(values) < BEYOND) & ~np.isin(values, absent), values, np.nan)  # infinities and NaN too


def _floats(log: Log, column: int, raw: list[str], words: Iterable[str], faults: Faults) -> Array:
    def pointed(text: str) -> str:
        text = text.replace("−", "-")
        return text.replace(",", ".") if log.decimal_comma else text

    fields = pointed("\n".join(raw)).split("\n")  # at once: fast
    if len(fields) != len(raw):  # some hold several lines
        fields = [pointed(text) for text in raw]
    try:
        return np.fromiter(map(float, fields), float, count=len(fields))
    except ValueError:
        pass
    values, wrong = np.full(len(fields), np.nan), np.zeros(len(fields), dtype=bool)
    for i, text in enumerate(fields):
        try:
            values[i] = float(_FORTRAN.sub(r"\1e\2", text))
        except ValueError:
            wrong[i] = not _is_missing(text, words)
    faults.where(wrong, log.rows, log.names[column], "number", lambda i: f"{shown(raw[i])} {_no_number(raw[i])}")
    return values


def _no_number(text: str) -> str:
    """Why a text is no number."""
    digits, unit = re.fullmatch(r"\s*([-+\d.,]*)\s*(.*?)\s*", text, re.DOTALL).groups()
    if text.strip()[:1] in ("[", "("):
        return "holds several numbers: give each a column of its own"
    if digits and named(unit):
        return "holds its unit: write it into the name of the column, such as beta1 [mm], and the number alone here"
    if digits and not unit:
        return "is not a number: it has separators of thousands, or another decimal sign than other columns"
    return "is not a number: is it a word for missing? --missing WORD"


def _word(text: str) -> str:
    return text.strip().strip("\"'").strip().lower()


def _is_missing(text: str, words: Iterable[str] = ()) -> bool:
    word = _word(text)
    return word in MISSING or bool(_NOT_A_NUMBER.fullmatch(word)) or word in (one.strip().lower() for one in words)


def is_text(log: Log, column: int) -> bool:
    """Whether no field of a column is a number, though some are filled."""
    raw = log.values[column]
    if isinstance(raw, np.ndarray):
        return False
    filled = [text for text in raw[:50] if not _is_missing(text)]
    return bool(filled) and not any(_is_number(text, log.decimal_comma) for text in filled)


def _is_number(text: str, decimal_comma: bool) -> bool:
    try:
        float(_FORTRAN.sub(r"\1e\2", text.replace(",", ".") if decimal_comma else text))
    except ValueError:
        return False
    return True


def seen(log: Log, column: int) -> Mask:
    """Whether the tracker says that it saw a marker (M,)."""
    raw = log.values[column]
    if isinstance(raw, np.ndarray):
        return np.asarray(raw, dtype=float) > 0
    return np.array([_word(text) in SEEN_WORDS for text in raw])


def labels(log: Log, column: int, words: Iterable[str], faults: Faults) -> tuple[Array, list[str]]:
    """Numbers of runs (M,), NaN where one is missing; texts are numbered in their order, and returned in it."""
    raw = log.values[column]
    if isinstance(raw, np.ndarray):
        return numbers(log, column, words, faults), []
    filled = [text for text in raw if not _is_missing(text, words)]
    if filled and all(_is_number(text, log.decimal_comma) for text in filled):
        return numbers(log, column, words, faults), []
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


def times(
    log: Log, column: int, unit: Unit | None, words: Iterable[str], faults: Faults, day: int | None = None
) -> Times:
    """The times of a column. Stamps and clocks are counted from the first row, other times are kept.

    day    the column that holds the days of a clock
    """
    if (unit and unit.is_clock) or (unit is None and is_text(log, column)):
        seconds, start, zero = _clock(log, column, words, faults, day)
        return Times(seconds, zero, named(CLOCK), unit is None, start)
    exact = _whole(log, column)
    values = numbers(log, column, words, faults) if exact is None else exact.astype(float)
    finite = values[np.isfinite(values)]
    size = np.median(np.abs(finite)) if len(finite) else 0.0
    known = unit or parsed(next((name for least, name in _STAMPS if size > least), "s"), "time", "")
    if unit is None and any(first <= size <= last for first, last in _DATES) and np.ptp(finite) < 1:
        text = f"{finite[0]:.15g} may be days since an epoch, or seconds: say it with --unit t=day or --unit t=s"
        faults.add(int(log.rows[0]), log.names[column], text)
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


def is_day_of_clock(log: Log, day: int, clock: int) -> bool:
    """Whether a column holds the days of a clock, another column of times without days."""
    if not (is_text(log, day) and is_text(log, clock)):
        return False
    alone, dated = (next(filter(None, _clock_texts(log, clock, with_day)), "") for with_day in (None, day))
    is_clock = any(_moment(alone, form) for form in (*_CLOCKS, _MINUTES))
    return is_clock and any(_moment(dated, form) for form in _FORMATS)


def _clock_texts(log: Log, column: int, day: int | None) -> list[str]:
    """The texts of a clock, each behind its date where another column holds that."""
    raw = [_stripped(text) for text in log.values[column]]
    if day is None:
        return raw
    return [f"{_stripped(date)} {text}" if text else "" for date, text in zip(log.values[day], raw, strict=True)]


def _stripped(text: str) -> str:
    return text.strip().strip("\"'")


def _clock(log: Log, column: int, words: Iterable[str], faults: Faults, day: int | None) -> tuple[Array, str, float]:
    """Times since the first one [s], that one as it stands there, and it in seconds since 1970."""
    raw = _clock_texts(log, column, day)
    filled = [text for text in raw if not _is_missing(text, words)] or [""]
    first = filled[0]
    forms = [form for form in _FORMATS if _moment(first, form)]
    form = min(forms, key=lambda form: _length(form, first, filled[-1]), default=_ISO)
    start, turn = _moment(first, form), timedelta(hours=1 if form == _MINUTES else 24)
    wrong, seconds, days, last = np.zeros(len(raw), dtype=bool), np.full(len(raw), np.nan), timedelta(), None
    for i, text in enumerate(raw):
        moment = _moment(text, form)
        if start is None or moment is None or (moment.tzinfo is None) != (start.tzinfo is None):
            wrong[i] = not _is_missing(text, words)
            continue
        if moment.year == 1900 and last is not None and moment + days < last - turn / 2:
            days += turn  # a clock without days at midnight, one without hours at the full hour
        last = moment + days
        seconds[i] = (last - start).total_seconds()
    like = f"such as {first}" if start else f"that is understood: {_UNDERSTOOD}, or a number with --unit t=s"
    faults.where(wrong, log.rows, log.names[column], "time", lambda i: f"{shown(raw[i])} is no time {like}")
    zero = (
        (start.replace(tzinfo=start.tzinfo or UTC) - datetime.fromtimestamp(0, UTC)).total_seconds() if start else 0.0
    )
    return seconds, first, zero


def _length(form: str, first: str, last: str) -> timedelta:
    """How long a log would last, if its times had a format; of two orders of day and month the right one is shorter."""
    start, end = (_moment(text, form) for text in (first, last))
    return abs(end.replace(tzinfo=None) - start.replace(tzinfo=None)) if end else timedelta.max


def _moment(text: str, form: str) -> datetime | None:
    """The time of a text; None where it has another format."""
    text = re.sub(r"(?<=[ T_]\d\d)-(\d\d)-(\d\d)", r":\1:\2", text)  # 14-03-31 after a date
    text = re.sub(r"(:\d\d)(?:[.,]|(?<=:\d\d:\d\d):)(\d{1,6})\d*", r"\1.\2", text)  # a fraction as datetime reads it
    try:
        return datetime.fromisoformat(text) if form == _ISO else datetime.strptime(text, form)
    except ValueError:
        return None
