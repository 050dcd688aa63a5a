"""Builds the documentation site from the documents of the repository, with links between them as they stand there.

    python tools/site/build.py [-o build/site]

Copies the documents and what they show to FOLDER/source, with the pages of this folder at its root, makes the gallery
of reports, and runs Sphinx (extra `docs`) and, where it is installed, Doxygen. Warnings are errors.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

import gallery

ROOT = Path(__file__).parents[2]
COPIED = (
    *("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "LICENSE", "THIRD_PARTY.md", "bench/README.md"),
    *("tools/ctcr/README.md", "tools/oracle/README.md", "docs", "examples", "include"),
)
DOXYGEN = """
PROJECT_NAME = ctcr
INPUT = {root}/include/ctcr
RECURSIVE = YES
FILE_PATTERNS = *.hpp
OUTPUT_DIRECTORY = {out}
HTML_OUTPUT = cpp
GENERATE_LATEX = NO
JAVADOC_AUTOBRIEF = YES
EXTRACT_ALL = YES
HIDE_UNDOC_MEMBERS = NO
EXCLUDE_SYMBOLS = ctcr::detail
STRIP_FROM_PATH = {root}/include
USE_MDFILE_AS_MAINPAGE = {root}/include/ctcr/README.md
QUIET = YES
WARNINGS = NO
WARN_IF_INCOMPLETE_DOC = NO
HAVE_DOT = NO
CLASS_GRAPH = NO
"""


def stage(source: Path) -> None:
    shutil.rmtree(source, ignore_errors=True)
    for name in COPIED:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, source / name)
        else:
            shutil.copy(ROOT / name, source / name)
    for page in (*Path(__file__).parent.glob("*.md"), Path(__file__).with_name("conf.py")):
        shutil.copy(page, source)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--out", type=lambda text: Path(text).resolve(), default=ROOT / "build" / "site")
    out = parser.parse_args().out
    stage(out / "source")
    gallery.build(out / "source" / "gallery.md", out / "source" / "gallery")
    html = out / "html"
    sphinx = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", out / "source", html]
    if status := subprocess.run(sphinx).returncode:
        sys.exit(status)
    if shutil.which("doxygen"):
        subprocess.run(["doxygen", "-"], input=DOXYGEN.format(root=ROOT, out=html), text=True, check=True)
    print(f"{html}/index.html")


if __name__ == "__main__":
    main()
