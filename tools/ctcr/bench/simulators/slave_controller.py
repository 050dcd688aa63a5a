"""The EtherCAT slave controller of a simulated terminal: registers, mailbox, process data, states, watchdog."""

import struct
import time
from collections import deque
from typing import NamedTuple

from ctcr.bench.shared.ethercat import ERROR_FLAG, State
from ctcr.bench.simulators.sii import Identity, SyncManager, eeprom

# AL status codes.
INVALID_CHANGE, UNKNOWN_STATE, NO_BOOTSTRAP = 0x0011, 0x0012, 0x0013
INVALID_MAILBOX, WATCHDOG, INVALID_OUTPUTS, INVALID_INPUTS = 0x0016, 0x001B, 0x001D, 0x001E
# Registers.
_STATION, _DL_STATUS, _AL_CONTROL, _AL_STATUS, _AL_CODE = 0x0010, 0x0110, 0x0120, 0x0130, 0x0134
_PDI_CONTROL, _WD_DIVIDER, _WD_PDI, _WD_DATA, _WD_STATUS, _WD_COUNT = 0x0140, 0x0400, 0x0410, 0x0420, 0x0440, 0x0442
_EEPROM_CONTROL, _EEPROM_ADDRESS, _EEPROM_DATA = 0x0502, 0x0504, 0x0508
_FMMU, _SYNC, _PORT_TIMES, _SYSTEM_TIME, _RECEIVE_TIME = 0x0600, 0x0800, 0x0900, 0x0910, 0x0918
_MAIL_STATUS, _MAIL_ACTIVATE, _MAIL_PDI = _SYNC + 13, _SYNC + 14, _SYNC + 15  # of the mailbox to the host
_MEMORY = 0x1000
_MAIL_FULL, _REPEAT = 0x08, 0x02  # bits of _MAIL_STATUS; of _MAIL_ACTIVATE and _MAIL_PDI
_COE, _ERROR_MAIL = 3, 0  # types of mails


class Application:
    """The device behind a slave controller; this one, a coupler, has neither mailbox nor process data."""

    sync_managers: tuple[SyncManager, ...] = ()

    def __init__(self, identity: Identity):
        self.identity, self.eeprom = identity, eeprom(identity, self.sync_managers)

    def power_on(self) -> None:
        """Forgets everything that the host has set."""

    def mail(self, message: bytes) -> list[bytes]:
        """The CoE answers to a CoE message."""
        return []

    def lengths(self) -> tuple[int, int]:
        """Bytes of outputs and inputs as assigned now."""
        return 0, 0

    def entered(self, state: State) -> None:
        """The terminal is in a new state."""

    def cycle(self, now: float, outputs: bytes | None, length: int) -> bytes:
        """Inputs (`length` bytes) from outputs, which are None outside OP."""
        return b""


class Fmmu(NamedTuple):
    """Maps logical addresses onto memory."""

    logical: int
    length: int
    physical: int
    readable: bool
    writable: bool


class Buffer(NamedTuple):
    """A sync manager as the host has set it."""

    address: int = 0
    length: int = 0
    control: int = 0
    active: int = 0


