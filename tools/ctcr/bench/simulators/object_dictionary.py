"""The object dictionary of a simulated EtherCAT terminal, and the CANopen services that read and write it."""

import struct
from collections.abc import Callable
from dataclasses import dataclass

SDO_REQUEST, SDO_RESPONSE, SDO_INFORMATION = 2, 3, 8  # services of CoE
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


class ObjectDictionary:
    """Entries by (index, subindex). `check` may raise Abort before a value is written."""

    def __init__(self, check: Callable[[int, int, int], None] = lambda index, subindex, value: None):
        self._entries: dict[tuple[int, int], Entry] = {}
        self._names: dict[int, str] = {}
        self._check = check

    def variable(self, index: int, kind: str, value: int | str, name: str) -> None:
        self._names[index] = name
        self._entries[index, 0] = Entry(kind, value, name=name)

    def record(self, index: int, name: str, entries: dict[int, Entry], resizable: bool = False) -> None:
        """Subindex 0 is the highest subindex; the host may change it where the list is `resizable`."""
        self._names[index] = name
        self._entries[index, 0] = Entry("B", max(entries), resizable, "SubIndex 000")
        for subindex, entry in entries.items():
            self._entries[index, subindex] = entry

    def __getitem__(self, key: tuple[int, int]) -> int | str:
        return self._entries[key].value

    def __setitem__(self, key: tuple[int, int], value: int | str) -> None:
        self._entries[key].value = value

    def __contains__(self, index: int) -> bool:
        return index in self._names

    @property
    def indices(self) -> list[int]:
        return sorted(self._names)

    def name(self, index: int) -> str:
        return self._names[index]

    def last(self, index: int) -> int:
        """Highest subindex."""
        return max(subindex for at, subindex in self._entries if at == index)

    def entry(self, index: int, subindex: int) -> Entry:
        """Raises Abort where there is none."""
        if index not in self._names:
            raise Abort(NO_OBJECT)
        if (index, subindex) not in self._entries:
            raise Abort(NO_SUBINDEX)
        return self._entries[index, subindex]

    def read(self, index: int, subindex: int, complete: bool) -> bytes:
        """One value, or from `subindex` on all; then subindex 0 takes two bytes."""
        if not complete:
            return self.entry(index, subindex).data
        data = b""
        for i in self._members(index, subindex):
            value = self.entry(index, i).data
            data += value.ljust(2, b"\0") if i == 0 else value
        return data

    def write(self, index: int, subindex: int, complete: bool, data: bytes) -> None:
        if not complete:
            self._write_one(index, subindex, data)
            return
        for i in self._members(index, subindex, most=0xFF):
            if not data:
                return
            size = 2 if i == 0 else len(self.entry(index, i).data)
            part, data = data[:size], data[size:]
            self._write_one(index, i, part[:1] if i == 0 else part)
        if data:
            raise Abort(WRONG_LENGTH)

    def _members(self, index: int, first: int, most: int | None = None) -> list[int]:
        if first > 1:
            raise Abort(NO_COMPLETE_ACCESS)
        last = self.entry(index, 0).value if most is None else most
        return [i for at, i in sorted(self._entries) if at == index and first <= i <= last]

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
        self._dictionary, self._room = dictionary, mailbox - 6 - 2  # after the heads of mail and CoE
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
            reply = struct.pack("<BHBI", 0x80, index, subindex, abort.code)
            return [struct.pack("<H", SDO_REQUEST << 12) + reply]
        return [struct.pack("<H", SDO_RESPONSE << 12) + reply]

    def _upload(self, command: int, index: int, subindex: int, _: bytes) -> bytes:
        data = self._dictionary.read(index, subindex, bool(command & 0x10))
        if len(data) <= 4:
            return struct.pack("<BHB", 0x43 | (4 - len(data)) << 2, index, subindex) + data.ljust(4, b"\0")
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
        complete = bool(command & 0x10)
        self._dictionary.entry(index, subindex)
        if command & 0x02:
            size = 4 - (command >> 2 & 3) if command & 0x01 else 4
            self._dictionary.write(index, subindex, complete, message[4 : 4 + size])
        else:
            size = struct.unpack_from("<I", message, 4)[0]
            data = message[8 : 8 + size]
            if len(data) == size:
                self._dictionary.write(index, subindex, complete, data)
            else:
                self._receiving, self._toggle = (index, subindex, complete, size, data), 0
        return struct.pack("<BHBI", 0x60, index, subindex, 0)

    def _download_segment(self, command: int, index: int, subindex: int, message: bytes) -> bytes:
        if command & 0x10 != self._toggle or not self._receiving:
            raise Abort(TOGGLE)
        index, subindex, complete, size, data = self._receiving
        part = message[1:]
        if len(part) == 7:
            part = part[: 7 - (command >> 1 & 7)]
        data = (data + part)[:size]
        self._receiving = index, subindex, complete, size, data
        if command & 0x01:
            self._receiving = None
            if len(data) != size:
                raise Abort(WRONG_LENGTH)
            self._dictionary.write(index, subindex, complete, data)
        reply = struct.pack("<B", 0x20 | self._toggle) + bytes(7)
        self._toggle ^= 0x10
        return reply

    # ---- SDO information

    def _information(self, request: bytes) -> list[bytes]:
        operation, dictionary = request[0] & 0x7F, self._dictionary
        try:
            if operation == 1:
                kind = struct.unpack_from("<H", request, 4)[0]
                indices = dictionary.indices if kind in (0, 1) else []
                numbers = [len(indices), 0, 0, 0, 0] if kind == 0 else indices
                return self._fragments(2, struct.pack("<H", kind), b"".join(map(_u16, numbers)))
            index = struct.unpack_from("<H", request, 4)[0]
            if operation == 3:
                entry, last = dictionary.entry(index, 0), dictionary.last(index)
                kind = _TYPES[entry.kind] if last == 0 else 0
                shape = struct.pack("<HHBB", index, kind, last, _RECORD if last else _VARIABLE)
                return self._fragments(4, shape, dictionary.name(index).encode())
            if operation == 5:
                subindex, information = request[6], request[7]
                entry = dictionary.entry(index, subindex)
                access = 0x07 | (0x38 if entry.writable else 0)
                shape = struct.pack(
                    "<HBBHHH", index, subindex, information, _TYPES[entry.kind], 8 * len(entry.data), access
                )
                return self._fragments(6, shape, entry.name.encode())
            raise Abort(UNKNOWN_COMMAND)
        except Abort as abort:
            return self._fragments(7, struct.pack("<I", abort.code), b"")

    @staticmethod
    def _fragments(operation: int, start: bytes, rest: bytes) -> list[bytes]:
        """`start` comes in the first fragment alone."""
        room = _INFO_LIMIT - len(start)
        parts = [start + rest[:room]]
        rest = rest[room:]
        while rest:
            parts, rest = [*parts, rest[:_INFO_LIMIT]], rest[_INFO_LIMIT:]
        head, messages = struct.pack("<H", SDO_INFORMATION << 12), []
        for i, part in enumerate(parts):
            left = len(parts) - 1 - i
            messages.append(head + struct.pack("<BBH", operation | (0x80 if left else 0), 0, left) + part)
        return messages


def _u16(number: int) -> bytes:
    return struct.pack("<H", number)
