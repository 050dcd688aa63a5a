"""Pages are small, say what they were made from, and their scripts run in a browser."""

import hashlib
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from ctcr import cli, inputs
from ctcr.show import html_page, scene
from ctcr.show.palette import ERROR
from ctcr.show.style import draw

DEMO = Path(__file__).parents[3] / "examples" / "data" / "demo"
ROBOT, TABLE = DEMO / "robot.yaml", DEMO / "measurements.csv"
MOST_BYTES = 1_000_000
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def in_browser(page: Path) -> str:
    """The page as its scripts leave it."""
    if not BROWSER:
        pytest.skip("no Chromium is installed")
    flags = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={page.parent / 'profile'}"]
    done = subprocess.run(
        [BROWSER, *flags, "--virtual-time-budget=5000", "--dump-dom", page.as_uri()],
        capture_output=True,
        text=True,
        timeout=300,
    )
    return done.stdout


@pytest.mark.parametrize("command", [("compare",), ("calibrate", "frame"), ("calibrate", "fit"), ("diagnose",)])
def test_demo(command, tmp_path):
    """The pages of the demonstration: their size, what they were made from, and their views."""
    page = tmp_path / "page.html"
    assert cli.run([*command, str(ROBOT), str(TABLE), "--report", str(page)]) == 0
    text = page.read_text()
    assert len(text.encode()) <= MOST_BYTES
    footer = text[text.index("<footer>") :]
    assert f"<code>ctcr {' '.join(command)} {ROBOT} {TABLE} --report {page}</code>" in footer
    for file in (ROBOT, TABLE):
        assert f'{file}</td><td class="text">{hashlib.sha256(file.read_bytes()).hexdigest()[:12]}<' in footer
    drawn = in_browser(page)
    assert int(re.search(r'<figure class="view" data-drawn="(\d+)"', drawn)[1]) > 500
    assert drawn.count(">copy</button>") == text.count('<div class="command">')


def test_layers(tmp_path):
    """Every kind of layer is drawn; points that are not known, and what is hidden or not chosen, are not."""
    points = np.array([[0.0, 0, 0], [1, 2, 3], [np.nan] * 3, [4, 5, 6], [7, 8, 9]])
    known = points[[0, 1, 3, 4]]
    layers = [
        scene.layer("points", "points", points, "ink"),  # 4
        scene.layer("line", "line", points, "out", marked=2),  # 2 and 4 marks
        scene.layer("line", "dashed", points, "out", dashed=True),  # 1
        scene.layer("arrows", "arrows", known, to=known + 1, value=[0.0, 1.0, 2.0, 3.0], choice=1),  # 4
        scene.layer("arrows", "not chosen", known, "ink", to=known, choice=0),
        scene.layer("ball", "ball", known[:1], "error", radius=2.0),  # 1
        scene.layer("points", "hidden", known, "ink", hidden=True),
    ]
    drawing = scene.view(layers, most=3.0, choices=("before", "after"))
    page = tmp_path / "page.html"
    page.write_text(html_page.page("a page", [html_page.view(drawing, "a view.")]))
    assert 'data-drawn="16"' in in_browser(page)


def test_one_point(tmp_path):
    """A view without any extent."""
    page = tmp_path / "page.html"
    drawing = scene.view([scene.layer("points", "one", np.ones((1, 3)), "ink")])
    page.write_text(html_page.page("a page", [html_page.view(drawing, "a view.")]))
    assert 'data-drawn="1"' in in_browser(page)


def test_columns():
    """What a column means is shown on hover and in the text."""
    text = html_page.table("", {"x, mm": 'along "x"', "y": ""}, [["1", "2"]], 0)
    assert text.count("along &quot;x&quot;") == 2 and text.count("title=") == 1


def test_colours():
    """Pictures take the colours of the page, so that they are legible on dark paper too."""

    def plot(figure, values):
        figure.subplots().plot(values, color=ERROR, label=ERROR)
        figure.legend()

    picture = draw(plot, [1.0, 2.0], 3, 2)
    assert "stroke: var(--error)" in picture and f">{ERROR}</text>" in picture
    assert not re.search(r"#[0-9a-f]{6}", picture.replace(f">{ERROR}<", ""))


def test_fingerprint(tmp_path):
    """A fingerprint is that of the bytes that were read, not of those written since."""
    path = tmp_path / "a.csv"
    path.write_bytes(b"old")
    with inputs.open_input(path) as file:
        assert file.read() == b"old"
    path.write_bytes(b"new")
    assert inputs.fingerprint(path) == hashlib.sha256(b"old").hexdigest()
    assert inputs.sha256(path) == hashlib.sha256(b"new").hexdigest() == inputs.fingerprint(path)


def test_many_points():
    """A picture of very many points stays small."""

    def plot(figure, values):
        figure.subplots().plot(values, ".")

    few, many = (len(draw(plot, np.random.default_rng(1).normal(size=count), 8, 4)) for count in (500, 50_000))
    assert many < 5 * few
