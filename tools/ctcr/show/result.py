"""How results show themselves: a line, a small table in a notebook, a DataFrame, a page, a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ctcr.errors import InputError, Problem
from ctcr.show.output import write_text
from ctcr.show.wording import as_html, visible

if TYPE_CHECKING:
    from pandas import DataFrame

    from ctcr.show.style import Picture

# Colours of text and background are those of the notebook, light or dark.
_CELL = "padding:.15em .8em;text-align:{};border-bottom:1px solid rgba(128,128,128,.35)"


@dataclass(frozen=True)
class Glance:
    """A result at a glance: one line, and a small table whose first columns are text."""

    line: str
    columns: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()
    text_columns: int = 1
    warnings: Sequence[str] = ()  # without which the line would mislead: below it everywhere, a line each


class Shown:
    """Base of what has a line as its repr, with its warnings below it, and a small table in notebooks."""

    def glance(self) -> Glance:
        """The line and the table that stand for it."""
        raise NotImplementedError

    def __repr__(self) -> str:
        shown = self.glance()
        return "\n".join([f"<{visible(shown.line)}>", *map(visible, shown.warnings)])

    __str__ = __repr__

    def _repr_html_(self) -> str:
        shown = self.glance()
        head = _row("th", shown.columns, shown.text_columns)
        body = "".join(_row("td", row, shown.text_columns) for row in shown.rows)
        table = f'<table style="border-collapse:collapse">{head}{body}</table>' if shown.rows else ""
        notes = "".join(f"<div>{as_html(note)}</div>" for note in dict.fromkeys([*shown.warnings, *shown.notes]))
        return f"<div>{as_html('', bold=shown.line)}{table}{notes}</div>"


class Result(Shown):
    """The result of a comparison or a fit. A subclass names the module of its page and its picture."""

    PAGE: ClassVar[str] = ""  # page(result) is a function of this module below ctcr
    PICTURE: ClassVar[tuple[str, str, float, float]]  # a module, its function, width and height [in]

    def report(self, path: str | Path) -> None:
        """Writes the page that the command's --report writes: one HTML file that needs no network."""
        write_text(import_module(f"ctcr.{self.PAGE}").page(self), path)

    def plot(self) -> Picture:
        """Its main picture, a matplotlib figure; `savefig` writes it."""
        module, function, width, height = self.PICTURE
        draw = getattr(import_module(f"ctcr.{module}"), function)
        return picture(draw, self, width, height)


def picture(draw: Any, subject: Any, width: float, height: float) -> Picture:
    """A matplotlib figure, `width` by `height` inches. Raises InputError where there is nothing to draw."""
    made = import_module("ctcr.show.style").picture(draw, subject, width, height)  # matplotlib loads only here
    if made is None:
        raise InputError(Problem("there is nothing to draw"))
    return made


def frame(columns: Mapping[str, Any]) -> DataFrame:
    """A DataFrame. Raises InputError without pandas, which nothing else here needs."""
    try:
        import pandas
    except ModuleNotFoundError:
        raise InputError(Problem("a DataFrame needs pandas: install it, or ctcr with its extra `pandas`")) from None
    return pandas.DataFrame(dict(columns))


def _row(tag: str, cells: Sequence[str], text_columns: int) -> str:
    side = ["left" if i < text_columns else "right" for i in range(len(cells))]
    shown = (f'<{tag} style="{_CELL.format(s)}">{as_html(cell)}</{tag}>' for s, cell in zip(side, cells, strict=True))
    return f"<tr>{''.join(shown)}</tr>"
