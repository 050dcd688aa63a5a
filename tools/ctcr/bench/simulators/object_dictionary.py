"""The object dictionary of a simulated EtherCAT terminal, and the CANopen services that read and write it."""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

SDO_REQUEST, SDO_RESPONSE, SDO_INFORMATION = 2, 3, 8  # services of CoE
# Abort codes.
NO_OBJECT, NO_SUBINDEX, READ_ONLY, WRONG_LENGTH = 0x06020000, 0x06090011, 0x06010002, 0x06070010
OUT_OF_RANGE, UNKNOWN_COMMAND, TOGGLE, NO_COMPLETE_ACCESS = 0x06090030, 0x05040001, 0x05030000, 0x06010000
_TYPES = {"?": 0x0001, "b": 0x0002, "h": 0x0003, "i": 0x0004, "B": 0x0005, "H": 0x0006, "I": 0x0007, "s": 0x0009}
_VARIABLE, _RECORD = 7, 9
_INFO_LIMIT = 100  # bytes of one fragment of SDO information


class Abort(Exception):
    """The transfer ends with this code."""

    def __init__(self, code: int):
        self.code = code


@dataclass
class Entry:
    """One value: `kind` is its format in struct, "s" a text."""

    kind: str
    value: int | str
    writable: bool = False
    name: str = "SubIndex"

    @property
    def data(self) -> bytes:
        return self.value.encode() if self.kind == "s" else struct.pack("<" + self.kind, self.value)

    def decoded(self, data: bytes) -> int | str:
        if self.kind == "s":
            return data.decode("latin-1")
        if len(data) != struct.calcsize("<" + self.kind):
            raise Abort(WRONG_LENGTH)
        return struct.unpack("<" + self.kind, data)[0]


class Object(NamedTuple):
    """Entries by subindex."""

    name: str
    entries: dict[int, Entry]


class ObjectDictionary(dict[int, Object]):
    """Objects by index. `check(index, subindex, value)` may raise Abort before a value is written."""

    def __init__(self, check: Callable[[int, int, int], None] = lambda index, subindex, value: None):
        super().__init__()
        self._check = check

    def variable(self, index: int, kind: str, value: int | str, name: str, writable: bool = False) -> None:
        self[index] = Object(name, {0: Entry(kind, value, writable, name)})

    def record(self, index: int, name: str, entries: dict[int, Entry], resizable: bool = False) -> None:
        """Subindex 0 is the highest subindex; the host may change it where the list is `resizable`."""
        self[index] = Object(name, {0: Entry("B", max(entries), resizable, "SubIndex 000"), **entries})

    def value(self, index: int, subindex: int) -> int | str:
        return self[index].entries[subindex].value

    def set(self, index: int, subindex: int, value: int | str) -> None:
        self[index].entries[subindex].value = value

    def entry(self, index: int, subindex: int) -> Entry:
        """Raises Abort where there is none."""
        if index not in self:
            raise Abort(NO_OBJECT)
        if subindex not in self[index].entries:
            raise Abort(NO_SUBINDEX)
        return self[index].entries[subindex]

    def read(self, index: int, subindex: int, complete: bool) -> bytes:
        """One value, or all from `subindex` on; then subindex 0 takes two bytes."""
        if not complete:
            return self.entry(index, subindex).data
        last = self.entry(index, 0).value
        entries = self._from(index, subindex).items()
        return b"".join(entry.data.ljust(2 if i == 0 else 0, b"\0") for i, entry in entries if i <= last)

    def write(self, index: int, subindex: int, complete: bool, data: bytes) -> None:
        if not complete:
            self._write_one(index, subindex, data)
            return
        for i, entry in self._from(index, subindex).items():
            if not data:
                return
            size = 2 if i == 0 else len(entry.data)
            part, data = data[:size], data[size:]
            self._write_one(index, i, part[:1] if i == 0 else part)
        if data:
            raise Abort(WRONG_LENGTH)

    def _from(self, index: int, first: int) -> dict[int, Entry]:
        """The entries of a complete access, in order."""
        if first > 1:
            raise Abort(NO_COMPLETE_ACCESS)
        self.entry(index, 0)
        return {i: entry for i, entry in sorted(self[index].entries.items()) if i >= first}

    def _write_one(self, index: int, subindex: int, data: bytes) -> None:
        entry = self.entry(index, subindex)
        if not entry.writable:
            raise Abort(READ_ONLY)
        value = entry.decoded(data)
        self._check(index, subindex, value)
        entry.value = value


