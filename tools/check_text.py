"""Checks every source file: not longer than 400 lines, no absolute path of one machine, nothing about its making."""

import re
import sys
from pathlib import Path

MAX_LINES = 400
FOLDERS = ("include", "tests", "bench", "tools", "examples", "docs", "cmake", ".ci")
CODE = {".hpp", ".cpp", ".py", ".sh", ".cmake"}
TEXT = CODE | {".md", ".txt", ".toml", ".yaml", ".json", ""}
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
        if path.suffix in CODE and len(lines) > MAX_LINES:
            found.append(f"{path}:{MAX_LINES + 1}: longer than {MAX_LINES} lines")
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
