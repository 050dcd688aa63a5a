"""Names are shown as they are written: they act on no terminal, no markup is read in them, no HTML made of them."""

import io
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import ctcr
import numpy as np
import pytest
from ctcr.robot import history, robot_file
from ctcr.show import html_page, output, pictures, scene
from ctcr.show.html_page import as_html, bullets, cards, paragraph, table
from ctcr.show.wording import percent, visible
from hypothesis import example, given, settings
from hypothesis import strategies as st

PACKAGE = Path(ctcr.__file__).parent
ROBOT = PACKAGE.parents[1] / "examples" / "robots" / "table2.yaml"
MARKUP = st.sampled_from(
    ["[red]", "[/]", "[/nope]", "[link=x]", ":warning:", "<b>", "</script>", "<!--<script>", "&amp;"]
)
CONTROL = st.sampled_from(
    ["\x1b[2J", "\x1b]0;x\a", "\x9b31m", "\r", "\n", "\x00", "\x7f", "\u202e", "\ud800", "\udcff"]
)
NAMES = st.lists(MARKUP | CONTROL | st.text(st.characters(exclude_categories=())), min_size=1, max_size=6).map("".join)
laws = settings(max_examples=200, derandomize=True, database=None, deadline=None)


def printed(what) -> str:
    """What a terminal without colours gets."""
    terminal = output.Terminal(file=io.StringIO(), width=1000, soft_wrap=True)
    terminal.print(what)
    return terminal.file.getvalue()


@laws
@given(NAMES, NAMES)
def test_visible(name, other):
    """One line, letter by letter, of letters that print; those that print already stay."""
    shown = visible(name)
    assert shown.isprintable() and visible(shown) == shown and visible(name + other) == shown + visible(other)
    assert shown == name or not name.isprintable()
    shown.encode()


@pytest.mark.parametrize("text", ["0.00 %", "0.62 %", "1.4 %", "17 %", "100 %", "120 %", "-0.50 %", "-130 %"])
def test_percent(text):
    """No part is shown as a power of ten, whether it is small, negative, or more than the whole."""
    assert percent(float(text.removesuffix(" %")) / 100) == text


@laws
@given(NAMES)
@example("[/]")
def test_terminal(name):
    """A line, and a table that holds the name everywhere."""
    assert printed(name) == visible(name) + "\n"
    made = output.table(name, [name, "x"], [[name, name]])
    lines = printed(made).splitlines()
    assert all(line.isprintable() for line in lines)
    assert "\n".join(lines).count(visible(name).strip()) >= 4


class Page(HTMLParser):
    """Tags with their attributes, texts, and scripts of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.tags, self.texts, self.scripts = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes) -> None:
        self.tags.append((tag, [pair for pair in attributes if pair[0] != "title"]))
        self.texts += [value for name, value in attributes if name == "title"]

    def handle_data(self, data) -> None:
        (self.scripts if self.tags and self.tags[-1][0] == "script" else self.texts).append(data)

    def handle_comment(self, data) -> None:
        self.texts.append(data)


def page_with(name: str) -> str:
    sections = [paragraph(name, "lead", bold=f"{name}."), cards([("good", name, name)]), bullets([name]), as_html(name)]
    view = html_page.view(scene.view([scene.layer("points", f"{name}.", np.zeros((1, 3)))]), name)
    return html_page.page(
        name, [*sections, view, html_page.command(name), table(name, {f"{name}.": f"{name}."}, [[name]], 1)]
    )


@laws
@given(NAMES)
def test_page(name):
    """Its elements do not depend on the name, which stands in it as text; the drawing gets the name itself."""
    text = page_with(name)
    page = Page(text)
    assert page.tags == Page(page_with("x")).tags
    assert text.encode() and text.replace("\n", "").isprintable()
    assert "".join(page.texts).count(visible(name)) >= 12
    drawing = page.scripts[0]
    assert json.loads(drawing)["layers"][0]["name"] == f"{name}." and "<" not in drawing


NASTY = "[red]a[/nope] $\\frac{$ :warning: <script>alert(1)</script> \x1b[2J\a\x9b \ud800"


def test_history():
    """A robot's name, and a ledger that was edited by hand, on a page with its picture."""
    robot = robot_file.load(ROBOT)
    figures = {"rms_mm": {"nominal": 2.0, NASTY: 1.0, "noise_floor": 0.1}, "added": [NASTY]}
    entry = {"date": NASTY, "command": NASTY, "sources": [{"file": NASTY}], "figures": figures}
    text = history.page(robot.model_copy(update={"name": NASTY, "history": [entry]}))
    assert text.replace("\n", "").isprintable() and "<script>alert" not in text
    assert "".join(Page(text).texts).count(visible(NASTY)) >= 6


def test_picture(tmp_path, recwarn):
    """A picture of a robot with any name."""
    robot = robot_file.load(ROBOT).model_copy(update={"name": NASTY})
    along = np.linspace(0, 0.1, 5)
    frames = np.tile(np.eye(3), (5, 1, 1))
    pictures.draw_robot(
        tmp_path / "a.png", robot, along, np.outer(along, [0, 0, 1]), frames, np.array([0.1, 0.06, 0.03])
    )
    assert not recwarn.list


# The ways out of the package: a pattern, and the modules that may use it.
DOORS = {
    r"\brich\.console import .*\bConsole\b": {"show/output.py"},
    r"\bclick\.s?echo\(": {"cli.py"},
    r"\bclick\.(prompt|confirm)\(": {"bench/devices/person.py", "commands/init.py"},
    r"(?<![\w.])print\(|\bstd(out|err)\.write\(": {"show/output.py"},  # its JSON
    r"\bmarkup=|\bfrom_markup\(": {"show/output.py"},
    r"\bfrom html import\b|\bimport html\b": {"show/wording.py"},
}


@pytest.mark.parametrize(("pattern", "doors"), DOORS.items())
def test_doors(pattern, doors):
    """No other module reaches the terminal, or makes HTML of text, by a way of its own."""
    found = {
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        for line in path.read_text().splitlines()
        if re.search(pattern, line)
    }
    assert found == doors
