"""The turns of the simulated motors, which the simulated bus writes and the simulated robot reads."""

from pathlib import Path

import numpy as np

from ctcr.bench.devices.shared_record import SharedRecord

MOST_AXES = 8  # two a tube


def shared_motors(folder: Path, writer: bool = False) -> SharedRecord:
    """`turns` of each motor's shaft since the home position, translations then rotations, and `t`, monotonic."""
    fields = np.dtype([("t", "f8"), ("turns", "f8", MOST_AXES)])
    return SharedRecord(folder / "motors", fields, writer)
