"""The latch of the emergency stop: a file in the bench's folder. While it is there, nothing moves."""

from pathlib import Path

from ctcr.bench.devices.fault import DeviceFault

REMEDY = "look at the robot, mend the cause, then release it with `ctcr stop --release`"


def _latch(folder: Path) -> Path:
    return folder / "stop"


def stop(folder: Path, reason: str) -> None:
    """Stops all motion; the first reason stays."""
    try:
        with open(_latch(folder), "x", encoding="utf-8") as file:
            file.write(reason)
    except FileExistsError:
        pass


def is_stopped(folder: Path) -> bool:
    """A microsecond: may be asked in every cycle."""
    return _latch(folder).exists()


def reason(folder: Path) -> str | None:
    """Why it was stopped; None where it is not."""
    try:
        return _latch(folder).read_text(encoding="utf-8")
    except FileNotFoundError:
        return None


def release(folder: Path) -> None:
    _latch(folder).unlink(missing_ok=True)


def stop_fault(folder: Path) -> DeviceFault:
    return DeviceFault("emergency stop", reason(folder) or "stopped", REMEDY)
