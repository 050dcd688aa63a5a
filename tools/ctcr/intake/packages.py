"""Optional packages that some formats need."""

from importlib import import_module
from pathlib import Path
from types import ModuleType

from ctcr.errors import InputError, Problem


def needed(package: str, module: str, extra: str, path: Path) -> ModuleType:
    """A module of a package, imported late. Raises InputError with the extra to install where it is missing."""
    try:
        return import_module(module)
    except ModuleNotFoundError:
        text = f'needs the Python package {package}: install it with `pip install "ctcr[{extra}]"`'
        raise InputError(Problem(text, str(path))) from None
