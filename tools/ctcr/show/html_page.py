"""Parts of a report: one HTML page that needs nothing else, no network and no other file."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from importlib import import_module, resources
from importlib.metadata import version
from typing import Any

import click

from ctcr import inputs
from ctcr.errors import InputError
from ctcr.show.palette import colours
from ctcr.show.wording import as_html

SHORT = 12  # digits of a fingerprint that a page shows
HOW_TO_TURN = (
    "Drag to turn. Click, then scroll, or pinch to zoom. Double-click to return. Click a name to hide it or to show it."
)


def page(title: str, sections: Iterable[str], files: Sequence[str] = (), reload_s: int = 0) -> str:
    """The whole HTML text.

    title     plain text, the heading of the page
    sections  HTML by the functions below; empty ones are left out
    files     input files that it is made from, whose fingerprints it ends with, as with those of users' effects
    reload_s  interval at which the browser reloads the page; 0: never
    """
    title = as_html(title)
    reload = f'<meta http-equiv="refresh" content="{reload_s}">' if reload_s else ""
    style, script = (
        (resources.files("ctcr.show") / f"html_page.{kind}").read_text(encoding="utf-8") for kind in ("css", "js")
    )
    style = (
        f":root {{ {colours(dark=False)} }}\n"
        f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {colours(dark=True)} }} }}\n{style}"
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"{reload}"
        f"<title>{title}</title><style>{style}</style></head><body><h1>{title}</h1>"
        + "\n".join(filter(None, sections))
        + _footer(files)
        + f"<script>{script}</script></body></html>\n"
    )


def _footer(files: Sequence[str]) -> str:
    """The version, the day, the command line where there is one, and each input file with its fingerprint."""
    context = click.get_current_context(silent=True)
    given = context and context.find_root().obj
    made = f"Made by ctcr {version('ctcr')} on {date.today().isoformat()}"
    way = paragraph(f"{made}:") + command(shlex.join(["ctcr", *given])) if given else paragraph(f"{made} in Python.")
    rows = [[file, _digits(file)] for file in dict.fromkeys([*files, *inputs.shared])]
    read = table(
        "Input files", {"file": "", "SHA-256": f"the first {SHORT} digits; sha256sum FILE prints all of them"}, rows, 2
    )
    return f"<footer>{way}{read if rows else ''}</footer>"


def _digits(file: str) -> str:
    try:
        return inputs.fingerprint(file)[:SHORT]
    except InputError:  # a robot of a program may bear the name of a file that was never written
        return "not read"


def view(drawing: str, caption: str) -> str:
    """A 3-D view: `drawing` is the JSON of `scene.view`."""
    text = drawing.replace("<", "\\u003c")  # in JSON they stand in strings only; no text may end or open a script
    return (
        f'<figure class="view"><script type="application/json">{text}</script>'
        f"<noscript>This view needs JavaScript.</noscript>"
        f"<figcaption>{as_html(f'{caption} {HOW_TO_TURN}')}</figcaption></figure>"
    )


def command(text: str) -> str:
    """A command line, with a button that copies it."""
    return f'<div class="command"><code>{as_html(text)}</code></div>'


def paragraph(text: str, kind: str = "", bold: str = "") -> str:
    """Plain text; `kind`: lead or soft, a class of the style sheet."""
    return f'<p class="{kind}">{as_html(text, bold)}</p>' if kind else f"<p>{as_html(text, bold)}</p>"


def cards(numbers: Iterable[tuple[str, str, str]]) -> str:
    """Large numbers side by side: (kind, value, meaning)."""
    shown = "".join(
        f'<div class="number {kind}"><b>{as_html(value)}</b><span>{as_html(text)}</span></div>'
        for kind, value, text in numbers
    )
    return f'<div class="numbers">{shown}</div>'


def bullets(lines: Iterable[str]) -> str:
    return '<ul class="limits">' + "".join(f"<li>{as_html(line)}</li>" for line in lines) + "</ul>"


def figure(plot: Any, subject: Any, width: float, height: float, caption: str, wide: bool = False) -> str:
    """A picture of `subject` with its caption; empty where there is nothing to draw."""
    # matplotlib loads only where something is drawn.
    drawn = import_module("ctcr.show.style").draw(plot, subject, width, height)
    kind = ' class="wide"' if wide else ""
    return f"<figure{kind}>{drawn}<figcaption>{as_html(caption)}</figcaption></figure>" if drawn else ""


def table(
    caption: str, columns: Sequence[str] | Mapping[str, str], rows: Iterable[Sequence[str]], text_columns: int
) -> str:
    """The first columns are text, the others numbers. `columns` may hold what each means: shown below and on hover."""
    meanings = {name: text for name, text in columns.items() if text} if isinstance(columns, Mapping) else {}

    def cell(tag: str, index: int, value: str) -> str:
        kind = ' class="text"' if index < text_columns else ""
        meaning = f' title="{as_html(meanings[value])}"' if tag == "th" and value in meanings else ""
        return f"<{tag}{kind}{meaning}>{as_html(value)}</{tag}>"

    head = "".join(cell("th", i, name) for i, name in enumerate(columns))
    body = "".join("<tr>" + "".join(cell("td", i, v) for i, v in enumerate(row)) + "</tr>" for row in rows)
    below = "; ".join(as_html(f": {text}", bold=name) for name, text in meanings.items())
    return (
        f'<div class="scroll"><table><caption>{as_html(caption)}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
        + (f'<p class="soft">{below}.</p>' if below else "")
    )