class SlaveController:
    """One terminal on the bus."""

    def __init__(self, application: Application):
        self.application = application
        self.power_on()

    def power_on(self) -> None:
        """Forgets everything that the host has set."""
        self.memory = memory = bytearray(0x2000)
        struct.pack_into("<BBHBBBBH", memory, 0, 0x11, 0, 2, 4, 4, 8, 0x0F, 0)
        watchdog = {_WD_DIVIDER: 2498, _WD_PDI: 1000, _WD_DATA: 1000}  # 100 us, 100 ms, 100 ms
        spi = {_PDI_CONTROL: 0x0005}
        for register, value in ({_AL_STATUS: State.INIT, _AL_CONTROL: State.INIT} | spi | watchdog).items():
            self._put(register, value)
        memory[_WD_STATUS] = 1
        self.state, self.station, self.fmmus = State.INIT, 0, []
        self._sync = [Buffer()] * 4
        self._last_outputs = 0.0
        self._empty_mailbox()
        self.link(True)
        self.application.entered(State.INIT)

    def link(self, following: bool) -> None:
        """Notes whether another terminal follows on the second port."""
        self._put(_DL_STATUS, 0x5211 | (0x0820 if following else 0x0400))

    def _put(self, address: int, value: int) -> None:
        struct.pack_into("<H", self.memory, address, value)

    def _get(self, address: int) -> int:
        return struct.unpack_from("<H", self.memory, address)[0]

    # ---- access from the bus

    def read(self, address: int, length: int) -> bytes | None:
        """A part of the memory; None where it cannot be read now."""
        end = address + length
        if end > len(self.memory):
            return None
        data = bytes(self.memory[address:end])
        if self._is_mailbox(1, address):
            if not self._mail_waits:
                return None
            if end >= self._sync[1].address + self._sync[1].length:  # the last byte frees the mailbox
                self._mail_waits = False
                self.memory[_MAIL_STATUS] &= ~_MAIL_FULL
                self._next_mail()
        elif address < _SYSTEM_TIME + 8 and end > _SYSTEM_TIME:
            struct.pack_into("<Q", self.memory, _SYSTEM_TIME, time.monotonic_ns())
        return data

    def write(self, address: int, data: bytes) -> bool:
        """Writes memory and acts on it; whether that is possible."""
        end = address + len(data)
        if end > len(self.memory) or (_AL_STATUS <= address and end <= _AL_STATUS + 8):
            return False
        self.memory[address:end] = data
        if address >= _MEMORY:
            start, length = self._sync[0].address, self._sync[0].length
            if self._is_mailbox(0, address) and end >= start + length:
                self._mail_came(bytes(self.memory[start : start + length]))
            return True
        for first, size, action in (
            (_STATION, 1, self._set_station),
            (_AL_CONTROL, 1, self._request_state),
            (_EEPROM_CONTROL, 2, self._access_eeprom),
            (_FMMU, 0x80, self._set_fmmus),
            (_SYNC, 0x20, self._set_sync_managers),
            (_PORT_TIMES, 1, self._latch_times),
        ):
            if address < first + size and end > first:
                action()
        return True

    def exchange(self, reads: bool, writes: bool, start: int, data: bytearray, now: float) -> tuple[bool, bool]:
        """Logical access to `data` at the logical address `start`; whether it was read, and written."""
        read = written = False
        for fmmu in self.fmmus if self.state in (State.SAFEOP, State.OP) else ():
            first, last = max(start, fmmu.logical), min(start + len(data), fmmu.logical + fmmu.length)
            if first >= last:
                continue
            here, physical = slice(first - start, last - start), fmmu.physical + first - fmmu.logical
            there = slice(physical, physical + last - first)
            if fmmu.writable and writes:
                self.memory[there] = data[here]
                self._last_outputs, written = now, True
            if fmmu.readable and reads:
                data[here] = self.memory[there]
                read = True
        return read, written

    def _set_station(self) -> None:
        self.station = self._get(_STATION)

    def _access_eeprom(self) -> None:
        address = struct.unpack_from("<I", self.memory, _EEPROM_ADDRESS)[0]
        if self._get(_EEPROM_CONTROL) & 0x0700 == 0x0100:
            words = self.application.eeprom[2 * address : 2 * address + 8]
            self.memory[_EEPROM_DATA : _EEPROM_DATA + 8] = words.ljust(8, b"\xff")
        self._put(_EEPROM_CONTROL, 0)  # done, no error; writing is not possible

    def _set_fmmus(self) -> None:
        self.fmmus = []
        for logical, length, physical, kind, active in struct.iter_unpack("<IH2xHxBB3x", self.memory[_FMMU:0x0680]):
            if active & 1 and length:
                self.fmmus.append(Fmmu(logical, length, physical, bool(kind & 1), bool(kind & 2)))

    def _set_sync_managers(self) -> None:
        memory = self.memory
        self._sync = [Buffer(*row) for row in struct.iter_unpack("<HHBxBx", memory[_SYNC : _SYNC + 32])]
        for i in range(4):
            memory[_SYNC + 8 * i + 5] = _MAIL_FULL if i == 1 and self._mail_waits else 0
        if (memory[_MAIL_ACTIVATE] ^ memory[_MAIL_PDI]) & _REPEAT:  # the host asks for the last mail again
            memory[_MAIL_PDI] = memory[_MAIL_PDI] & ~_REPEAT | memory[_MAIL_ACTIVATE] & _REPEAT
            if self._last_mail and not self._mail_waits:
                self._put_mail(self._last_mail)

    def _latch_times(self) -> None:
        now = time.monotonic_ns()
        struct.pack_into("<4I", self.memory, _PORT_TIMES, *[now & 0xFFFFFFFF] * 4)
        struct.pack_into("<Q", self.memory, _RECEIVE_TIME, now)

    # ---- states

    def _request_state(self) -> None:
        control = self._get(_AL_CONTROL)
        wanted, acknowledged = control & 0x0F, control & ERROR_FLAG
        if self.memory[_AL_STATUS] & ERROR_FLAG and not acknowledged and wanted > self.state:
            return
        code = self._refusal(wanted)
        if not code:
            self._enter(State(wanted))
        self._put(_AL_STATUS, self.state | (ERROR_FLAG if code else 0))
        self._put(_AL_CODE, code)

    def _refusal(self, wanted: int) -> int:
        """The AL status code that refuses a state; 0: none."""
        order = [State.INIT, State.PREOP, State.SAFEOP, State.OP]
        if wanted == State.BOOT:
            return NO_BOOTSTRAP
        if wanted not in order:
            return UNKNOWN_STATE
        if wanted <= self.state:
            return 0
        if order.index(wanted) - order.index(self.state) != 1:
            return INVALID_CHANGE
        managers, buffers = self.application.sync_managers, self._sync
        if managers and wanted == State.PREOP and any(buffers[i].length != managers[i].length for i in (0, 1)):
            return INVALID_MAILBOX
        if managers and wanted == State.SAFEOP:
            for buffer, needed, code in zip(
                buffers[2:], self.application.lengths(), (INVALID_OUTPUTS, INVALID_INPUTS), strict=True
            ):
                if needed and (buffer.length != needed or not buffer.active & 1):
                    return code
        return 0

    def _enter(self, state: State) -> None:
        if state != self.state:
            self.state = state
            self.application.entered(state)
            self._last_outputs = time.monotonic()
        if state == State.INIT:
            self._empty_mailbox()

    def tick(self, now: float) -> None:
        """Lets the terminal work: process data, watchdog."""
        if not self.application.sync_managers:
            return
        limit = self._get(_WD_DATA) * (self._get(_WD_DIVIDER) + 2) * 40e-9
        if self.state == State.OP and limit and now - self._last_outputs > limit:
            self.memory[_WD_STATUS] = 0
            self.memory[_WD_COUNT] = min(255, self.memory[_WD_COUNT] + 1)
            self._enter(State.SAFEOP)
            self._put(_AL_STATUS, State.SAFEOP | ERROR_FLAG)
            self._put(_AL_CODE, WATCHDOG)
        elif self.state == State.OP:
            self.memory[_WD_STATUS] = 1
        out, into = self._sync[2:]
        outputs = bytes(self.memory[out.address : out.address + out.length]) if self.state == State.OP else None
        inputs = self.application.cycle(now, outputs, into.length)
        if self.state in (State.SAFEOP, State.OP):
            self.memory[into.address : into.address + into.length] = inputs

    # ---- mailbox

    def _empty_mailbox(self) -> None:
        self._waiting: deque[bytes] = deque()
        self._last_mail, self._mail_waits = b"", False
        self._last_counter = self._counter = 0

    def _is_mailbox(self, number: int, address: int) -> bool:
        buffer = self._sync[number]
        inside = _MEMORY <= address and buffer.address <= address < buffer.address + buffer.length
        return bool(inside and buffer.active & 1 and buffer.control & 3 == 2 and self.state != State.INIT)

    def _mail_came(self, mail: bytes) -> None:
        length, kind = struct.unpack_from("<H3xB", mail)
        counter = kind >> 4 & 7
        if counter and counter == self._last_counter:
            return  # sent again because its echo was lost
        self._last_counter = counter
        body = mail[6 : 6 + length]
        if kind & 0x0F == _COE and len(body) >= 8:
            answers = [(_COE, answer) for answer in self.application.mail(body)]
        else:
            answers = [(_ERROR_MAIL, struct.pack("<HH", 1, 2))]  # protocol not supported
        for kind, body in answers:
            self._counter = self._counter % 7 + 1
            self._waiting.append(struct.pack("<H3xB", len(body), kind | self._counter << 4) + body)
        self._next_mail()

    def _next_mail(self) -> None:
        if not self._mail_waits and self._waiting:
            self._put_mail(self._waiting.popleft())

    def _put_mail(self, mail: bytes) -> None:
        start, length = self._sync[1].address, self._sync[1].length
        self.memory[start : start + length] = mail.ljust(length, b"\0")
        self.memory[_MAIL_STATUS] |= _MAIL_FULL
        self._last_mail, self._mail_waits = mail, True
