"""The bench file: the devices, where they are connected, limits and speeds of the joints."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Len
from pydantic import AfterValidator, Field, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from ctcr.bench.devices.axis_control import AxisSettings
from ctcr.bench.devices.joint_limits import JointLimits
from ctcr.bench.shared.folder import AURORA, MASTER
from ctcr.errors import InputError, Problem
from ctcr.robot import yaml_document
from ctcr.robot.checks import validated
from ctcr.robot.description import BELOW, MAX_TUBES, Robot, Section
from ctcr.robot.units import Quantity

SIMULATED = "simulated"


def _rising(pair: list[float]) -> list[float]:
    if pair[0] > pair[1]:
        raise PydanticCustomError("impossible", "the highest is below the lowest")
    return pair


Pair = Annotated[list[float], Len(2, 2), AfterValidator(_rising)]
Axes = Annotated[list[Annotated[int, Ge(1)]], Len(1, MAX_TUBES)]
WORD = 0xFFFF  # settings of a terminal have 16 bits


class TrackerPort(Section):
    """The Aurora and its serial port."""

    port: str = Field(description="a serial port such as /dev/ttyUSB0, or simulated")
    baud: int = Field(115200, description="a rate such as 115200")
    replies: Literal["BX", "TX"] = Field("BX", description="BX or TX")
    tool: str = Field("0A", pattern="^[0-9A-F]{2}$", description="the handle of the sensor, two hexadecimal digits")
    probe: str | None = Field(
        None, pattern="^[0-9A-F]{2}$", description="the handle of the probe, two hexadecimal digits; else as tool"
    )
    reading_age_ms: Annotated[float, Quantity("ms", usual=(1, 150), least=0)] = 12.0


class Motors(Section):
    """The stepper terminals; the lists hold one value a tube, innermost first."""

    interface: str = Field(description="a network interface such as enp3s0, or simulated")
    translation_terminals: Axes = Field(description="positions on the bus from 1, each once; the coupler is 0")
    rotation_terminals: Axes = Field(description="positions on the bus from 1, each once; the coupler is 0")
    current_mA: Annotated[int, Quantity("mA", usual=(50, 5000), above=0, most=5000)] = 1000  # most: of the terminals
    full_steps: Annotated[int, Quantity("", usual=(20, 1000), above=0, most=WORD)] = 200  # a turn
    encoder_counts: Annotated[int, Quantity("", usual=(100, WORD), above=0, most=WORD)] = 4096  # a turn, four a line
    period_ms: Annotated[float, Quantity("ms", usual=(1, 20), above=0, most=50)] = 4.0  # twice in the watchdog's 100 ms
    speed_mm_s: Annotated[float, Quantity("mm/s", usual=(0.1, 100), above=0)] = 10.0
    speed_deg_s: Annotated[float, Quantity("deg/s", usual=(1, 720), above=0)] = 60.0
    ramp_s: Annotated[float, Quantity("s", usual=(0.05, 5), above=0)] = 0.2
    lag_mm: Annotated[float, Quantity("mm", usual=(0.1, 10), above=0)] = 1.0
    lag_deg: Annotated[float, Quantity("deg", usual=(0.5, 45), above=0)] = 5.0

    @field_validator("translation_terminals", "rotation_terminals")
    @classmethod
    def _once(cls, positions: list[int], info: ValidationInfo) -> list[int]:
        others = info.data.get("translation_terminals", []) if info.field_name == "rotation_terminals" else []
        used = [*others, *positions]
        if twice := next((position for position in used if used.count(position) > 1), None):
            raise PydanticCustomError("impossible", "{position} stands there twice", {"position": twice})
        return positions


class Limits(Section):
    """Soft limits, one pair a tube, innermost first."""

    translation_mm: Annotated[list[Pair], Len(1, MAX_TUBES)] = Field(description="a pair [lowest, highest] a tube, mm")
    rotation_deg: Annotated[list[Pair], Len(1, MAX_TUBES)] = Field(description="a pair [lowest, highest] a tube, deg")
    clearance_mm: Annotated[float, Quantity("mm", usual=(0, 50), least=0)]


class Bench(Section):
    """The whole file. `person` hangs weights and looks at the tubes."""

    tracker: TrackerPort = Field(description=BELOW)
    motors: Motors = Field(description=BELOW)
    limits: Limits = Field(description=BELOW)
    person: Literal["present", "simulated"] = Field("present", description="present or simulated")

    def port(self, folder: Path) -> str:
        """Serial port of the tracker; that of the simulated one lies in the folder of the bench."""
        return str(folder / AURORA) if self.tracker.port == SIMULATED else self.tracker.port

    @property
    def interface(self) -> str:
        """Network interface of the bus."""
        return MASTER if self.motors.interface == SIMULATED else self.motors.interface

    @property
    def positions(self) -> list[int]:
        """Positions on the bus of the terminals, in the order of the joints."""
        return [*self.motors.translation_terminals, *self.motors.rotation_terminals]

    def axis_settings(self, robot: Robot) -> AxisSettings:
        """The settings of this robot's joints. Raises InputError where the file is for another number of tubes."""
        n, motors, limits = robot.n_tubes, self.motors, self.limits
        counts = {
            "motors.translation_terminals": len(motors.translation_terminals),
            "motors.rotation_terminals": len(motors.rotation_terminals),
            "limits.translation_mm": len(limits.translation_mm),
            "limits.rotation_deg": len(limits.rotation_deg),
        }
        wrong = {name: count for name, count in counts.items() if count != n}
        if wrong:
            raise InputError(
                Problem(f"has {count} entries, the robot has {n} tubes", field=name) for name, count in wrong.items()
            )
        return AxisSettings(
            speeds=np.repeat([1e-3 * motors.speed_mm_s, np.deg2rad(motors.speed_deg_s)], n),
            ramp_s=motors.ramp_s,
            following_error=np.repeat([1e-3 * motors.lag_mm, np.deg2rad(motors.lag_deg)], n),
            limits=JointLimits(
                length=robot.lengths,
                travel=1e-3 * np.array(limits.translation_mm),
                rotation=np.deg2rad(limits.rotation_deg),
                clearance=1e-3 * limits.clearance_mm,
            ),
        )


def load(path: str | Path) -> Bench:
    """The bench that a file describes. Raises InputError with all its faults."""
    document = yaml_document.load(path)
    if not isinstance(document.data, dict):
        raise InputError(Problem("does not describe a bench: no fields tracker, motors, limits", str(path)))
    return validated(Bench, document)
