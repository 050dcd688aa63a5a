"""The folder of a recording: the table, and beside it the files that it was made with."""

import json
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from math import isfinite
from pathlib import Path
from typing import Any

import ctcr
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.tracker import Tracker
from ctcr.bench.record.row_file import RowFile
from ctcr.bench.shared.real_time import CONTROLLER, real_time
from ctcr.errors import InputError, Problem, file_faults
from ctcr.show.output import atomic_writer, write_json
from ctcr.table.measurements import column_names

TABLE, ABOUT = "measurements.csv", "session.json"
COPIES = {"robot": "robot.yaml", "plan": "plan.csv", "scenario": "scenario.yaml", "bench": "bench.yaml"}


class Folder:
    """Starts a recording, or resumes the one that is there. Raises InputError where that was another one."""

    def __init__(
        self,
        path: str | Path,
        sources: dict[str, str],
        settings: dict[str, Any],
        n_tubes: int,
        group: int = 1,
        synced: bool = True,
    ):
        """`sources` are files named in COPIES; `group` and `synced` as those of RowFile."""
        self.path = Path(path)
        contents = {name: _read(source) for name, source in sources.items()}
        is_new = not (self.path / ABOUT).exists()
        if is_new:
            self._create(contents, settings)
        else:
            self._check(contents, settings)
        self.rows = RowFile(self.path / TABLE, column_names(n_tubes), group, synced)
        last = self.rows.last_number("t_s") if self.rows.last else 0.0
        elapsed = max(time.time() - self.about["started_unix_s"], last + 1e-3)
        self._zero = time.monotonic() - (0.0 if is_new else elapsed)

    def clock(self, t: float) -> float:
        """t_s of the table [s] from a time of `time.monotonic`; it runs on through interruptions."""
        return t - self._zero

    @contextmanager
    def sitting(self, motors: Motors, tracker: Tracker) -> Iterator[None]:
        """Work with the devices at real-time priority; in the end `about` says how they did and how it ended."""
        try:
            with _interruptible(), real_time(CONTROLLER):
                yield
        except BaseException as error:
            with suppress(InputError):  # a full disk must not hide the first error
                self._note(motors, tracker, str(error) or "interrupted")
            raise
        self._note(motors, tracker, "finished")

    def _note(self, motors: Motors, tracker: Tracker, ended: str) -> None:
        state = motors.state
        sitting = {
            "ended": ended,
            "rows_of_the_plan": self.rows.groups,
            "tracker": {
                **{name: getattr(tracker, name) for name in ("port", "version", "frames", "missed", "unseen")},
                "connections": tracker.connections,
                "questions_late": tracker.asked_late.as_dict(),
                "faults": [{"t_s": self.clock(t), "text": str(fault)} for t, fault in tracker.faults],
            },
            "frames_late": tracker.frames_late.as_dict(),
            "bus": {
                "interface": motors.settings.interface,
                "devices": motors.names,
                "cycles": int(state["cycles"]),
                "bad_cycles": int(state["bad_cycles"]),
                "period_ms": 1e3 * motors.settings.period,
                "p99_late_ms": 1e3 * float(state["p99_late"]),
                "worst_late_ms": 1e3 * float(state["worst_late"]),
                "real_time_priority": bool(state["real_time"]),
            },
        }
        self.about["sittings"].append(sitting)
        self.save()

    def save(self) -> None:
        """Writes `about`."""
        write_json(self.about, str(self.path / ABOUT))

    def _create(self, contents: dict[str, bytes], settings: dict[str, Any]) -> None:
        with file_faults(self.path, "write"):
            self.path.mkdir(parents=True, exist_ok=True)
        if any(self.path.iterdir()):
            raise InputError(Problem("is not empty and holds no recording: choose another folder", str(self.path)))
        for name, content in contents.items():
            with atomic_writer(self.path / COPIES[name], binary=True) as file:
                file.write(content)
        versions = {"ctcr": ctcr.__version__}
        for package in ("pyserial", "pysoem", "numpy"):
            with suppress(PackageNotFoundError):
                versions[package] = version(package)
        self.about = {"started_unix_s": time.time(), "settings": settings, "versions": versions, "sittings": []}
        self.save()

    def _check(self, contents: dict[str, bytes], settings: dict[str, Any]) -> None:
        self.about = about_of(self.path)
        changed = [name for name, content in contents.items() if _read(self.path / COPIES[name]) != content]
        before = self.about["settings"]
        differs = [f"another {COPIES[name]}" for name in changed]
        for name, value in settings.items():
            if before.get(name) != value:
                differs.append(f"{name} {before.get(name)}, not {value}")
        if differs:
            text = f"holds a recording with {'; '.join(differs)}: choose another folder"
            raise InputError(Problem(text, str(self.path)))


@contextmanager
def _interruptible() -> Iterator[None]:
    """SIGTERM and SIGHUP, of a terminal that closes, interrupt the block as Ctrl+C does. In the main thread only."""

    def interrupt(number: int, _: object) -> None:
        raise KeyboardInterrupt(f"interrupted by {signal.Signals(number).name}")

    with ExitStack() as undo:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGTERM, signal.SIGHUP):
                undo.callback(signal.signal, number, signal.signal(number, interrupt))
        yield


def about_of(folder: Path) -> dict[str, Any]:
    """The content of the `session.json` of a recording. Raises InputError where the folder holds none."""
    try:
        about = json.loads(_read(folder / ABOUT))
        dict(about["settings"]), list(about["sittings"])
        is_whole = isfinite(about["started_unix_s"])
    except (ValueError, LookupError, TypeError):
        is_whole = False
    if not is_whole:
        text = "does not describe a recording: restore it, or choose another folder"
        raise InputError(Problem(text, str(folder / ABOUT)))
    return about


def _read(path: str | Path) -> bytes:
    with file_faults(path, "read"):
        return Path(path).read_bytes()
