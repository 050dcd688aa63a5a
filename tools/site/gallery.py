"""Runs the commands of gallery.md and puts behind each block the first picture of the page that it writes."""

import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from html import escape, unescape
from pathlib import Path
from tempfile import TemporaryDirectory

from ctcr.show import palette
from PIL import Image

BLOCK = re.compile(r"```bash\n(.*?)```\n", re.DOTALL)
WRITTEN = re.compile(r"(?:--report|-o) (reports/(\w+)\.(?:html|png))\n")
FIGURE = re.compile(r"<figure[^>]*>(<svg.*?</svg>)\s*<figcaption>(.*?)</figcaption>", re.DOTALL)


def build(page: Path, folder: Path) -> None:
    """Fills in the page; `folder` gets the reports and their pictures below `reports`.

    The blocks run beside each other, in a folder that looks like the project to a command.
    """
    text = page.read_text()
    with TemporaryDirectory() as name, ThreadPoolExecutor(os.cpu_count()) as pool:
        project = Path(name)
        (project / "reports").mkdir()
        (project / "examples").symlink_to(page.parent / "examples")
        shown = list(pool.map(lambda block: _shown(block, project), BLOCK.findall(text)))
        shutil.copytree(project / "reports", folder / "reports")
    page.write_text(BLOCK.sub(lambda block: block[0] + "\n" + shown.pop(0), text))


def _shown(block: str, project: Path) -> str:
    """Runs the block; HTML of its picture, which leads to what the block wrote."""
    done = subprocess.run(
        ["bash", "-ec", block.replace(".venv/bin/ctcr", f"{sys.executable} -m ctcr")],
        cwd=project,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        sys.exit(f"gallery.md: a command failed\n{block}{done.stdout}{done.stderr}")
    [[written, name]] = WRITTEN.findall(block)
    if written.endswith(".png"):
        Image.open(project / written).quantize().save(project / written)  # a third of the bytes
        return f'<a href="{written}"><img src="{written}" alt="{name}"></a>\n'
    drawing, words = FIGURE.search((project / written).read_text()).groups()
    picture = f"reports/{name}.svg"
    (project / picture).write_text(drawing.replace(">", f"><style>:root {{{palette.colours(False)}}}</style>", 1))
    caption = unescape(re.sub("<[^>]*>", "", words))
    return (
        f'<figure><a href="{written}"><img src="{picture}" alt="{escape(caption)}"></a>'
        f'<figcaption>{escape(caption)} <a href="{written}">The whole report</a></figcaption></figure>\n'
    )
