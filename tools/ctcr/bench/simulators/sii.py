"""The EEPROM of a simulated EtherCAT terminal (slave information interface): its identity and its mailbox."""

import struct
from typing import NamedTuple

SIZE = 4096  # bytes
_STRINGS, _GENERAL, _FMMU, _SYNC_MANAGERS, _END = 10, 30, 40, 41, 0xFFFF  # categories
_COE = 0x0004  # mailbox protocol
_COE_DETAILS = 0x0F  # SDO, SDO information, PDO assignment, PDO configuration


class SyncManager(NamedTuple):
    """One buffer between the bus and the terminal, as the EEPROM describes it."""

    address: int
    length: int
    control: int
    kind: int  # 1 mailbox out, 2 mailbox in, 3 outputs, 4 inputs


class Identity(NamedTuple):
    """Object 0x1018 of a terminal, and its name."""

    name: str
    product: int
    revision: int
    serial: int
    vendor: int = 2  # Beckhoff


def eeprom(identity: Identity, sync_managers: tuple[SyncManager, ...] = ()) -> bytes:
    """The content of the EEPROM. The first two sync managers are the mailbox of a terminal that speaks CoE."""
    head, general = bytearray(0x80), bytearray(32)
    struct.pack_into("<H", head, 0, 0x0C05 if sync_managers else 0x0104)
    struct.pack_into("<H", head, 14, _crc8(head[:14]))
    struct.pack_into("<4I", head, 16, identity.vendor, identity.product, identity.revision, identity.serial)
    if sync_managers:
        out, into = sync_managers[:2]
        struct.pack_into("<5H", head, 0x30, out.address, out.length, into.address, into.length, _COE)
    struct.pack_into("<2H", head, 0x7C, SIZE * 8 // 1024 - 1, 1)
    struct.pack_into("<4B", general, 0, 2, 0, 1, 1)  # numbers of the strings: group, image, order, name
    general[5] = _COE_DETAILS if sync_managers else 0
    struct.pack_into("<h", general, 0x0C, 140)  # current from the bus [mA]
    name = identity.name.encode()
    content = bytes(head) + _category(_STRINGS, bytes([2, len(name)]) + name + b"\x03STM")
    content += _category(_GENERAL, bytes(general))
    if sync_managers:
        managers = (struct.pack("<HHBBBB", m.address, m.length, m.control, 0, 1, m.kind) for m in sync_managers)
        content += _category(_FMMU, bytes((1, 2, 3, 0))) + _category(_SYNC_MANAGERS, b"".join(managers))
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
