"""The latch of the emergency stop: a file in the bench's folder. While it exists, nothing moves."""

from contextlib import suppress
from pathlib import Path

from ctcr.bench.devices.fault import DeviceFault

REMEDY = "look at the robot, mend the cause, then release it with `ctcr stop --release`"


def stop(folder: Path, reason: str) -> None:
    """Stops all motion; the first reason stays."""
    with suppress(FileExistsError), open(folder / "stop", "x", encoding="utf-8") as file:
        file.write(reason)


def is_stopped(folder: Path) -> bool:
    """Takes a microsecond: every cycle may ask."""
    return (folder / "stop").exists()


def reason(folder: Path) -> str | None:
    """Why it was stopped; None where it is not."""
    try:
        return (folder / "stop").read_text(encoding="utf-8")
    except FileNotFoundError:
        return None


def release(folder: Path) -> None:
    (folder / "stop").unlink(missing_ok=True)


def stop_fault(folder: Path) -> DeviceFault:
    return DeviceFault("emergency stop", reason(folder) or "stopped", REMEDY)
