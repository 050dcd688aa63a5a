"""The EtherCAT slave controller of a simulated terminal: registers, mailbox, process data, states, watchdog."""

import struct
import time
from collections import deque
from typing import NamedTuple, Protocol

from ctcr.bench.simulators.sii import SyncManager

INIT, PREOP, BOOT, SAFEOP, OP = 1, 2, 3, 4, 8
ERROR = 0x10  # bit of the AL status
INVALID_CHANGE, UNKNOWN_STATE, NO_BOOTSTRAP = 0x0011, 0x0012, 0x0013
INVALID_MAILBOX, WATCHDOG, INVALID_OUTPUTS, INVALID_INPUTS = 0x0016, 0x001B, 0x001D, 0x001E
_STATION, _DL_STATUS, _AL_CONTROL, _AL_STATUS, _AL_CODE = 0x0010, 0x0110, 0x0120, 0x0130, 0x0134
_WD_DIVIDER, _WD_DATA, _WD_STATUS, _WD_COUNT = 0x0400, 0x0420, 0x0440, 0x0442
_EEPROM_CONTROL, _EEPROM_ADDRESS, _EEPROM_DATA = 0x0502, 0x0504, 0x0508
_FMMU, _SYNC, _MEMORY = 0x0600, 0x0800, 0x1000
_COE, _ERROR_MAIL = 3, 0


class Application(Protocol):
    """What stands behind a slave controller."""

    eeprom: bytes
    sync_managers: tuple[SyncManager, ...]  # none: no mailbox, no process data

    def mail(self, message: bytes) -> list[bytes]:
        """The CoE answers to a CoE message."""

    def lengths(self) -> tuple[int, int]:
        """Bytes of outputs and inputs as assigned now."""

    def entered(self, state: int) -> None:
        """The terminal is in a new state."""

    def cycle(self, now: float, outputs: bytes | None, length: int) -> bytes:
        """Inputs (`length` bytes) from outputs, which are None outside OP."""


class Fmmu(NamedTuple):
    """Maps logical addresses onto memory."""

    logical: int
    length: int
    physical: int
    readable: bool
    writable: bool


