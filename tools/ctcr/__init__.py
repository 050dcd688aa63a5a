"""Model of concentric tube continuum robots, and tools that compare it with measurements.

`ctcr.robot_file.load` reads a robot, `ctcr.measurements.load` a table, `ctcr.Model` predicts. Importing the package
costs nothing: the compiled core and numpy load with the first name that needs them.
"""

from importlib import import_module

_HOME = {
    "Model": "ctcr.model",
    "Prediction": "ctcr.model",
    "Shape": "ctcr.model",
    "InputError": "ctcr.errors",
}
_SUBMODULES = ("errors", "frames", "measurements", "model", "output", "pictures", "robot_file")

__all__ = [*_HOME, *_SUBMODULES]


def __getattr__(name: str):
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    if name in _SUBMODULES:
        return import_module(f"ctcr.{name}")
    if name == "__version__":
        from importlib.metadata import version

        return version("ctcr")
    raise AttributeError(f"module 'ctcr' has no attribute {name!r}")
