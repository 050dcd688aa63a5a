"""Model of concentric tube continuum robots, and tools that compare it with measurements.

    robot, table = ctcr.load("robot.yaml"), ctcr.read("measurements.csv")
    report = ctcr.compare(robot, table)  # how wrong the model is, and where
    fit = ctcr.calibrate(robot, table)  # parameters, with standard deviations
    found = ctcr.diagnose(robot, table)  # which physical effect is missing
    better = ctcr.add(robot, found, table)  # the robot with it, fitted: better.robot

`ctcr.Model(robot).predict` solves configurations, `ctcr.predict` the rows of a table. Importing the package costs
nothing: the compiled core and numpy load with the first name that needs them.
"""

import os
import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ctcr import errors as errors
    from ctcr import frames as frames
    from ctcr import model as model
    from ctcr import user_effects as user_effects
    from ctcr.api.add import add as add
    from ctcr.api.calibrate import calibrate as calibrate
    from ctcr.api.compare import compare as compare
    from ctcr.api.diagnose import diagnose as diagnose
    from ctcr.api.reviewed import WrongConventions as WrongConventions
    from ctcr.calibrate.joint_fit import Calibration as Calibration
    from ctcr.compare.analysis import Comparison as Comparison
    from ctcr.diagnose.add import Added as Added
    from ctcr.diagnose.pipeline import Diagnosis as Diagnosis
    from ctcr.errors import InputError as InputError
    from ctcr.model.model import Model as Model
    from ctcr.model.model import Prediction as Prediction
    from ctcr.model.model import Shape as Shape
    from ctcr.model.table_poses import predict as predict
    from ctcr.robot import robot_file as robot_file
    from ctcr.robot.description import Robot as Robot
    from ctcr.robot.robot_file import load as load
    from ctcr.show import output as output
    from ctcr.show import pictures as pictures
    from ctcr.table import measurements as measurements
    from ctcr.table.measurements import Measurements as Measurements
    from ctcr.table.measurements import read as read

    __version__: str

# Public names and the modules that define them; a test holds them against the imports above, which editors read.
_NAMES = {
    "Added": "ctcr.diagnose.add",
    "Calibration": "ctcr.calibrate.joint_fit",
    "Comparison": "ctcr.compare.analysis",
    "Diagnosis": "ctcr.diagnose.pipeline",
    "InputError": "ctcr.errors",
    "Measurements": "ctcr.table.measurements",
    "Model": "ctcr.model.model",
    "Prediction": "ctcr.model.model",
    "Robot": "ctcr.robot.description",
    "Shape": "ctcr.model.model",
    "WrongConventions": "ctcr.api.reviewed",
    "add": "ctcr.api.add",
    "calibrate": "ctcr.api.calibrate",
    "compare": "ctcr.api.compare",
    "diagnose": "ctcr.api.diagnose",
    "load": "ctcr.robot.robot_file",
    "predict": "ctcr.model.table_poses",
    "read": "ctcr.table.measurements",
}
_MODULES = {
    "errors": "ctcr.errors",
    "frames": "ctcr.frames",
    "measurements": "ctcr.table.measurements",
    "model": "ctcr.model",
    "output": "ctcr.show.output",
    "pictures": "ctcr.show.pictures",
    "robot_file": "ctcr.robot.robot_file",
    "user_effects": "ctcr.user_effects",
}


class _Package(ModuleType):
    """Keeps its functions `compare`, `calibrate` and `diagnose` when the rooms of the same names are imported; `from
    ctcr.compare import analysis` still finds the rooms."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _NAMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def _runs_x86_64_v3() -> bool:
    """Whether the processor runs what the second module of a package that travels is compiled for."""
    try:
        with open("/proc/cpuinfo") as info:
            flags = next((line for line in info if line.startswith("flags")), "").split()
    except OSError:  # not Linux
        return False
    return {"avx2", "fma", "bmi2", "f16c", "abm", "movbe"} <= set(flags)


_fast = os.path.join(os.path.dirname(__file__), "_x86_64_v3")
if os.path.isdir(_fast) and _runs_x86_64_v3():
    __path__.insert(0, _fast)  # where `ctcr._core` is looked for first


if not TYPE_CHECKING:  # a checker knows the names above and no others
    __all__ = sorted(_NAMES | _MODULES)

    def __getattr__(name: str) -> Any:
        if name in _NAMES:
            return getattr(import_module(_NAMES[name]), name)
        if name in _MODULES:
            return import_module(_MODULES[name])
        if name == "__version__":
            return import_module("importlib.metadata").version("ctcr")
        raise AttributeError(f"module 'ctcr' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_NAMES, *_MODULES})