class SlaveController:
    """One terminal on the bus. `linked`: another one follows it."""

    def __init__(self, application: Application):
        self.application = application
        self.power_on()

    def power_on(self) -> None:
        """As after switching on: everything the host has set is forgotten."""
        self.memory = memory = bytearray(0x2000)
        struct.pack_into("<BBHBBBBH", memory, 0, 0x11, 0, 2, 4, 4, 8, 0x0F, 0)
        self._put(_AL_STATUS, INIT)
        self._put(_AL_CONTROL, INIT)
        self._put(0x0140, 0x0005)  # process data interface: SPI
        self._put(_WD_DIVIDER, 2498)  # 100 us
        self._put(0x0410, 1000)
        self._put(_WD_DATA, 1000)  # 100 ms
        memory[_WD_STATUS] = 1
        self.state, self.station, self.fmmus = INIT, 0, []
        self._sync = [(0, 0, 0, 0)] * 4  # address, length, control, activation
        self._last_outputs = 0.0
        self._empty_mailbox()
        self.link(True)
        self.application.entered(INIT)

    def link(self, following: bool) -> None:
        """Whether a terminal follows on the second port."""
        port1 = 0x0820 if following else 0x0400
        self._put(_DL_STATUS, 0x5211 | port1)

    def _put(self, address: int, value: int) -> None:
        struct.pack_into("<H", self.memory, address, value)

    def _get(self, address: int) -> int:
        return struct.unpack_from("<H", self.memory, address)[0]

    # ---- access from the bus

    def read(self, address: int, length: int) -> bytes | None:
        """Memory, or None where it cannot be read now."""
        end = address + length
        if end > len(self.memory):
            return None
        data = bytes(self.memory[address:end])
        if address >= _MEMORY and self._is_mailbox(1, address):
            if not self._mail_waits:
                return None
            if end >= self._sync[1][0] + self._sync[1][1]:  # the last byte frees the mailbox
                self._mail_waits = False
                self.memory[0x080D] &= ~0x08
                self._next_mail()
        elif address < 0x0918 and end > 0x0910:
            struct.pack_into("<Q", self.memory, 0x0910, time.monotonic_ns())
        return data

    def write(self, address: int, data: bytes) -> bool:
        """Whether it was taken."""
        end = address + len(data)
        if end > len(self.memory) or (_AL_STATUS <= address and end <= _AL_STATUS + 8):
            return False
        self.memory[address:end] = data
        if address >= _MEMORY:
            if self._is_mailbox(0, address):
                start, length = self._sync[0][:2]
                if end >= start + length:
                    self._mail_came(bytes(self.memory[start : start + length]))
            return True

        def covers(register: int) -> bool:
            return address <= register < end

        if covers(_STATION):
            self.station = self._get(_STATION)
        if covers(_AL_CONTROL):
            self._request_state(self._get(_AL_CONTROL))
        if covers(_EEPROM_CONTROL + 1) or address == _EEPROM_CONTROL:
            self._access_eeprom()
        if address < _FMMU + 0x80 and end > _FMMU:
            self._set_fmmus()
        if address < _SYNC + 0x20 and end > _SYNC:
            self._set_sync_managers()
        if covers(0x0900):
            self._latch_times()
        return True

    def exchange(self, command_reads: bool, command_writes: bool, start: int, data: bytearray, now: float):
        """Logical access to `data` at the logical address `start`; whether it was read and written."""
        read = written = False
        if self.state not in (SAFEOP, OP):
            return read, written
        for fmmu in self.fmmus:
            first = max(start, fmmu.logical)
            last = min(start + len(data), fmmu.logical + fmmu.length)
            if first >= last:
                continue
            here, there = slice(first - start, last - start), fmmu.physical + first - fmmu.logical
            there = slice(there, there + last - first)
            if fmmu.writable and command_writes:
                self.memory[there] = data[here]
                self._last_outputs, written = now, True
            if fmmu.readable and command_reads:
                data[here] = self.memory[there]
                read = True
        return read, written

    def _access_eeprom(self) -> None:
        address = struct.unpack_from("<I", self.memory, _EEPROM_ADDRESS)[0]
        if self._get(_EEPROM_CONTROL) & 0x0700 == 0x0100:
            words = self.application.eeprom[2 * address : 2 * address + 8]
            self.memory[_EEPROM_DATA : _EEPROM_DATA + 8] = words.ljust(8, b"\xff")
        self._put(_EEPROM_CONTROL, 0)  # done, no error; writing is not possible

    def _set_fmmus(self) -> None:
        self.fmmus = []
        for i in range(8):
            logical, length, _, _, physical, _, kind, active = struct.unpack_from(
                "<IHBBHBBB", self.memory, _FMMU + 16 * i
            )
            if active & 1 and length:
                self.fmmus.append(Fmmu(logical, length, physical, bool(kind & 1), bool(kind & 2)))

    def _set_sync_managers(self) -> None:
        self._sync = []
        for i in range(4):
            address, length, control, _, active, _ = struct.unpack_from("<HHBBBB", self.memory, _SYNC + 8 * i)
            self._sync.append((address, length, control, active))
            self.memory[_SYNC + 5 + 8 * i] = 0x08 if i == 1 and self._mail_waits else 0
        if (self.memory[0x080E] ^ self.memory[0x080F]) & 0x02:  # the host asks for the last mail again
            self.memory[0x080F] = self.memory[0x080F] & ~0x02 | self.memory[0x080E] & 0x02
            if self._last_mail and not self._mail_waits:
                self._put_mail(self._last_mail)

    def _latch_times(self) -> None:
        now = time.monotonic_ns()
        for port in range(4):
            struct.pack_into("<I", self.memory, 0x0900 + 4 * port, now & 0xFFFFFFFF)
        struct.pack_into("<Q", self.memory, 0x0918, now)

    # ---- states

    def _request_state(self, control: int) -> None:
        wanted, acknowledged = control & 0x0F, control & ERROR
        if self.memory[_AL_STATUS] & ERROR and not acknowledged and wanted > self.state:
            return
        code = self._obstacle(wanted)
        if code:
            self._put(_AL_STATUS, self.state | ERROR)
            self._put(_AL_CODE, code)
            return
        self._enter(wanted)
        self._put(_AL_STATUS, wanted)
        self._put(_AL_CODE, 0)

    def _obstacle(self, wanted: int) -> int:
        """The code that refuses a state; 0: none."""
        order = [INIT, PREOP, SAFEOP, OP]
        if wanted == BOOT:
            return NO_BOOTSTRAP
        if wanted not in order:
            return UNKNOWN_STATE
        if wanted <= self.state:
            return 0
        if order.index(wanted) - order.index(self.state) != 1:
            return INVALID_CHANGE
        managers = self.application.sync_managers
        if wanted == PREOP and managers and [s[1] for s in self._sync[:2]] != [m.length for m in managers[:2]]:
            return INVALID_MAILBOX
        if wanted == SAFEOP and managers:
            outputs, inputs = self.application.lengths()
            for (_, length, _, active), needed, refusal in zip(
                self._sync[2:], (outputs, inputs), (INVALID_OUTPUTS, INVALID_INPUTS), strict=True
            ):
                if needed and (length != needed or not active & 1):
                    return refusal
        return 0

    def _enter(self, state: int) -> None:
        if state != self.state:
            self.state = state
            self.application.entered(state)
            self._last_outputs = time.monotonic()
        if state == INIT:
            self._empty_mailbox()

    def tick(self, now: float) -> None:
        """Lets the terminal work: process data, watchdog."""
        if not self.application.sync_managers:
            return
        limit = self._get(_WD_DATA) * (self._get(_WD_DIVIDER) + 2) * 40e-9
        if self.state == OP and limit and now - self._last_outputs > limit:
            self.memory[_WD_STATUS] = 0
            self.memory[_WD_COUNT] = min(255, self.memory[_WD_COUNT] + 1)
            self._enter(SAFEOP)
            self._put(_AL_STATUS, SAFEOP | ERROR)
            self._put(_AL_CODE, WATCHDOG)
        elif self.state == OP:
            self.memory[_WD_STATUS] = 1
        (out, out_length, *_), (into, in_length, *_) = self._sync[2:]
        outputs = bytes(self.memory[out : out + out_length]) if self.state == OP else None
        inputs = self.application.cycle(now, outputs, in_length)
        if self.state in (SAFEOP, OP):
            self.memory[into : into + in_length] = inputs

    # ---- mailbox

    def _empty_mailbox(self) -> None:
        self._waiting: deque[bytes] = deque()
        self._last_mail, self._mail_waits = b"", False
        self._last_counter = self._counter = 0

    def _is_mailbox(self, manager: int, address: int) -> bool:
        start, length, control, active = self._sync[manager]
        return bool(active & 1 and control & 3 == 2 and start <= address < start + length and self.state != INIT)

    def _mail_came(self, mail: bytes) -> None:
        length, _, _, kind = struct.unpack_from("<HHBB", mail)
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
            self._waiting.append(struct.pack("<HHBB", len(body), 0, 0, kind | self._counter << 4) + body)
        self._next_mail()

    def _next_mail(self) -> None:
        if not self._mail_waits and self._waiting:
            self._put_mail(self._waiting.popleft())

    def _put_mail(self, mail: bytes) -> None:
        start, length = self._sync[1][:2]
        self.memory[start : start + length] = mail.ljust(length, b"\0")
        self.memory[0x080D] |= 0x08
        self._last_mail, self._mail_waits = mail, True
