"""A line of EtherCAT terminals: what a frame meets on its way out and back."""

import struct

from ctcr.bench.simulators.slave_controller import SlaveController

ETHERTYPE = 0x88A4
_HEAD = 16  # bytes before the first datagram: Ethernet and EtherCAT
_AUTO = {1: (True, False), 2: (False, True), 3: (True, True)}  # command: whether it reads, writes
_FIXED = {4: (True, False), 5: (False, True), 6: (True, True)}
_BROADCAST = {7: (True, False), 8: (False, True), 9: (True, True)}
_LOGICAL = {10: (True, False), 11: (False, True), 12: (True, True)}
_READ_THEN_WRITE = {13: "position", 14: "station"}  # the addressed terminal reads, the others write


class Segment:
    """Terminals in the order of the bus; `reachable` of them answer."""

    def __init__(self, slaves: list[SlaveController]):
        self.slaves, self.reachable = slaves, len(slaves)
        self.connect(len(slaves))

    def connect(self, reachable: int) -> None:
        """Only the first `reachable` terminals answer from now on."""
        self.reachable = reachable
        for i, slave in enumerate(self.slaves):
            slave.link(i + 1 < reachable)

    def tick(self, now: float) -> None:
        for slave in self.slaves:
            slave.tick(now)

    def pass_through(self, frame: bytearray, now: float) -> bool:
        """Lets the terminals work on a frame, in place; whether it was one of EtherCAT that comes back."""
        if len(frame) < _HEAD or struct.unpack_from(">H", frame, 12)[0] != ETHERTYPE or not self.reachable:
            return False
        head = struct.unpack_from("<H", frame, 14)[0]
        end, place = min(len(frame), _HEAD + (head & 0x7FF)), _HEAD
        if head >> 12 != 1:
            return False
        while place + 12 <= end:
            size = struct.unpack_from("<H", frame, place + 6)[0]
            length = size & 0x7FF
            if place + 12 + length > end:
                return False
            self._datagram(frame, place, length, now)
            place += 12 + length
            if not size & 0x8000:
                break
        frame[6] |= 0x02  # the mark of a frame that has passed terminals
        return True

    def _datagram(self, frame: bytearray, place: int, length: int, now: float) -> None:
        command, _, target, address = struct.unpack_from("<BBHH", frame, place)
        data = frame[place + 10 : place + 10 + length]
        if command in _LOGICAL:
            count = self._logical(*_LOGICAL[command], target | address << 16, data, now)
        else:
            count, target = self._addressed(command, target, address, data)
            struct.pack_into("<H", frame, place + 2, target)
        frame[place + 10 : place + 10 + length] = data
        counter = struct.unpack_from("<H", frame, place + 10 + length)[0]
        struct.pack_into("<H", frame, place + 10 + length, counter + count & 0xFFFF)

    def _logical(self, reads: bool, writes: bool, start: int, data: bytearray, now: float) -> int:
        count = 0
        for slave in self.slaves[: self.reachable]:
            read, written = slave.exchange(reads, writes, start, data, now)
            count += read + (2 if reads else 1) * written
        return count

    def _addressed(self, command: int, target: int, address: int, data: bytearray) -> tuple[int, int]:
        """The working counter and the target address as it comes back."""
        count = 0
        for slave in self.slaves[: self.reachable]:
            here = target == 0 if command in _AUTO or command == 13 else target == slave.station != 0
            if command in _READ_THEN_WRITE:
                reads, writes = here, not here
            elif command in _BROADCAST:
                reads, writes = _BROADCAST[command]
            else:
                reads, writes = (_AUTO | _FIXED).get(command, (False, False)) if here else (False, False)
            sent = bytes(data)
            if reads and (found := slave.read(address, len(data))) is not None:
                data[:] = bytes(a | b for a, b in zip(data, found, strict=True)) if command == 7 else found
                count += 1
            if writes and slave.write(address, sent):
                count += 2 if reads else 1
            if command in _AUTO or command in _BROADCAST or command == 13:
                target = target + 1 & 0xFFFF
        return count, target
