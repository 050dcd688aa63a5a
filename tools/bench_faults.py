"""Writes docs/bench_faults.md: the effects of faults on a recording on the simulated bench.

The recorder is the real one; faults come from the simulators, or strike its processes. After each, the fault is mended
and the same command is run again, until the plan is done. Fails where a row is lost or a message is wrong. Needs no
rights beyond those of `ctcr sim bench`. Four minutes; the kills another ten.
"""

import argparse
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from ctcr.bench.devices import emergency_stop
from ctcr.bench.devices.release import release
from ctcr.bench.shared.control import request
from ctcr.bench.simulators import aurora, ethercat
from ctcr.robot import robot_file
from origin import ROOT, written_by

TARGET = ROOT / "docs" / "bench_faults.md"
HOME_MM = [-449.0, -320.5, -193.0]  # tips near the plate, so that homing is short
BENCH = """tracker: {port: simulated}
motors:
  interface: simulated
  translation_terminals: [1, 2, 3]
  rotation_terminals: [4, 5, 6]
  speed_mm_s: 18
  speed_deg_s: 180
  lag_mm: 0.4
limits:
  translation_mm: [[-465, -430], [-335, -310], [-200, -185]]
  rotation_deg: [[-400, 400], [-400, 400], [-400, 400]]
  clearance_mm: 5
person: simulated
"""
ROWS, STRUCK_AFTER = 10, 3  # rows of a plan, and rows measured before the fault
DISK = "64k"
OPTIONS = ("--dwell", "0.05", "--patience", "1.5")
LONGEST_S = 60.0
BRAKING_S = 0.2  # `ramp_s` of the bench file


def near_the_plate(robot: Path, bench: Path) -> None:
    """Writes the files of a bench on which homing is short."""
    short = robot_file.load(ROOT / "examples" / "data" / "demo" / "robot.yaml")
    short.actuation.home_translation_mm = HOME_MM
    robot_file.save(short, robot)
    bench.write_text(BENCH, encoding="utf-8")


class Wires:
    """A simulated bench, with recordings of one plan on it."""

    def __init__(self, folder: Path, wires: Path, rows: int, seed: int = 3):
        self.folder, self.wires, self.rows = folder, wires, rows
        self._plan(np.random.default_rng(seed))

    def _plan(self, rng: np.random.Generator) -> None:
        lines = ["run,beta1_m,beta2_m,beta3_m,alpha1_rad,alpha2_rad,alpha3_rad"]
        for _ in range(self.rows):
            joints = [*(1e-3 * np.array(HOME_MM) + rng.uniform(-2e-3, 2e-3, 3)), *rng.uniform(-0.3, 0.3, 3)]
            lines.append(",".join(f"{v:.9g}" for v in [0, *joints]))
        (self.folder / "plan.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")

    def command(self, *arguments: object) -> list[str]:
        return [sys.executable, "-m", "ctcr", *map(str, arguments)]

    def recorder(self, target: str, readings: int = 1) -> list[str]:
        where = ("--bench", "bench.yaml", "-o", target)
        return self.command("record", "robot.yaml", "plan.csv", *where, *OPTIONS, "--readings", readings)

    def start(self, command: list[str]) -> subprocess.Popen:
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
        return subprocess.Popen(command, cwd=self.folder, text=True, **quiet)

    def run(self, *arguments: object) -> None:
        subprocess.run(self.command(*arguments), cwd=self.folder, check=True, capture_output=True, timeout=120)

    def set(self, device: str, **faults: object) -> dict:
        return request(self.wires, device, {"faults": faults})

    def mend(self, off_and_on: bool = False) -> None:
        """Ends every fault and releases the stop; after a power cycle of the terminals, homes the joints."""
        if off_and_on:
            self.set("ethercat", power_loss=True)
        self.set("aurora", **aurora.FAULTS)
        self.set("ethercat", **ethercat.FAULTS)
        if emergency_stop.is_stopped(self.wires):
            release(self.wires)
        if off_and_on:
            self.run("move", "robot.yaml", "--bench", "bench.yaml", "--home")

    def rest(self, braking_s: float = 0.0) -> bool:
        """Whether the motors stand still soon after a stop, or after a halt in which they brake."""
        time.sleep(0.2 + braking_s)
        before = self.set("ethercat")["turns"]
        time.sleep(0.1)
        return bool(np.allclose(before, self.set("ethercat")["turns"], atol=1e-9))


