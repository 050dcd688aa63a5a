"""The person at the bench, who hangs weights and looks at the tubes. Beside the simulators nobody is needed."""

from pathlib import Path

import click
import numpy as np

from ctcr.arrays import Array
from ctcr.bench.devices.bench_file import SIMULATED, Bench
from ctcr.bench.shared.control import request
from ctcr.bench.shared.folder import AURORA
from ctcr.errors import file_faults
from ctcr.show.finite import Finite
from ctcr.show.wording import visible

GRAVITY = 9.80665  # [m/s^2]


class Person:
    """Does what no device does, asked on the terminal; each method returns when it is done.

    A file in the folder of the bench remembers a weight, which outlasts the program that asked for it.
    """

    def __init__(self, folder: Path):
        self._weight = folder / "weight"

    @property
    def weight_left(self) -> bool:
        """Whether a weight may hang at the tip from before."""
        return self._weight.exists()

    def hang(self, force: Array) -> None:
        """Makes the known force (3,) [N], base frame, act at the tip."""
        size = float(np.linalg.norm(force))
        with file_faults(self._weight, "write"):
            if size == 0:
                _ask("See that nothing hangs at the tip")
                self._weight.unlink(missing_ok=True)
            else:
                self._weight.touch()
                direction = ", ".join(f"{part:+.4g}" for part in force)
                _ask(f"Hang {1e3 * size / GRAVITY:.1f} g at the tip (force {direction} N in the base frame)")

    def deployed(self, tube: int) -> float:
        """How far the tip of a tube (0: innermost) stands out of the plate [m]; negative: inside."""
        text = f"How far does the tip of tube {tube + 1} stand out of the plate? 0: flush [mm]"
        return 1e-3 * click.prompt(text, type=Finite(), err=True)

    def fasten(self, tube: int | None) -> None:
        """Puts the sensor on the tip of a tube (0: innermost), or takes it off (None)."""
        if tube is None:
            _ask("Take the sensor off the tube")
        else:
            _ask(f"Fasten the sensor to the tip of tube {tube + 1}, without bending or turning it")

    def touch(self, name: str, point: Array) -> None:
        """Puts the tip of the probe on a point (3,) [m], base frame."""
        where = ", ".join(f"{1e3 * part:g}" for part in point)
        _ask(f"Touch point {name} (CAD {where} mm) with the tip of the probe and hold it still")


def _ask(text: str) -> None:
    click.prompt(f"{visible(text)}, then press Enter", default="", show_default=False, prompt_suffix=" ", err=True)


class SimulatedPerson(Person):
    """Asks the simulator of the tracker, which holds the robot."""

    def __init__(self, folder: Path):
        self._folder = folder

    @property
    def weight_left(self) -> bool:
        return any(request(self._folder, AURORA, {})["force"])

    def hang(self, force: Array) -> None:
        request(self._folder, AURORA, {"force": np.asarray(force, float).tolist()})

    def deployed(self, tube: int) -> float:
        return float(request(self._folder, AURORA, {})["deployed"][tube])

    def fasten(self, tube: int | None) -> None:
        request(self._folder, AURORA, {"fasten": tube})

    def touch(self, name: str, point: Array) -> None:
        request(self._folder, AURORA, {"probe": np.asarray(point, float).tolist()})


def person_of(bench: Bench, folder: Path) -> Person:
    return SimulatedPerson(folder) if bench.person == SIMULATED else Person(folder)
