"""Runs a command in a child process where a user's code is part of it, which may end a process without an exception."""

import mmap
import os
import signal

_place = mmap.mmap(-1, 1 << 12)  # shared with the child: the code of the user's that runs, empty outside of it


def note(place: str) -> None:
    """Notes which code of the user's runs now; "" where none does."""
    written = place.encode(errors="replace")[: len(_place) - 1] + b"\0"
    _place[: len(written)] = written


def ended() -> tuple[int, str] | None:
    """Forks. None in the child, which goes on; in its parent the exit code of the child, and what is wrong if it ended
    inside the user's code."""
    child = os.fork()
    if child == 0:
        return None
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to the child too
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: os.kill(child, number))
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    shown = code if code >= 0 else 128 - code  # as shells have it
    place = bytes(_place).partition(b"\0")[0].decode(errors="replace")
    if not place:
        return shown, ""
    how = "ends the program, as os._exit() does" if code >= 0 else f"was running when {_name(-code)} ended the program"
    return shown or 1, f"{place} {how}"


def _name(number: int) -> str:
    return f"{signal.Signals(number).name} ({signal.strsignal(number)})"