def children(process: subprocess.Popen) -> list[int]:
    """Of the recorder: the processes of bus and tracker."""
    return [int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]


def starve(_: Wires, process: subprocess.Popen) -> None:
    """The computer has no time for the processes of bus and tracker."""
    for sign in (signal.SIGSTOP, signal.SIGCONT):
        for pid in children(process):
            os.kill(pid, sign)
        time.sleep(0.4)


def fill_disk(_: Wires, process: subprocess.Popen) -> None:
    """In the recorder's own file system, which nobody else sees."""
    disk = process.args[5]
    with open(f"/proc/{process.pid}/root{disk}/filler", "wb", buffering=0) as filler:
        try:
            while True:
                filler.write(bytes(256))
        except OSError:
            pass


@dataclass(frozen=True)
class Fault:
    """`strike` makes it; after `lasts` seconds it is over, or with None when the recording has ended."""

    name: str
    strike: Callable[[Wires, subprocess.Popen], object]
    goes_on: bool  # whether the recording finishes by itself
    says: str  # pattern of the message: of the recorder, or of its session.json where it finishes by itself
    lasts: float | None = None
    readings: int = 1  # of each row of the plan
    off_and_on: bool = False  # the terminals, and homing, before it can go on


def on(device: str, **faults: object) -> Callable[[Wires, subprocess.Popen], object]:
    return lambda wires, _: wires.set(device, **faults)


FAULTS = [
    Fault("tracker unplugged for 1 s", on("aurora", unplugged=True), True, "port is gone", lasts=1.0),
    Fault("30 % of the frames missing", on("aurora", missing=0.3), True, "frames without the sensor"),
    Fault("out of volume for 1 s", on("aurora", out_of_volume=True), True, "", lasts=1.0),
    Fault("out of volume for good", on("aurora", out_of_volume=True), False, "outside of the tracker's volume"),
    Fault("a damaged byte in 5 % of the answers", on("aurora", garbage=0.05), True, ""),
    Fault("a wrong CRC in 5 % of the answers", on("aurora", wrong_crc=0.05), True, ""),
    Fault("baud rate falls back to 9600", on("aurora", wrong_baud=True), True, "", lasts=0.5),
    Fault("tracker hangs for 1 s", on("aurora", hang=True), True, "no answer|", lasts=1.0),
    Fault("tracker hangs for good", on("aurora", hang=True), False, "no answer"),
    Fault("bus cable pulled", on("ethercat", unplugged=True), False, "no terminal answers"),
    Fault("one terminal lost", on("ethercat", lost_after=4), False, "terminal 4 .* does not answer"),
    Fault(
        "power of the terminals lost", on("ethercat", power_loss=True), False, "no terminal answers", off_and_on=True
    ),
    Fault("no process data for 0.4 s (watchdog)", starve, False, "watchdog|no frame came back|no terminal answers"),
    Fault("a motor is jammed (following error)", on("ethercat", stall=2), False, "does not follow"),
    Fault("over-current in a coil", on("ethercat", over_current=3), False, "over-current in coil A"),
    Fault("motor supply off", on("ethercat", under_voltage=5), False, "motor supply too low"),
    Fault("an encoder jumps", on("ethercat", encoder_jump=4), False, "encoder jumped|does not follow", off_and_on=True),
    Fault("5 % of the bus frames lost, 5 % late", on("ethercat", lost_frames=0.05, late_frames=0.05), True, ""),
    Fault("emergency stop during a move", lambda wires, _: wires.run("stop"), False, "ctcr stop was called"),
    Fault("disk full", fill_disk, False, "no space left on device", readings=3),
]


