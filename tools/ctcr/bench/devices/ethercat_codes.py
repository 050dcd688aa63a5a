"""Codes of EtherCAT terminals in words: what happened and what to do."""

_STATES = {0x00: "none", 0x01: "INIT", 0x02: "PREOP", 0x03: "BOOT", 0x04: "SAFEOP", 0x08: "OP"}

_STATUS_CODES = {
    0x0001: ("unspecified error", "switch the terminals off and on"),
    0x0011: ("change of state that is not possible", "connect again"),
    0x0012: ("unknown state", "connect again"),
    0x0016: ("wrong settings of the mailbox", "connect again; is the terminal of the expected type?"),
    0x001A: ("out of step", "use a longer bus period"),
    0x001B: (
        "watchdog: no process data for 100 ms, so the motors were switched off",
        "check the cable and the load of the computer, then release the stop and connect again",
    ),
    0x001D: ("wrong length of outputs", "connect again; is the terminal of the expected type?"),
    0x001E: ("wrong length of inputs", "connect again; is the terminal of the expected type?"),
    0x0050: ("EEPROM does not answer", "switch the terminals off and on"),
}

DIAGNOSIS = 0xA010  # object whose subindices say what is wrong with the motor
_DIAGNOSES = {
    1: ("current saturated", "the load is too high: move slower, look for friction"),
    2: ("terminal too hot", "check the motor current that is set and the air around the terminal, let it cool"),
    3: ("torque overload", "move slower, look for something that blocks the axis"),
    4: ("motor supply too low", "check the motor's power supply and its fuse"),
    5: ("motor supply too high", "check the motor's power supply; braking can raise it"),
    6: ("short circuit or over-current in coil A", "switch off, check the motor's cable and coil A"),
    7: ("short circuit or over-current in coil B", "switch off, check the motor's cable and coil B"),
    8: ("no control power", "check the power contacts of the terminals"),
    9: ("other error", "switch the terminals off and on"),
    10: ("wrong settings", "check the `motors` section of the bench file"),
    11: ("motor stalled", "something blocks the axis, or it moves too fast"),
}
DIAGNOSES = tuple(_DIAGNOSES)


def state_name(state: int) -> str:
    """Of an AL status; with the error bit."""
    return _STATES.get(state & 0x0F, f"{state & 0x0F:#x}") + (" with an error" if state & 0x10 else "")


def status_text(code: int) -> tuple[str, str]:
    """What an AL status code means, what to do."""
    return _STATUS_CODES.get(code, ("unknown code", "see the terminal's manual for this code"))


def diagnosis_text(subindex: int) -> tuple[str, str]:
    """What a set bit of the motor's diagnosis means, what to do."""
    return _DIAGNOSES[subindex]
