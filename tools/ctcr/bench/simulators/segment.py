"""A line of EtherCAT terminals: how a frame passes through them on its way out and back."""

import struct

from ctcr.bench.simulators.slave_controller import SlaveController

ETHERTYPE = 0x88A4
_HEADER = 16  # bytes before the first datagram: Ethernet and EtherCAT
# Commands 1 to 12 are three operations (read, write, read and write) for each way of addressing; in the other two the
# addressed terminal reads and all others write.
_AUTO_INCREMENT, _FIXED, _BROADCAST, _LOGICAL = range(4)
_BROADCAST_READ, _AUTO_READ_MULTIPLE_WRITE, _FIXED_READ_MULTIPLE_WRITE = 7, 13, 14


class Segment:
    """Terminals in the order of the bus; the first `reachable` of them answer."""

    def __init__(self, slaves: list[SlaveController]):
        self.slaves = slaves
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
        """Lets the terminals process a frame in place; whether it was an EtherCAT frame that comes back."""
        if len(frame) < _HEADER or struct.unpack_from(">H", frame, 12)[0] != ETHERTYPE or not self.reachable:
            return False
        header = struct.unpack_from("<H", frame, 14)[0]
        end, at = min(len(frame), _HEADER + (header & 0x7FF)), _HEADER
        if header >> 12 != 1:
            return False
        while at + 12 <= end:
            size = struct.unpack_from("<H", frame, at + 6)[0]
            length = size & 0x7FF
            if at + 12 + length > end:
                return False
            self._datagram(frame, at, length, now)
            at += 12 + length
            if not size & 0x8000:
                break
        frame[6] |= 0x02  # the mark of a frame that has passed terminals
        return True

    def _datagram(self, frame: bytearray, at: int, length: int, now: float) -> None:
        command, _, target, address = struct.unpack_from("<BBHH", frame, at)
        data = frame[at + 10 : at + 10 + length]
        addressing, operation = divmod(command - 1, 3)
        reads, writes, count = operation != 1, operation != 0, 0
        if addressing == _LOGICAL and command <= 12:
            for slave in self.slaves[: self.reachable]:
                read, written = slave.exchange(reads, writes, target | address << 16, data, now)
                count += read + (2 if reads else 1) * written
        elif 1 <= command <= _FIXED_READ_MULTIPLE_WRITE:
            count, target = self._addressed(command, addressing, (reads, writes), target, address, data)
            struct.pack_into("<H", frame, at + 2, target)
        frame[at + 10 : at + 10 + length] = data
        working_counter = struct.unpack_from("<H", frame, at + 10 + length)[0]
        struct.pack_into("<H", frame, at + 10 + length, working_counter + count & 0xFFFF)

    def _addressed(
        self, command: int, addressing: int, access: tuple[bool, bool], target: int, address: int, data: bytearray
    ) -> tuple[int, int]:
        """The increment of the working counter, and the target address as it comes back."""
        count, multiple = 0, command in (_AUTO_READ_MULTIPLE_WRITE, _FIXED_READ_MULTIPLE_WRITE)
        by_position = addressing == _AUTO_INCREMENT or command == _AUTO_READ_MULTIPLE_WRITE
        for slave in self.slaves[: self.reachable]:
            here = target == 0 if by_position else addressing == _BROADCAST or target == slave.station != 0
            reads, writes = (here, not here) if multiple else access if here else (False, False)
            sent = bytes(data)
            if reads and (found := slave.read(address, len(data))) is not None:
                either = command == _BROADCAST_READ  # answers of all terminals are ORed
                data[:] = bytes(a | b for a, b in zip(data, found, strict=True)) if either else found
                count += 1
            if writes and slave.write(address, sent):
                count += 2 if reads else 1
            if by_position or addressing == _BROADCAST:
                target = target + 1 & 0xFFFF
        return count, target
