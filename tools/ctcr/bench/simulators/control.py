"""The control socket of a simulator: one JSON object is asked, one answers, in a folder that only its owner sees."""

import json
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ctcr.errors import InputError, Problem

LARGEST = 1 << 16  # bytes of a message


class ControlSocket:
    """Listens as `folder/name.sock`; wait for `fileno` and then call `answer`."""

    def __init__(self, folder: Path, name: str, handler: Callable[[dict[str, Any]], Any]):
        """`handler` gets what was asked, and returns what JSON can hold; its InputErrors go back to who asked."""
        self.path, self._handler = folder / f"{name}.sock", handler
        if _is_answered(self.path):
            raise InputError(Problem("a simulator of this name is running there already", str(self.path)))
        self.path.unlink(missing_ok=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.bind(str(self.path))
        self._socket.listen(8)

    def fileno(self) -> int:
        return self._socket.fileno()

    def answer(self) -> None:
        """Answers one request."""
        connection, _ = self._socket.accept()
        with connection:
            connection.settimeout(0.2)  # who connects and says nothing must not stop the device
            try:
                reply = {"reply": self._handler(json.loads(connection.recv(LARGEST)))}
            except InputError as error:
                reply = {"error": str(error)}
            except (ValueError, OSError) as error:
                reply = {"error": f"not a request: {error}"}
            try:
                connection.send(json.dumps(reply).encode())
            except OSError:
                pass  # gone without waiting for the answer

    def close(self) -> None:
        self._socket.close()
        self.path.unlink(missing_ok=True)


def request(folder: Path, name: str, message: dict[str, Any]) -> Any:
    """Asks the simulator `name`; raises InputError where none answers, and with what it refuses."""
    path = folder / f"{name}.sock"
    try:
        with _connected(path) as connection:
            connection.send(json.dumps(message).encode())
            reply = json.loads(connection.recv(LARGEST))
    except (OSError, ValueError):
        raise InputError(Problem(f"no simulator answers: start `ctcr sim {name}`", str(path))) from None
    if "error" in reply:
        raise InputError(Problem(reply["error"], name))
    return reply["reply"]


def _connected(path: Path) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    connection.settimeout(5.0)
    try:
        connection.connect(os.fspath(path))
    except OSError:
        connection.close()
        raise
    return connection


def _is_answered(path: Path) -> bool:
    try:
        _connected(path).close()
    except OSError:
        return False
    return True
