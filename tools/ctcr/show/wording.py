"""Numbers, names and lists as messages and pages show them."""

import html
from collections.abc import Iterable, Sequence
from math import isfinite, nan
from typing import Any

NAMED = 6  # rows, runs and the like that a sentence names: more are not read


def visible(text: str) -> str:
    """The text on one line, with an escape such as \\x1b for all that does not print.

    It can neither act on a terminal nor hide.
    """

    def shown(letter: str) -> str:
        if letter.isprintable():
            return letter
        return " " if letter.isspace() else letter.encode("unicode_escape").decode()

    return "".join(map(shown, text))


def as_html(text: str, bold: str = "") -> str:
    """Plain text after a beginning in bold: here, and nowhere else, names of the user's become HTML."""
    return (f"<b>{as_html(bold)}</b>" if bold else "") + html.escape(visible(text))


def sentence(text: str) -> str:
    """A notice or a warning as a sentence."""
    first = text if "." in text.split()[0] else text[0].upper() + text[1:]  # a parameter keeps its name
    return first + ("" if text.endswith(".") else ".")


def short(value: float) -> str:
    """An error in two or three digits: 1.36, 0.93, 0.10, 0.061."""
    return (f"{value:#.3g}" if value >= 1 else f"{value:#.2g}").rstrip(".")


def number(value: float, deviation: float = nan) -> str:
    """A value to a tenth of its standard deviation, or to four digits."""
    if not isfinite(value):
        return "-"
    if not isfinite(deviation) or deviation <= 0:
        return f"{value:.4g}"
    return f"{value:.{digits(deviation)}f}"


def deviation(value: float) -> str:
    """A standard deviation to two digits."""
    return f"{value:.{digits(value)}f}" if isfinite(value) and value > 0 else "-"


def digits(deviation: float) -> int:
    """Decimals that show a standard deviation to two digits."""
    return max(0, 1 - int(f"{deviation:.1e}".partition("e")[2]))


def mm(value: float) -> str:
    """A length with its unit, to three digits at most."""
    return f"{value:.1f} mm" if value >= 10 else f"{value:.2f} mm" if value >= 0.1 else f"{value:.3f} mm"


def counted(count: int, noun: str) -> str:
    """1 row, 3 rows."""
    return f"{count} {noun}{'s' * (count != 1)}"


def times(factor: float) -> str:
    """A factor to two digits: 1.3 times, 170 times."""
    return f"{float(f'{factor:.2g}'):g} times"


def percent(share: float) -> str:
    """A fraction in percent, in two digits or as many as a whole number has: 0.62 %, 2.6 %, 120 %."""
    size = abs(share)
    return f"{100 * share:.{0 if size >= 0.1 else 1 if size >= 0.01 else 2}f} %"


def most(share: float) -> str:
    return f"{100 * share:.3g} %" if share < 0.999 else "more than 99.9 %"


def probability(value: float) -> str:
    return f"{value:.2g}" if value >= 1e-3 else "below 0.001"


def join(names: Sequence[str]) -> str:
    """All names as a part of a sentence; "" without any."""
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def runs_named(runs: Sequence[int]) -> str:
    """Runs as the subject of a sentence: run 3, or runs 2, 7."""
    return f"run{'s' * (len(runs) > 1)} {', '.join(map(str, runs))}"


def listed(items: Sequence[Any], most: int = NAMED) -> str:
    """At most `most` items, and dots where there are more."""
    return ", ".join(map(str, items[:most])) + (", ..." if len(items) > most else "")


def numbers(values: Iterable[float], digits: int = 6) -> str:
    """A list as a robot file holds it."""
    return "[" + ", ".join(f"{round(float(value), digits) + 0.0:.10g}" for value in values) + "]"
