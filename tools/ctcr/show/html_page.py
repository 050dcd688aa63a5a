"""Parts of a report: one HTML page that needs nothing else, no network and no other file."""

from collections.abc import Iterable, Sequence
from datetime import date
from importlib.resources import files
from typing import Any

from ctcr.show.style import colours, draw
from ctcr.show.wording import as_html

HOW_TO_TURN = (
    "Drag to turn. Click, then scroll, or pinch to zoom. Double-click to return. Click a name to hide it or to show it."
)


def page(title: str, sections: Iterable[str], footer: str, command: str, reload_s: int = 0) -> str:
    """The whole HTML text.

    title     plain text, the heading of the page
    sections  HTML by the functions below; empty ones are left out
    footer    plain text: the sources of the page; `command` made it
    reload_s  interval at which the browser reloads the page; 0: never
    """
    title = as_html(title)
    reload = f'<meta http-equiv="refresh" content="{reload_s}">' if reload_s else ""
    style, script = ((files("ctcr.show") / f"html_page.{kind}").read_text(encoding="utf-8") for kind in ("css", "js"))
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
        + f"<footer>{as_html(footer)}. Made by {command} on {date.today().isoformat()}.</footer>"
        + f"<script>{script}</script></body></html>\n"
    )


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
    return (
        '<div class="numbers">'
        + "".join(
            f'<div class="number {kind}"><b>{as_html(value)}</b><span>{as_html(text)}</span></div>'
            for kind, value, text in numbers
        )
        + "</div>"
    )


def bullets(lines: Iterable[str]) -> str:
    return '<ul class="limits">' + "".join(f"<li>{as_html(line)}</li>" for line in lines) + "</ul>"


def figure(plot: Any, subject: Any, width: float, height: float, caption: str, wide: bool = False) -> str:
    """A picture of `subject` with its caption; empty where there is nothing to draw."""
    drawn = draw(plot, subject, width, height)
    kind = ' class="wide"' if wide else ""
    return f"<figure{kind}>{drawn}<figcaption>{as_html(caption)}</figcaption></figure>" if drawn else ""


def table(caption: str, columns: Sequence[str], rows: Iterable[Sequence[str]], text_columns: int) -> str:
    """The first columns are text, the others numbers."""

    def cell(tag: str, index: int, value: str) -> str:
        kind = ' class="text"' if index < text_columns else ""
        return f"<{tag}{kind}>{as_html(value)}</{tag}>"

    head = "".join(cell("th", i, name) for i, name in enumerate(columns))
    body = "".join("<tr>" + "".join(cell("td", i, v) for i, v in enumerate(row)) + "</tr>" for row in rows)
    return (
        f'<div class="scroll"><table><caption>{as_html(caption)}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )
