"""The folder of a recording: the table, and beside it what it was made with."""

import json
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import ctcr
from ctcr.bench.devices.lateness import Lateness
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.tracker import Tracker
from ctcr.bench.record.row_file import RowFile
from ctcr.errors import InputError, Problem, file_fault
from ctcr.show.output import atomic_writer, write_json
from ctcr.table.measurements import column_names

TABLE, ABOUT = "measurements.csv", "session.json"
COPIES = {"robot": "robot.yaml", "plan": "plan.csv", "scenario": "scenario.yaml", "bench": "bench.yaml"}


class Folder:
    """Starts a recording, or goes on with the one that is there. Raises InputError where that was another one."""

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
        self.is_new = not (self.path / ABOUT).exists()
        if self.is_new:
            self._start(contents, settings)
        else:
            self._check(contents, settings)
        self.rows = RowFile(self.path / TABLE, column_names(n_tubes), group, synced)
        last = float(self.rows.last[0]) if self.rows.last else 0.0
        elapsed = max(time.time() - self.about["started_unix_s"], last + 1e-3)
        self._zero = time.monotonic() - (0.0 if self.is_new else elapsed)

    def clock(self, t: float) -> float:
        """t_s of the table [s] from a time of `time.monotonic`; it goes on through interruptions."""
        return t - self._zero

    def note(self, motors: Motors, tracker: Tracker, lateness: Lateness, ended: str) -> None:
        """How the devices did in this sitting, and how it ended."""
        state = motors.state
        self.about["sittings"].append(
            {
                "ended": ended,
                "rows_of_the_plan": self.rows.groups,
                "tracker": {
                    "port": tracker.port,
                    "version": tracker.version,
                    "frames": tracker.frames,
                    "missed": tracker.missed,
                    "unseen": tracker.unseen,
                    "connections": tracker.connections,
                    "questions_late": tracker.lateness.as_dict(),
                    "faults": [{"t_s": self.clock(t), "text": str(fault)} for t, fault in tracker.faults],
                },
                "frames_late": lateness.as_dict(),
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
        )
        self.save()

    def save(self) -> None:
        """Writes `about`."""
        write_json(self.about, str(self.path / ABOUT))

    def _start(self, contents: dict[str, bytes], settings: dict[str, Any]) -> None:
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise file_fault(error, self.path, "write") from None
        if any(self.path.iterdir()):
            raise InputError(Problem("is not empty and holds no recording: choose another folder", str(self.path)))
        for name, content in contents.items():
            with atomic_writer(self.path / COPIES[name], binary=True) as file:
                file.write(content)
        self.about = {"started_unix_s": time.time(), "settings": settings, "versions": _versions(), "sittings": []}
        self.save()

    def _check(self, contents: dict[str, bytes], settings: dict[str, Any]) -> None:
        self.about = json.loads(_read(self.path / ABOUT))
        differs = [
            f"another {COPIES[name]}"
            for name, content in contents.items()
            if _read(self.path / COPIES[name]) != content
        ]
        before = self.about["settings"]
        differs += [
            f"{name} {before[name]}, not {settings[name]}" for name in settings if before[name] != settings[name]
        ]
        if differs:
            text = f"holds a recording with {'; '.join(differs)}: choose another folder"
            raise InputError(Problem(text, str(self.path)))


def _versions() -> dict[str, str]:
    found = {"ctcr": ctcr.__version__}
    for package in ("pyserial", "pysoem", "numpy"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            pass
    return found


def _read(path: str | Path) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise file_fault(error, path, "read") from None
