"""The EtherCAT bus with its stepper terminals: brought up, exchanged every cycle, its faults explained."""

import time
from functools import partial

from ctcr.bench.devices.bench_file import Motors
from ctcr.bench.devices.fault import DeviceFault, needed
from ctcr.bench.devices.stepper_drive import DriveInputs, StepperDrive
from ctcr.bench.shared.ethercat import State

BRING_UP_US = 20000  # timeout of a frame during the bring-up; pysoem's own loses one in twenty under load
CYCLE_US = 2000  # and in a cycle
STATE_US = 50000
OP_S = 2.0  # longest way to OP
TRIES = 20  # of a frame that must come back whole
EDGE_S = 0.05  # for which the reset bit holds a level: many cycles of a terminal, shorter than its watchdog


class Bus:
    """One master on a network interface. Every method raises DeviceFault. For one process alone, see `bus_process`."""

    def __init__(self, interface: str, positions: list[int], settings: Motors):
        """`positions` of the motors' terminals on the bus, in the order of the axes; the coupler is 0."""
        self.interface, self._positions, self._settings = interface, positions, settings
        self._fault = partial(DeviceFault, f"bus {interface}")
        self.drives: list[StepperDrive] = []
        self.names: list[str] = []
        self._master = None

    def connect(self) -> None:
        """Finds the terminals, configures them and brings all to OP, motors off."""
        self._soem = needed("pysoem", "pysoem", f"bus {self.interface}")
        try:
            self._bring_up()
        except DeviceFault:  # under load the answer of a mailbox is lost now and then
            self._bring_up()

    def _bring_up(self) -> None:
        soem = self._soem
        soem.settings.timeouts.ret = BRING_UP_US
        self.close()
        master = soem.Master()
        try:
            master.open(self.interface)
        except (ConnectionError, UnicodeError):
            remedy = "does it exist, is it up, and may this program use raw sockets? See docs/hardware.md"
            raise self._fault("cannot be opened", remedy) from None
        self._master = master
        if master.config_init() <= 0:
            raise self._silence()
        self.names = [slave.name for slave in master.slaves]
        self.drives = [self._drive(position) for position in self._positions]
        for drive in self.drives:
            drive.slave.config_func = lambda _, drive=drive: drive.configure()
        try:
            master.config_map()
        except soem.ConfigMapError as error:
            what = f"cannot be configured ({error.error_list[0]})"
            raise self._fault(what, "switch the terminals off and on, then connect again") from None
        if master.state_check(State.SAFEOP, STATE_US) != State.SAFEOP:
            raise self._state_fault()
        self._to_op()

    def close(self) -> None:
        """Motors off, terminals to INIT."""
        if not self._master:
            return
        if self.drives and all(drive.full_speed for drive in self.drives):
            self._motors_off()
        self._request(State.INIT)
        self._master.close()
        self._master = None

    def exchange(self) -> list[DriveInputs] | None:
        """One cycle with the drives' commands; None for a wrong working counter."""
        return [drive.inputs() for drive in self.drives] if self._cycle() == self._master.expected_wkc else None

    def inputs(self) -> list[DriveInputs]:
        """The inputs of the first exchange whose frame comes back whole."""
        for _ in range(TRIES):
            if inputs := self.exchange():
                return inputs
        raise self.check_states() or self.frame_fault("frames come back damaged")

    def reset(self) -> list[StepperDrive]:
        """Resets the terminals that report an error, motors off; returns them. Raises the fault that one keeps."""
        broken = self._broken()
        for level in (False, True, False):
            end = time.monotonic() + EDGE_S
            while broken and time.monotonic() < end:
                for drive in broken:
                    drive.command(enable=False, speed=0.0, reset=level)
                self._cycle()
        for drive in self._broken():
            kept = drive.diagnosis()
            raise drive.fault(f"{kept.what}, also after a reset", f"{kept.remedy}, then release again", kept.code)
        return broken

    def _broken(self) -> list[StepperDrive]:
        return [drive for drive, said in zip(self.drives, self.inputs(), strict=True) if said.error]

    def frame_fault(self, what: str) -> DeviceFault:
        return self._fault(what, "check the cables, then connect again")

    def check_states(self, silence: bool = True) -> DeviceFault | None:
        """The fault of a terminal that is not in OP, read from all: a right working counter does not prove OP.

        Without `silence` only of one that says so: where the exchange comes back whole, a state that does not is lost.
        """
        if self._master.read_state() == State.OP:
            return None
        if silence:
            return self._state_fault()
        left = [drive for drive in self.drives if drive.slave.state not in (0, State.OP)]
        return left[0].state_fault() if left else None

    def _silence(self) -> DeviceFault:
        remedy = "check the cable to the coupler, its power supply and the load of this computer, then connect again"
        return self._fault("no terminal answers", remedy)

    def _cycle(self) -> int:
        """The working counter of one exchange."""
        self._master.send_processdata()
        return self._master.receive_processdata(CYCLE_US)

    def _motors_off(self) -> None:
        for drive in self.drives:
            drive.command(enable=False, speed=0.0)
        self._cycle()

    def _request(self, state: State) -> None:
        self._master.state = state
        self._master.write_state()

    def _to_op(self) -> None:
        self._motors_off()
        self._request(State.OP)
        end = time.monotonic() + OP_S
        while time.monotonic() < end:
            self._cycle()
            if self._master.state_check(State.OP, CYCLE_US) == State.OP:
                self._soem.settings.timeouts.ret = CYCLE_US  # from here on nothing may hold up the cycle for long
                return
        raise self._state_fault()

    def _drive(self, position: int) -> StepperDrive:
        if position >= len(self.names):
            text = f"has {len(self.names)} devices, and none at position {position}"
            raise self._fault(text, "compare the terminals in the bench file with `ctcr devices`")
        soem = self._soem
        errors = (soem.SdoError, soem.MailboxError, soem.PacketError, soem.WkcError)
        return StepperDrive(self._master.slaves[position], position, self._settings, errors)

    def _state_fault(self) -> DeviceFault:
        self._master.read_state()
        if not any(slave.state for slave in self._master.slaves):
            return self._silence()
        for drive in self.drives:
            if drive.slave.state == 0:
                remedy = "check the plugs and the power supply from this terminal on, then connect again"
                return drive.fault("does not answer", remedy)
            if drive.slave.state != State.OP:
                return drive.state_fault()
        return self.frame_fault("frames come back damaged or not at all")
