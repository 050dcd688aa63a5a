"""The control socket of a simulator in the folder of the bench: one JSON object as request, one as reply."""

import json
import socket
from collections.abc import Callable, Container
from contextlib import suppress
from pathlib import Path
from typing import Any

from ctcr.errors import InputError, Problem

LARGEST = 1 << 16  # bytes of a message


class ControlSocket:
    """Listens as `folder/name.sock`; wait for one of `sources` and then call `answer`, which never waits."""

    def __init__(self, folder: Path, name: str, handler: Callable[[dict[str, Any]], Any]):
        """`handler` gets the request and returns the reply; its InputErrors are sent back to who asked."""
        self.path, self._handler = folder / f"{name}.sock", handler
        try:
            _connected(self.path).close()
        except OSError:
            self.path.unlink(missing_ok=True)  # left behind by a simulator that was killed
        else:
            text = "a simulator of this name is running there already: end it, or use another --folder"
            raise InputError(Problem(text, str(self.path)))
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.bind(str(self.path))
        self._socket.listen(8)
        self._clients: list[socket.socket] = []  # that have sent nothing yet

    @property
    def sources(self) -> list[socket.socket]:
        return [self._socket, *self._clients]

    def answer(self, ready: Container[object]) -> None:
        """Answers the requests of the `sources` that are ready."""
        for client in self._clients[:]:
            if client in ready:
                self._clients.remove(client)
                self._answer(client)
        if self._socket in ready:
            client, _ = self._socket.accept()
            client.setblocking(False)
            self._clients.append(client)

    def _answer(self, connection: socket.socket) -> None:
        with connection:
            try:
                reply = {"reply": self._handler(json.loads(connection.recv(LARGEST)))}
            except InputError as error:
                reply = {"error": str(error)}
            except Exception as error:  # whatever a client sends, the device goes on
                reply = {"error": f"not a request: {error}"}
            with suppress(OSError):  # the client has gone
                connection.send(json.dumps(reply).encode())

    def close(self) -> None:
        for source in self.sources:
            source.close()
        self.path.unlink(missing_ok=True)


def request(folder: Path, name: str, message: dict[str, Any]) -> Any:
    """The reply of the simulator `name`. Raises InputError where none runs, or where it refuses."""
    path = folder / f"{name}.sock"
    try:
        with _connected(path) as connection:
            connection.send(json.dumps(message).encode())
            reply = json.loads(connection.recv(LARGEST))
    except (OSError, ValueError):
        raise InputError(Problem(f"no simulator answers: start `ctcr sim {name}`", str(path))) from None
    if "error" in reply:
        raise InputError(Problem(line, name) for line in reply["error"].splitlines())
    return reply["reply"]


def _connected(path: Path) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    connection.settimeout(5.0)
    try:
        connection.connect(str(path))
    except OSError:
        connection.close()
        raise
    return connection
