"""A fresh installation holds what the sources import."""

import ast
import re
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
# A package that installs a module of another name.
PART_OF = {"PIL": "pillow", "mpl_toolkits": "matplotlib", "serial": "pyserial"}
FOLDERS = {
    "tools/ctcr": ["bench", "cluster", "pandas"],
    "tools": ["dev", "bench", "cluster", "docs", "pandas"],
    "tests": ["dev", "bench", "pandas"],
    "examples": ["dev"],
}
TRIED = {"sksurgerynditracker"}  # tests of others' programs are skipped without them


def imports(path: Path) -> set[str]:
    """Top-level names of the modules that a source imports, relative ones aside."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add(node.module.split(".")[0])
    return names


def declared(extras: list[str]) -> set[str]:
    """Top-level module names of the declared requirements; each is named as its package, up to the first dot."""
    optional = PROJECT["optional-dependencies"]
    requirements = [*PROJECT["dependencies"], *(line for extra in extras for line in optional[extra])]
    return {re.match(r"[\w-]+", line)[0].replace("-", "_") for line in requirements}


@pytest.mark.parametrize("folder", FOLDERS)
def test_declared_packages(folder):
    """Every imported package is declared in pyproject.toml."""
    sources = [*(ROOT / folder).rglob("*.py")]
    ours = [*sources, *(ROOT / "tools").rglob("*.py"), *(ROOT / "tests" / "python" / "support").glob("*.py")]
    own = {"ctcr", *(path.stem for path in ours)}
    known = declared(FOLDERS[folder]) | own | TRIED | set(sys.stdlib_module_names)
    missing = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in sources
        for name in imports(path)
        if PART_OF.get(name, name) not in known
    }
    assert not missing


def test_planted_imports(tmp_path):
    """Imports of every form are found."""
    source = tmp_path / "x.py"
    source.write_text("import a.b\nfrom c.d import e\nfrom . import f\ndef g():\n    import h as i, j\n")
    assert imports(source) == {"a", "c", "h", "j"}
