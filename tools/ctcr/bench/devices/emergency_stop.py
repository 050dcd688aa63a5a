"""The latch of the emergency stop: a file in the bench's folder. While it exists, nothing moves."""

from pathlib import Path

from ctcr.bench.devices.fault import DeviceFault
from ctcr.errors import InputError, Problem, file_faults

UNKNOWN = "stopped, the reason was not written"
REMEDY = "look at the robot, mend the cause, then release it with `ctcr stop --release`"


def stop(folder: Path, reason: str) -> None:
    """Stops all motion; the first reason stays. Raises InputError where the folder takes no file."""
    latch = _latch(folder)
    try:
        latch.touch(exist_ok=False)
        latch.write_text(reason, encoding="utf-8")
    except OSError:
        if not latch.exists():  # else it was there, or a full disk holds it without its reason
            text = "cannot stop: the file cannot be made; cut the motors' power"
            raise InputError(Problem(text, str(latch))) from None


def is_stopped(folder: Path) -> bool:
    """Takes a microsecond: every cycle may ask."""
    return _latch(folder).exists()


def reason(folder: Path) -> str | None:
    """Why it was stopped; None where it is not."""
    try:
        return _latch(folder).read_text(encoding="utf-8") or UNKNOWN
    except FileNotFoundError:
        return None
    except OSError:
        return UNKNOWN


def release(folder: Path) -> None:
    """Permits motion again. Raises InputError where the latch cannot be removed."""
    with file_faults(_latch(folder), "remove"):
        _latch(folder).unlink(missing_ok=True)


def stop_fault(folder: Path) -> DeviceFault:
    return DeviceFault("emergency stop", reason(folder) or UNKNOWN, REMEDY)


def _latch(folder: Path) -> Path:
    return folder / "stop"
