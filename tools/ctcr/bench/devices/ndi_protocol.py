"""Framing and codes of NDI's combined API: what the tracker and its clients agree on.

A command is `NAME:arguments<CRC>` or, without CRC, `NAME arguments`, then a carriage return; an answer in text
ends with its CRC and a carriage return.
"""

RESET_MESSAGE = b"RESETBE6F\r"
RESET_BAUD = 9600
BAUD_CODES = {9600: "0", 14400: "1", 19200: "2", 38400: "3", 57600: "4", 115200: "5", 921600: "6", 230400: "A"}
BX_START = 0xA5C4
BX_VALID, BX_MISSING, BX_DISABLED = 1, 2, 4
REPORT_OUT_OF_VOLUME = 0x0800  # reply option; without it such a tool counts as missing
TRANSFORMS = 0x0001  # reply option

TOOL_IN_PORT, INITIALISED, ENABLED, OUT_OF_VOLUME = 0x001, 0x010, 0x020, 0x040  # bits of the port status

ERRORS = {
    0x01: ("unknown command", "the device is no Aurora, or its firmware is older than the combined API"),
    0x03: ("incomplete command", "check the cable"),
    0x04: ("wrong CRC in a command", "check the cable and keep it away from the motors' cables"),
    0x06: ("baud rate not supported", "choose another `baud` in the bench file"),
    0x07: ("wrong parameters of the serial line", "choose another `baud` in the bench file"),
    0x08: ("unknown port handle", "a tool was unplugged: plug it in and connect again"),
    0x09: ("wrong tracking priority", "the tool cannot be tracked this way"),
    0x0C: ("command not possible in this mode", "connect again"),
    0x0E: ("tool not initialised", "unplug the tool, plug it in and connect again"),
    0x10: ("device not initialised", "connect again"),
    0x1A: ("internal failure", "switch the device off and on"),
    0x23: ("value out of range", "the device is no Aurora, or its firmware differs"),
    0x2D: ("cannot read the tool's memory", "unplug the tool and plug it in"),
}

_SYSTEM_STATUS = {
    0x0001: ("serial line out of step", "check the cable"),
    0x0004: ("failure of the hardware", "switch the device off and on"),
    0x0008: ("failure of a tool's hardware", "replace the tool"),
    0x0010: ("a tool was plugged in or unplugged", "connect again, so that its handle is known"),
    0x0100: ("diagnostic pending", "look at the device's lamps"),
}


def _table() -> list[int]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
        table.append(byte)
    return table


_CRC = _table()


def crc16(data: bytes) -> int:
    """CRC-16/ARC: reflected polynomial 0xA001, start 0."""
    crc = 0
    for byte in data:
        crc = crc >> 8 ^ _CRC[(crc ^ byte) & 0xFF]
    return crc


def framed(text: bytes) -> bytes:
    """A command or an answer with its CRC and the carriage return."""
    return text + b"%04X\r" % crc16(text)


def system_troubles(status: int) -> list[tuple[str, str]]:
    """What the bits of the system status say: what is wrong, what to do."""
    return [text for bit, text in _SYSTEM_STATUS.items() if status & bit]
