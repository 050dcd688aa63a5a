"""Checks that a header includes only its own layer and lower ones; the umbrella headers may include everything."""

import re
import sys
from pathlib import Path

LAYERS = {
    "core": 0,
    "math": 1,
    "robot": 2,
    "effects": 3,
    "mechanics": 4,
    "derivatives": 5,
    "actuation": 6,
    "sensing": 6,
    "pipeline": 7,
    "parallel": 8,
    "control": 9,
    "simulation": 10,
    "calibration": 11,
    "io": 12,
}
# Devices know the robot, not how it is solved: they see the layers below this one, and themselves.
HIGHEST_SEEN = {"actuation": 2, "sensing": 2}
INCLUDE = re.compile(r'\s*#\s*include\s*[<"](?:\.\./)*(?:ctcr/)?(\w+)/(?:\w+/)*\w+\.hpp[>"]')


def may_include(own: str, other: str) -> bool:
    return own == other or LAYERS[other] <= HIGHEST_SEEN.get(own, LAYERS[own] - 1)


def problems(include: Path) -> list[str]:
    """What is wrong under the folder `include`, as `file:line: sentence`."""
    found = []
    for header in sorted((include / "ctcr").rglob("*.hpp")):
        own, *rest = header.relative_to(include / "ctcr").parts
        if not rest:
            continue
        if own not in LAYERS:
            found.append(f"{header}:1: folder '{own}' is not a layer")
            continue
        for number, line in enumerate(header.read_text(encoding="utf-8").splitlines(), start=1):
            match = INCLUDE.match(line)
            other = match[1] if match else own
            if other in LAYERS and not may_include(own, other):
                found.append(f"{header}:{number}: layer '{own}' must not include layer '{other}'")
    return found


if __name__ == "__main__":
    found = problems(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "include")
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(bool(found))
