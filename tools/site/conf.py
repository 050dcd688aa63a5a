"""Settings of Sphinx for the documentation site; build.py puts this file beside copies of the documents."""

import re
from importlib import metadata

project = "ctcr"
author = "the authors of ctcr"
release = metadata.version("ctcr")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode", "sphinx_click"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
html_theme = "furo"
html_extra_path = ["gallery"]  # the folder of reports and their pictures
html_title = f"ctcr {release}"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
suppress_warnings = ["myst.header", "autosectionlabel.*"]
smartquotes = False  # --option stays --option


def _parameters(app, what, name, obj, options, lines: list[str]) -> None:
    """Lines "name    meaning" of our docstrings as fields of Sphinx; a line that goes on is indented further."""
    lines[:] = [re.sub(r"^(\w+) {2,}(?=\S)", r":param \1: ", line) for line in lines]
    fields = [k for k, line in enumerate(lines) if line.startswith(":param ")]
    for k in reversed(fields):  # fields form a block of their own
        if k + 1 < len(lines) and lines[k + 1] and not lines[k + 1].startswith((":param ", " ")):
            lines.insert(k + 1, "")
        if k and lines[k - 1] and not lines[k - 1].startswith((":param ", " ")):
            lines.insert(k, "")


def setup(app) -> None:
    app.connect("autodoc-process-docstring", _parameters)
