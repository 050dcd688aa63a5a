"""Model of concentric tube continuum robots, and tools that compare it with measurements.

`ctcr.robot_file.load` reads a robot, `ctcr.measurements.load` a table, `ctcr.Model` predicts. Importing the package
costs nothing: the compiled core and numpy load with the first name that needs them.
"""

from importlib import import_module

# Public names and the modules that define them.
_NAMES = {"Model": "ctcr.model", "Prediction": "ctcr.model", "Shape": "ctcr.model", "InputError": "ctcr.errors"}
_MODULES = {
    "errors": "ctcr.errors",
    "frames": "ctcr.frames",
    "measurements": "ctcr.table.measurements",
    "model": "ctcr.model",
    "output": "ctcr.show.output",
    "pictures": "ctcr.show.pictures",
    "robot_file": "ctcr.robot.robot_file",
}

__all__ = [*_NAMES, *_MODULES]


def __getattr__(name: str):
    if name in _NAMES:
        return getattr(import_module(_NAMES[name]), name)
    if name in _MODULES:
        return import_module(_MODULES[name])
    if name == "__version__":
        return import_module("importlib.metadata").version("ctcr")
    raise AttributeError(f"module 'ctcr' has no attribute {name!r}")
