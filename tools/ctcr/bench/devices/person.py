"""The person at the bench: hangs weights, looks at the tubes. Beside the simulators nobody is needed."""

from pathlib import Path
from typing import Protocol

import click
import numpy as np
from numpy.typing import NDArray

from ctcr.bench.devices.bench_file import SIMULATED, Bench
from ctcr.bench.simulators.control import request

Array = NDArray[np.float64]
GRAVITY = 9.80665  # [m/s^2]


class Person(Protocol):
    """Who does what no device does."""

    def hang(self, force: Array) -> None:
        """Makes the known force (3,) [N], base frame, act at the tip; returns when it does."""

    def deployed(self, tube: int) -> float:
        """How far the tip of a tube (0: innermost) stands out of the plate [m]; negative: inside."""

    def fasten(self, tube: int | None) -> None:
        """Puts the sensor on the tip of a tube, or takes it off; returns when that is done."""

    def touch(self, name: str, place: Array) -> None:
        """Puts the tip of the probe on a point (3,) [m], base frame; returns when it is there."""


class PersonPresent:
    """Is asked on the terminal."""

    def hang(self, force: Array) -> None:
        size = float(np.linalg.norm(force))
        if size == 0:
            text = "Take the weight off the tip"
        else:
            direction = ", ".join(f"{part:+.4g}" for part in force)
            text = f"Hang {1e3 * size / GRAVITY:.1f} g at the tip (force {direction} N in the base frame)"
        _ask(text)

    def deployed(self, tube: int) -> float:
        text = f"How far does the tip of tube {tube + 1} stand out of the plate? 0: flush [mm]"
        return 1e-3 * click.prompt(text, type=float, err=True)

    def fasten(self, tube: int | None) -> None:
        if tube is None:
            _ask("Take the sensor off the tube")
        else:
            _ask(f"Fasten the sensor to the tip of tube {tube + 1}, without bending or turning it")

    def touch(self, name: str, place: Array) -> None:
        where = ", ".join(f"{1e3 * part:g}" for part in place)
        _ask(f"Touch point {name} (CAD {where} mm) with the tip of the probe and hold it still")


def _ask(text: str) -> None:
    click.prompt(f"{text}, then press Enter", default="", show_default=False, prompt_suffix=" ", err=True)


class SimulatedPerson:
    """Asks the simulators."""

    def __init__(self, folder: Path):
        self._folder = folder

    def hang(self, force: Array) -> None:
        request(self._folder, "aurora", {"force": np.asarray(force, float).tolist()})

    def deployed(self, tube: int) -> float:
        return float(request(self._folder, "aurora", {})["deployed"][tube])

    def fasten(self, tube: int | None) -> None:
        request(self._folder, "aurora", {"fasten": tube})

    def touch(self, name: str, place: Array) -> None:
        request(self._folder, "aurora", {"probe": np.asarray(place, float).tolist()})


def person_of(bench: Bench, folder: Path) -> Person:
    return SimulatedPerson(folder) if bench.person == SIMULATED else PersonPresent()
