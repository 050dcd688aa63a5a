"""The program's end of a process that serves one device: started, spoken to through a pipe, ended when closed."""

import multiprocessing
from collections.abc import Callable
from contextlib import AbstractContextManager

from ctcr.bench.devices.fault import DeviceFault

CONNECT_S = 20.0  # patience with a process that starts and looks for its device
END_S = 20.0  # patience with a process that ends: it stops its device first


class ProcessClient(AbstractContextManager):
    """Base of Motors and Tracker: `connect` starts the process, `close` ends it."""

    def __init__(self, device: str):
        self._device, self._pipe, self._process = device, None, None

    def start(self, target: Callable, *arguments) -> None:
        """Starts `target(*arguments, pipe)` as a process."""
        context = multiprocessing.get_context("spawn")  # a fork would keep the pipe open after this process has died
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=target, args=(*arguments, other), name=self._device)
        self._process.start()
        other.close()

    def close(self) -> None:
        """Ends the process: it stops its device when the pipe closes."""
        if self._process:
            self._pipe.close()
            self._process.join(END_S)
        self._process = None

    def __exit__(self, *_) -> None:
        self.close()

    def gone(self) -> DeviceFault:
        return DeviceFault(self._device, "its process has ended", "connect again")