class ServiceDataServer:
    """Answers CoE messages about a dictionary. `mailbox` is the size of a mail [bytes]."""

    def __init__(self, dictionary: ObjectDictionary, mailbox: int):
        self._dictionary, self._room = dictionary, mailbox - 6 - 2  # after the headers of mail and CoE
        self._sending, self._receiving = b"", None
        self._toggle = 0

    def answer(self, message: bytes) -> list[bytes]:
        """The CoE messages that answer one."""
        service = struct.unpack_from("<H", message)[0] >> 12
        if service == SDO_INFORMATION:
            return self._information(message[2:])
        if service != SDO_REQUEST:
            return []
        command, index, subindex = struct.unpack_from("<BHB", message, 2)
        handlers = {0: self._download_segment, 1: self._download, 2: self._upload, 3: self._upload_segment}
        try:
            if command >> 5 == 4:  # the host gave up
                self._sending, self._receiving = b"", None
                return []
            if command >> 5 not in handlers:
                raise Abort(UNKNOWN_COMMAND)
            reply = handlers[command >> 5](command, index, subindex, message[2:])
        except Abort as abort:
            return [struct.pack("<HBHBI", SDO_REQUEST << 12, 0x80, index, subindex, abort.code)]
        return [struct.pack("<H", SDO_RESPONSE << 12) + reply]

    def _upload(self, command: int, index: int, subindex: int, _: bytes) -> bytes:
        data = self._dictionary.read(index, subindex, bool(command & 0x10))
        if len(data) <= 4:
            return struct.pack("<BHB4s", 0x43 | (4 - len(data)) << 2, index, subindex, data)
        room = self._room - 8
        self._sending, self._toggle = data[room:], 0
        return struct.pack("<BHBI", 0x41, index, subindex, len(data)) + data[:room]

    def _upload_segment(self, command: int, *_) -> bytes:
        if command & 0x10 != self._toggle:
            raise Abort(TOGGLE)
        room = self._room - 1
        data, self._sending = self._sending[:room], self._sending[room:]
        head = self._toggle | (0 if self._sending else 1) | max(0, 7 - len(data)) << 1
        self._toggle ^= 0x10
        return bytes([head]) + data.ljust(7, b"\0")

    def _download(self, command: int, index: int, subindex: int, message: bytes) -> bytes:
        target = index, subindex, bool(command & 0x10)
        self._dictionary.entry(index, subindex)
        if command & 0x02:
            size = 4 - (command >> 2 & 3) if command & 0x01 else 4
            self._dictionary.write(*target, message[4 : 4 + size])
        else:
            size = struct.unpack_from("<I", message, 4)[0]
            self._receive(target, size, message[8:], last=len(message) - 8 >= size)
            self._toggle = 0
        return struct.pack("<BHBI", 0x60, index, subindex, 0)

    def _download_segment(self, command: int, _index: int, _subindex: int, message: bytes) -> bytes:
        if command & 0x10 != self._toggle or not self._receiving:
            raise Abort(TOGGLE)
        target, size, data = self._receiving
        part = message[1:]
        if len(part) == 7:
            part = part[: 7 - (command >> 1 & 7)]
        self._receive(target, size, data + part, last=bool(command & 0x01))
        reply = struct.pack("<B7x", 0x20 | self._toggle)
        self._toggle ^= 0x10
        return reply

    def _receive(self, target: tuple[int, int, bool], size: int, data: bytes, last: bool) -> None:
        """Keeps what has come so far of `size` bytes; writes it after the last segment."""
        self._receiving = None if last else (target, size, data[:size])
        if last and len(data) < size:
            raise Abort(WRONG_LENGTH)
        if last:
            self._dictionary.write(*target, data[:size])

    # ---- SDO information

    def _information(self, request: bytes) -> list[bytes]:
        operation, dictionary = request[0] & 0x7F, self._dictionary
        try:
            if operation == 1:
                kind = struct.unpack_from("<H", request, 4)[0]
                indices = sorted(dictionary) if kind in (0, 1) else []
                numbers = [len(indices), 0, 0, 0, 0] if kind == 0 else indices
                return _fragments(2, struct.pack("<H", kind), struct.pack(f"<{len(numbers)}H", *numbers))
            index = struct.unpack_from("<H", request, 4)[0]
            if operation == 3:
                entry, last = dictionary.entry(index, 0), max(dictionary[index].entries)
                kind = 0 if last else _TYPES[entry.kind]
                shape = struct.pack("<HHBB", index, kind, last, _RECORD if last else _VARIABLE)
                return _fragments(4, shape, dictionary[index].name.encode())
            if operation == 5:
                subindex, information = request[6], request[7]
                entry = dictionary.entry(index, subindex)
                numbers = _TYPES[entry.kind], 8 * len(entry.data), 0x3F if entry.writable else 0x07
                shape = struct.pack("<HBBHHH", index, subindex, information, *numbers)
                return _fragments(6, shape, entry.name.encode())
            raise Abort(UNKNOWN_COMMAND)
        except Abort as abort:
            return _fragments(7, struct.pack("<I", abort.code), b"")


def _fragments(operation: int, start: bytes, rest: bytes) -> list[bytes]:
    """Messages of SDO information; `start` comes in the first one alone."""
    content = start + rest
    parts = [content[i : i + _INFO_LIMIT] for i in range(0, len(content), _INFO_LIMIT)]
    lefts = range(len(parts) - 1, -1, -1)
    return [
        struct.pack("<HBBH", SDO_INFORMATION << 12, operation | (0x80 if left else 0), 0, left) + part
        for left, part in zip(lefts, parts, strict=True)
    ]
