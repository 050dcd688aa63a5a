"""Runs a command that calls a user's code in a child process: such code may end a process without an exception."""

import mmap
import os
import signal

_place = mmap.mmap(-1, 1 << 12)  # shared with the child: the code of the user's that runs, empty outside of it


def note(place: str) -> None:
    """Notes which code of the user's runs now; "" where none does."""
    _place[:] = place.encode(errors="replace")[: len(_place)].ljust(len(_place), b"\0")


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
    place = bytes(_place).rstrip(b"\0").decode(errors="replace")
    if not place:
        return shown, ""
    if code >= 0:
        return shown or 1, f"{place} ends the program, as os._exit() does"
    return shown, f"{place} was running when {signal.Signals(-code).name} ended the program: {signal.strsignal(-code)}"
