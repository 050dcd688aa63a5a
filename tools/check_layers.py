"""Checks the rooms: a header includes only its own layer and lower ones, a Python module imports only its own room and
lower ones, without circles. The table in the README of each tree says which rooms there are, the lowest first; rooms in
one row do not see each other. The umbrella headers may include everything. Tables of headers name all of their folder.
"""

import ast
import re
import sys
from pathlib import Path

ROW = re.compile(r"\| ((?:`[\w/]+`(?:, )?)+) \|")
INCLUDE = re.compile(r'\s*#\s*include\s*[<"](?:\.\./)*(?:ctcr/)?(\w+)/(?:\w+/)*\w+\.hpp[>"]')
HEADER_TABLE = re.compile(r"\nIn `(\w+)`.*:\n\n\|.*\| its one idea \|\n\|[-|]+\|\n((?:\|.*\n)+)")


def rooms_of(readme: Path, heading: str) -> dict[str, int]:
    """The rooms of the table under a heading of a README, each with its row in that table."""
    text = readme.read_text(encoding="utf-8").partition(f"## {heading}\n")[2].partition("\n## ")[0]
    rows = [match[1] for line in text.splitlines() if (match := ROW.match(line))]
    return {room: height for height, row in enumerate(rows) for room in re.findall(r"[\w/]+", row)}


def room_of(parts: tuple[str, ...], rooms: dict[str, int]) -> str:
    """The room of a path below the root of a tree; a folder of a room may be a room of its own."""
    inner = "/".join(parts[:2])
    return inner if inner in rooms else parts[0]


def may_see(rooms: dict[str, int], own: str, other: str) -> bool:
    return own == other or rooms[other] < rooms[own]


def header_problems(include: Path) -> list[str]:
    """What is wrong with the headers under the folder `include`, as `file:line: sentence`."""
    root = include / "ctcr"
    readme = root / "README.md"
    layers = rooms_of(readme, "Layers")
    found = [f"{readme}:1: layer '{layer}' has no folder" for layer in layers if not (root / layer).is_dir()]
    for header in sorted(root.rglob("*.hpp")):
        own, *rest = header.relative_to(root).parts
        if not rest:
            continue
        if own not in layers:
            found.append(f"{header}:1: layer '{own}' is missing in the table of {readme}")
            continue
        for number, line in enumerate(header.read_text(encoding="utf-8").splitlines(), start=1):
            match = INCLUDE.match(line)
            if match and match[1] in layers and not may_see(layers, own, match[1]):
                found.append(f"{header}:{number}: layer '{own}' must not include layer '{match[1]}'")
    for match in HEADER_TABLE.finditer(readme.read_text(encoding="utf-8")):
        rows = (row.rsplit("|", 2)[0] for row in match[2].splitlines())
        named = {name for row in rows for name in re.findall(r"`(\w+\.hpp)`", row)}
        there = {header.name for header in (root / match[1]).rglob("*.hpp")}
        found += [f"{readme}:1: '{match[1]}/{name}' is missing in its table" for name in sorted(there - named)]
        found += [f"{readme}:1: '{match[1]}/{name}' does not exist" for name in sorted(named - there)]
    return found


PACKAGE = "ctcr"
# Packages that a module may import late: it loads without them.
OPTIONAL = {"distributed", "mcap", "pandas", "pysoem", "serial"}
MAY_IMPORT_LATE = {"commands", "cli", "__init__"}


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
    rooms = rooms_of(root / "README.md", "Rooms")
    files = {
        ".".join((PACKAGE, *path.relative_to(root).with_suffix("").parts)).removesuffix(".__init__"): path
        for path in sorted(root.rglob("*.py"))
    }
    found, graph = [], {}
    for module, path in files.items():
        own = room_of(path.relative_to(root).with_suffix("").parts, rooms)
        if path.parent != root and own not in rooms:
            found.append(f"{path}:1: room '{own}' is missing in the table of {root / 'README.md'}")
            continue
        graph[module] = {}
        if module == PACKAGE:  # names what scripts may use, for editors, and loads none of it
            continue
        for name, line, late in imports_of(module, path, set(files)):
            if late and own not in MAY_IMPORT_LATE and name.split(".")[0] not in OPTIONAL:
                found.append(f"{path}:{line}: imports {name} inside a function: imports stand at the top")
            if name not in files:
                continue
            graph[module][name] = line
            other = room_of((*name.split(".")[1:], "")[:2], rooms)
            if own in rooms and other in rooms and not may_see(rooms, own, other):
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
    found = header_problems(root / "include") + python_problems(root / "tools")
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(bool(found))
