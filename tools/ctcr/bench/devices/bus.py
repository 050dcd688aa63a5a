"""The EtherCAT bus with its stepper terminals: brought up, exchanged with every cycle, explained where it fails."""

import time

from ctcr.bench.devices.fault import DeviceFault, needed
from ctcr.bench.devices.stepper_drive import DriveInputs, DriveSettings, StepperDrive

RETURN_US = 20000  # patience with a frame during the bring-up, of which the default loses one in twenty under load
CYCLE_US = 2000  # and in a cycle
STATE_US = 50000
OP_S = 2.0  # longest way to OP


class Bus:
    """One master on a network interface. Every method raises DeviceFault. For one process alone, see `bus_process`."""

    def __init__(self, interface: str, positions: list[int], settings: DriveSettings):
        """`positions` of the motors' terminals on the bus, in the order of the axes; the coupler is 0."""
        self.interface, self._positions, self._settings = interface, positions, settings
        self.drives: list[StepperDrive] = []
        self.names: list[str] = []
        self._master = None

    def connect(self) -> None:
        """Finds the terminals, configures them and brings all to OP, motors off."""
        try:
            self._bring_up()
        except DeviceFault:  # a computer under load loses the answer of a mailbox now and then
            self._bring_up()

    def _bring_up(self) -> None:
        pysoem = needed("pysoem", "pysoem", f"bus {self.interface}")
        pysoem.settings.timeouts.ret = RETURN_US
        self.close()
        master = pysoem.Master()
        try:
            master.open(self.interface)
        except ConnectionError:
            remedy = "does it exist, is it up, and may this program use raw sockets? See docs/hardware.md"
            raise self._fault("cannot be opened", remedy) from None
        self._master = master
        if master.config_init() <= 0:
            raise self._fault("no terminal answers", "check the cable to the coupler and its power supply")
        self.names = [slave.name for slave in master.slaves]
        self.drives = [self._drive(position) for position in self._positions]
        for drive in self.drives:
            drive.slave.config_func = lambda _, drive=drive: drive.configure()
        try:
            master.config_map()
        except pysoem.ConfigMapError as error:
            what = f"cannot be configured ({error.error_list[0]})"
            raise self._fault(what, "switch the terminals off and on, then connect again") from None
        if master.state_check(pysoem.SAFEOP_STATE, STATE_US) != pysoem.SAFEOP_STATE:
            raise self._state_fault()
        self._to_op()

    def close(self) -> None:
        """Motors off, terminals to INIT."""
        if not self._master:
            return
        import pysoem

        if self.drives and all(drive.full_speed for drive in self.drives):
            for drive in self.drives:
                drive.command(enable=False, speed=0.0)
            self._master.send_processdata()
            self._master.receive_processdata(CYCLE_US)
        self._master.state = pysoem.INIT_STATE
        self._master.write_state()
        self._master.close()
        self._master = None

    def exchange(self) -> list[DriveInputs] | None:
        """One cycle with what the drives were commanded; None where the working counter was wrong."""
        self._master.send_processdata()
        if self._master.receive_processdata(CYCLE_US) != self._master.expected_wkc:
            return None
        return [drive.inputs() for drive in self.drives]

    def check_states(self) -> DeviceFault | None:
        """Whether every terminal is in OP, asked anew: the working counter alone does not tell."""
        import pysoem

        return None if self._master.read_state() == pysoem.OP_STATE else self._state_fault()

    def _to_op(self) -> None:
        import pysoem

        master = self._master
        for drive in self.drives:
            drive.command(enable=False, speed=0.0)
        master.send_processdata()
        master.receive_processdata(CYCLE_US)
        master.state = pysoem.OP_STATE
        master.write_state()
        end = time.monotonic() + OP_S
        while time.monotonic() < end:
            master.send_processdata()
            master.receive_processdata(CYCLE_US)
            if master.state_check(pysoem.OP_STATE, CYCLE_US) == pysoem.OP_STATE:
                pysoem.settings.timeouts.ret = CYCLE_US  # from here on nothing may hold up the cycle for long
                return
        raise self._state_fault()

    def _drive(self, position: int) -> StepperDrive:
        if position >= len(self.names):
            text = f"has {len(self.names)} devices, and none at position {position}"
            raise self._fault(text, "compare the terminals in the bench file with `ctcr devices`")
        return StepperDrive(self._master.slaves[position], position, self._settings)

    def _state_fault(self) -> DeviceFault:
        import pysoem

        self._master.read_state()
        for drive in self.drives:
            if drive.slave.state != pysoem.OP_STATE:
                if drive.slave.state == pysoem.NONE_STATE:
                    remedy = "check the plugs and the power supply from this terminal on, then connect again"
                    return drive.fault("does not answer", remedy)
                return drive.state_fault()
        return self._fault("frames come back damaged or not at all", "check the cable, then connect again")

    def _fault(self, what: str, remedy: str) -> DeviceFault:
        return DeviceFault(f"bus {self.interface}", what, remedy)
