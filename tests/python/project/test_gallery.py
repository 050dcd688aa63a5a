"""The gallery of the documentation site shows what its commands write."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SENSITIVITY = ".venv/bin/ctcr sensitivity examples/robots/table2.yaml --open-loop 9 \\\n  --report reports/bars.html"


@pytest.fixture
def build():
    spec = importlib.util.spec_from_file_location("gallery", ROOT / "tools" / "site" / "gallery.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.build


@pytest.fixture
def page(tmp_path):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    return tmp_path / "gallery.md"


def test_picture(build, page, tmp_path):
    """A block is followed by the first picture of its report, with its caption, which leads to the report."""
    page.write_text(f"# Gallery\n\n```bash\n{SENSITIVITY}\n```\n\nThe end.\n")
    build(page, tmp_path / "out")
    block, shown = page.read_text().split("```\n\n", 1)
    assert block.endswith(f"{SENSITIVITY}\n") and shown.endswith("The end.\n")
    assert '<a href="reports/bars.html"><img src="reports/bars.svg"' in shown and "<figcaption>Distance" in shown
    assert (tmp_path / "out/reports/bars.html").exists()
    picture = (tmp_path / "out/reports/bars.svg").read_text()
    assert picture.startswith("<svg") and "--ink: #" in picture  # it stands alone: its colours are defined


def test_fault(build, page, tmp_path):
    """A command that fails ends the build, with what it said."""
    page.write_text("```bash\n.venv/bin/ctcr compare nowhere.yaml nothing.csv --report reports/a.html\n```\n")
    with pytest.raises(SystemExit, match="nowhere.yaml"):
        build(page, tmp_path / "out")
