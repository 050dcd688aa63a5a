"""The EEPROM of a simulated EtherCAT terminal (slave information interface): who it is, and its mailbox."""

import struct
from dataclasses import dataclass

SIZE = 4096  # bytes
_STRINGS, _GENERAL, _FMMU, _SYNC_MANAGERS, _END = 10, 30, 40, 41, 0xFFFF
_COE = 0x0004  # mailbox protocol
_COE_DETAILS = 0x0F  # SDO, SDO information, PDO assignment, PDO configuration


@dataclass(frozen=True)
class SyncManager:
    """One buffer between the bus and the terminal, as the EEPROM describes it."""

    address: int
    length: int
    control: int
    kind: int  # 1 mailbox out, 2 mailbox in, 3 outputs, 4 inputs


@dataclass(frozen=True)
class Identity:
    """What a terminal says of itself."""

    name: str
    product: int
    revision: int
    serial: int
    vendor: int = 2  # Beckhoff


def eeprom(identity: Identity, sync_managers: tuple[SyncManager, ...] = ()) -> bytes:
    """The content; with sync managers the first two are the mailbox, and the terminal speaks CoE."""
    head = bytearray(0x80)
    struct.pack_into("<H", head, 0, 0x0C05 if sync_managers else 0x0104)
    struct.pack_into("<H", head, 14, _crc8(head[:14]))
    struct.pack_into("<4I", head, 16, identity.vendor, identity.product, identity.revision, identity.serial)
    if sync_managers:
        out, into = sync_managers[:2]
        struct.pack_into("<5H", head, 0x30, out.address, out.length, into.address, into.length, _COE)
    struct.pack_into("<2H", head, 0x7C, SIZE * 8 // 1024 - 1, 1)
    general = bytearray(32)
    general[0], general[2], general[3] = 2, 1, 1  # numbers of the strings: group, order, name
    general[5] = _COE_DETAILS if sync_managers else 0
    struct.pack_into("<h", general, 0x0C, 140)  # current from the bus [mA]
    name = identity.name.encode()
    strings = bytes([2, len(name)]) + name + bytes([3]) + b"STM"
    managers = b"".join(struct.pack("<HHBBBB", m.address, m.length, m.control, 0, 1, m.kind) for m in sync_managers)
    content = bytes(head) + _category(_STRINGS, strings) + _category(_GENERAL, bytes(general))
    if sync_managers:
        content += _category(_FMMU, bytes((1, 2, 3, 0))) + _category(_SYNC_MANAGERS, managers)
    return (content + struct.pack("<H", _END)).ljust(SIZE, b"\xff")


def _category(kind: int, content: bytes) -> bytes:
    content += b"\0" * (len(content) % 2)
    return struct.pack("<HH", kind, len(content) // 2) + content


def _crc8(data: bytes) -> int:
    """Polynomial x^8 + x^2 + x + 1, start 0xFF."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x07 if crc & 0x80 else 0)) & 0xFF
    return crc
