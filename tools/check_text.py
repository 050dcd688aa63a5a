"""Checks every text file: no absolute path of one machine, nothing about how the project is made."""

import re
import sys
from pathlib import Path

FOLDERS = ("include", "src", "tests", "bench", "tools", "examples", "docs", "cmake", ".ci")
TEXT = {".hpp", ".cpp", ".py", ".sh", ".cmake", ".md", ".txt", ".toml", ".yaml", ".json", ""}
FORBIDDEN = {
    "absolute path of one machine": re.compile(r"(?<![\w.~}/])/(?:home|root|tmp|work|Users)/"),
    "name of a package registry's host": re.compile(r"\b(?:pypi|npmjs|anaconda)\.(?:org|com)\b"),
    "reference to the work's planning": re.compile(r"\b(?:[Ii]ssue|[Tt]icket) ?#?\d+\b"),
}


def files(root: Path) -> list[Path]:
    inside = (path for folder in FOLDERS for path in (root / folder).rglob("*"))
    top = (path for path in root.iterdir() if path.name != ".git")
    return sorted(
        path for path in (*inside, *top) if path.is_file() and path.suffix in TEXT and "__pycache__" not in path.parts
    )


def problems(root: Path) -> list[str]:
    """What is wrong under the project folder `root`, as `file:line: sentence`."""
    found = []
    for path in files(root):
        lines = path.read_text(encoding="utf-8").splitlines()
        found += [
            f"{path}:{number}: {name}"
            for number, line in enumerate(lines, start=1)
            for name, pattern in FORBIDDEN.items()
            if pattern.search(line)
        ]
    return found


if __name__ == "__main__":
    found = problems(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1])
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(bool(found))
