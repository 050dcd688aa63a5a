"""Checks the rooms: a header includes only its own layer and lower ones, a Python module imports only its own room and
lower ones, without circles. The umbrella headers may include everything.
"""

import ast
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


PACKAGE = "ctcr"
ROOM = re.compile(r"\| `(\w+)` \|")
OPTIONAL = {"distributed", "mcap", "pysoem", "serial"}  # packages that a module may import late: it loads without them
MAY_IMPORT_LATE = {"commands", "cli", "__init__"}


def rooms_of(readme: Path) -> list[str]:
    """The rooms of the table in a README, the lowest first."""
    text = readme.read_text(encoding="utf-8").partition("## Rooms")[2]
    return [match[1] for line in text.splitlines() if (match := ROOM.match(line))]


def imports_of(module: str, path: Path, modules: set[str]) -> list[tuple[str, int, bool]]:
    """What a Python file imports: (module, line, whether inside a function)."""
    found = []

    def walk(node: ast.AST, late: bool) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Import):
                found.extend((alias.name, child.lineno, late) for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                for alias in child.names:
                    full = f"{child.module}.{alias.name}"
                    found.append((full if full in modules else child.module, child.lineno, late))
            walk(child, late or isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef))

    walk(ast.parse(path.read_text(encoding="utf-8")), False)
    return [one for one in found if one[0] != module]


def python_problems(tools: Path) -> list[str]:
    """What is wrong with the imports of the Python package under `tools`, as `file:line: sentence`."""
    root = tools / PACKAGE
    rooms = rooms_of(root / "README.md")
    files = {
        ".".join((PACKAGE, *path.relative_to(root).with_suffix("").parts)).removesuffix(".__init__"): path
        for path in sorted(root.rglob("*.py"))
    }
    found, graph = [], {}
    for module, path in files.items():
        own = path.relative_to(root).parts[0].removesuffix(".py")
        if path.parent != root and own not in rooms:
            found.append(f"{path}:1: room '{own}' is missing in the table of {root / 'README.md'}")
            continue
        graph[module] = {}
        for name, line, late in imports_of(module, path, set(files)):
            if late and own not in MAY_IMPORT_LATE and name.split(".")[0] not in OPTIONAL:
                found.append(f"{path}:{line}: imports {name} inside a function: imports stand at the top")
            if name not in files:
                continue
            graph[module][name] = line
            other = name.split(".")[1] if name.count(".") > 0 else ""
            if own in rooms and other in rooms and rooms.index(other) > rooms.index(own):
                found.append(f"{path}:{line}: room '{own}' must not import room '{other}', which stands below it")
    for circle in circles(graph):
        found.append(f"{files[circle[0]]}:1: modules import each other: {' -> '.join([*circle, circle[0]])}")
    return found


def circles(graph: dict[str, dict[str, int]]) -> list[list[str]]:
    """Circles of imports, one for each edge that closes one on a depth-first walk."""
    found, done = [], set()

    def walk(module: str, path: list[str]) -> None:
        if module in path:
            found.append(path[path.index(module) :])
        elif module not in done:
            for other in graph.get(module, {}):
                walk(other, [*path, module])
            done.add(module)

    for module in graph:
        walk(module, [])
    return found


if __name__ == "__main__":
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1]
    found = problems(root / "include") + python_problems(root / "tools")
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(bool(found))