@dataclass(frozen=True)
class Outcome:
    fault: str
    ended: str
    message: str
    before: int  # rows on the disk when it struck
    after: int  # when the recording had ended
    lost: int  # of those before, and of the plan in the end
    wrong: str = ""  # deviations from what is expected


def strike(wires: Wires, fault: Fault) -> Outcome:
    """One fault, from the start of its recording to the end of its plan."""
    target = wires.folder / re.sub(r"\W+", "_", fault.name)
    on_own_disk = fault.strike is fill_disk
    command = wires.recorder(target.name, fault.readings)
    if on_own_disk:  # a small file system of the recorder's own; what was written is copied out in the end
        disk = target.with_suffix(".disk")
        disk.mkdir()
        script = f'mount -t tmpfs -o size={DISK} tmpfs "$0" && "$@"; code=$?; cp -r "$0" "{target}"; exit $code'
        command = ["unshare", "-m", "sh", "-c", script, disk, *wires.recorder(str(disk), fault.readings)]
    table = target / "measurements.csv"
    process = wires.start(command)
    seen = wait_for_rows(process, Path(f"/proc/{process.pid}/root{disk}/measurements.csv") if on_own_disk else table)
    fault.strike(wires, process)
    if fault.lasts is not None:
        time.sleep(fault.lasts)
        wires.mend()
    error = process.communicate(timeout=LONGEST_S)[1]
    rest, kept = wires.rest(), table.read_bytes()
    went_on = process.returncode == 0
    message = notes(target) if went_on else error.strip().splitlines()[-1].removeprefix("Error: ")
    wires.mend(fault.off_and_on)
    again = wires.start(wires.recorder(target.name, fault.readings))
    error = again.communicate(timeout=LONGEST_S)[1]
    final = table.read_bytes()
    wrong = []
    if went_on != fault.goes_on:
        wrong.append("it went on" if went_on else "it stopped")
    if not re.search(fault.says, message):
        wrong.append("another message")
    if not rest:
        wrong.append("the motors moved on")
    if again.returncode:
        wrong.append(f"it cannot go on: {error.strip()}")
    lost = 0 if final.startswith(kept) and kept.startswith(seen) else rows_of(seen)
    return Outcome(
        fault.name,
        "continued" if went_on else "stopped; the same command resumed it",
        message,
        rows_of(seen),
        rows_of(kept),
        lost + wires.rows * fault.readings - rows_of(final),
        "; ".join(wrong),
    )


def wait_for_rows(process: subprocess.Popen, table: Path, rows: int = STRUCK_AFTER) -> bytes:
    """The table on the disk once it holds so many rows."""
    end = time.monotonic() + LONGEST_S
    while process.poll() is None and time.monotonic() < end:
        if table.exists() and rows_of(content := table.read_bytes()) >= rows:
            return content[: content.rindex(b"\n") + 1]
        time.sleep(0.005)
    raise RuntimeError(f"the recording ended before the fault: {process.stderr.read()}")


def rows_of(table: bytes) -> int:
    return max(0, table.count(b"\n") - 1)


def notes(recording: Path) -> str:
    """Remarks of a recording that finished by itself on its tracker and its bus."""
    sitting = json.loads((recording / "session.json").read_text(encoding="utf-8"))["sittings"][0]
    tracker, bus = sitting["tracker"], sitting["bus"]
    said = list(dict.fromkeys(fault["text"] for fault in tracker["faults"]))[:1]
    if tracker["unseen"]:
        said.append(f"{tracker['unseen']} of {tracker['frames']} frames without the sensor")
    if tracker["missed"]:
        said.append(f"{tracker['missed']} frames missed")
    if tracker["connections"] > 1:
        said.append(f"connected {tracker['connections']} times")
    if bus["bad_cycles"] > 0.01 * bus["cycles"]:
        said.append(f"{bus['bad_cycles']} of {bus['cycles']} bus cycles bad")
    return "; ".join(said)


def kill(wires: Wires, times: int) -> Outcome:
    """SIGKILL at random moments: of the start in every other case, else from the first row on that it measures."""
    rng, target = random.Random(1), "killed"
    table, kept, lost = wires.folder / target / "measurements.csv", b"", 0
    for k in range(times):
        process = wires.start(wires.recorder(target))
        measures = k % 2 == 1
        left, seen = rng.uniform(0.0, 1.5) if measures else rng.uniform(0.5, 4.5), kept
        end = time.monotonic() + (LONGEST_S if measures else left)
        while time.monotonic() < end and process.poll() is None:
            content = table.read_bytes() if table.exists() else b""
            seen = content[: content.rfind(b"\n") + 1]  # whole rows that another process has seen
            if measures and seen != kept:  # the first row: its time begins
                measures, end = False, time.monotonic() + left
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
        process.wait()
        now = table.read_bytes() if table.exists() else b""
        lost += not (now.startswith(seen) and seen.startswith(kept))
        kept = now[: now.rfind(b"\n") + 1]
    still = wires.rest(BRAKING_S)
    before = rows_of(kept)
    again = wires.start(wires.recorder(target))
    error = again.communicate(timeout=1000)[1]
    final = table.read_bytes()
    wrong = ["the motors moved on"] * (not still) + [error] * bool(again.returncode)
    lost += 0 if final.startswith(kept) else before
    return Outcome(
        f"recorder killed {times} times (SIGKILL)",
        "motors stopped; the same command resumed it",
        "none",
        before,
        before,
        lost + wires.rows - rows_of(final),
        "; ".join(wrong),
    )


HEAD = """# Faults on the bench

Each fault struck a recording of `ctcr record` on the simulated bench, through the serial line and the bus, when some
rows were on the disk. Then it was mended, and the same command was run again until the plan was done. *Lost* counts
rows that were on the disk and are missing in the final table, and rows of the plan that are missing there. Where the
recording stopped, the motors were at rest 0.2 s later; after a kill of the recorder they brake first, for 0.2 s more.
Half of the kills struck its start, half its measuring.
%s

| fault | the recording | message | rows when it struck | rows when it ended | lost |
|---|---|---|---|---|---|
"""


def written(outcomes: list[Outcome], folder: Path) -> str:
    def cell(text: str) -> str:
        return text.replace(str(folder) + "/", "").replace("|", "/")

    return HEAD % written_by("tools/bench_faults.py") + "".join(
        f"| {o.fault} | {o.ended} | {cell(o.message)} | {o.before} | {o.after} | {o.lost} |\n" for o in outcomes
    )


def beside_the_simulators(folder: Path, target: Path, only: str, kills: int) -> int:
    wires, outcomes = Wires(folder, folder / "wires", ROWS), []
    wires.run("move", "robot.yaml", "--bench", "bench.yaml", "--at-home")
    chosen = [fault for fault in FAULTS if re.search(only, fault.name)]
    for fault in chosen:
        outcomes.append(strike(wires, fault))
        print(outcomes[-1], flush=True)
    if kills:
        outcomes.append(kill(Wires(folder, folder / "wires", 4 * kills), kills))
        print(outcomes[-1], flush=True)
    target.write_text(written(outcomes, folder), encoding="utf-8")
    bad = [o for o in outcomes if o.wrong or o.lost]
    for outcome in bad:
        print(f"{outcome.fault}: {outcome.wrong or 'rows lost'}", file=sys.stderr)
    return 1 if bad else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=TARGET)
    parser.add_argument("--only", default="", help="faults whose name holds this")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--beside", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.beside:
        return beside_the_simulators(given.beside, given.output, given.only, given.kills)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        near_the_plate(folder / "robot.yaml", folder / "bench.yaml")
        simulators = ["sim", "bench", folder / "robot.yaml", "--noise", "none", "--folder", folder / "wires", "--"]
        program = [sys.executable, __file__, "--beside", folder, "-o", given.output.resolve()]
        program += ["--only", given.only, "--kills", str(given.kills)]
        return subprocess.run([sys.executable, "-m", "ctcr", *simulators, *program]).returncode


if __name__ == "__main__":
    sys.exit(main())
