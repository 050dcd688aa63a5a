"""Writes docs/bench_steadiness.md: jitter and losses of the loops while the bench controls and records for ten minutes.

Both simulators, the bus process, the tracker reader and the 40 Hz controller with its recorder share the cores;
`ctcr track --live` follows the cube of `ctcr demo bench` again and again.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from ctcr.demo.bench_story import FILES
from origin import ROOT, written_by

TARGET = ROOT / "docs" / "bench_steadiness.md"
ROUND_S = 21.5  # of one tour of the cube, about
HEAD = """# How steady the bench is

{minutes:.0f} minutes of `ctcr track --live` at 40 Hz on the simulated bench, with everything on {cores} cores: both
simulators, the bus process, the reader of the tracker, and the controller that records. Real-time priority:
{real_time}. Load of the computer at the start and at the end: {load}; the bench itself makes
about 1 of it. {beside}
{written}

| | |
|---|---|
"""


def rows(sitting: dict) -> list[tuple[str, str]]:
    tracker, bus, late = sitting["tracker"], sitting["bus"], sitting["frames_late"]
    asked = tracker["questions_late"]
    return [
        ("tracker frames", str(tracker["frames"])),
        ("of these missed", str(tracker["missed"])),
        ("without the sensor", str(tracker["unseen"])),
        ("faults of the tracker", str(len(tracker["faults"]))),
        ("late by, 99 %: the reader wakes up to ask", f"{asked['p99_ms']:.2f} ms"),
        ("worst", f"{asked['worst_ms']:.2f} ms"),
        ("from the tracker's answer to the controller, 50 %", f"{late['p50_ms']:.2f} ms"),
        ("99 %", f"{late['p99_ms']:.2f} ms"),
        ("worst", f"{late['worst_ms']:.2f} ms"),
        (f"bus cycles of {bus['period_ms']:g} ms", str(bus["cycles"])),
        ("with a bad working counter, or lost", str(bus["bad_cycles"])),
        ("late by, 99 %", f"{bus['p99_late_ms']:.2f} ms"),
        ("worst", f"{bus['worst_late_ms']:.2f} ms"),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--beside", default="Nothing else ran.", help="a sentence: what else ran on the computer")
    parser.add_argument("-o", "--output", type=Path, default=TARGET)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file in ("robot.yaml", "bench.yaml", "cube.yaml"):
            text = (FILES / file).read_text(encoding="utf-8")
            rounds = max(1, round(60 * given.minutes / ROUND_S))
            (folder / file).write_text(text.replace("repetitions: 1", f"repetitions: {rounds}"), encoding="utf-8")
        ctcr = f"{sys.executable} -m ctcr"
        script = (
            f"{ctcr} move robot.yaml --bench bench.yaml --at-home && "
            f"{ctcr} track robot.yaml cube.yaml --live --bench bench.yaml -o run"
        )
        load = [os.getloadavg()[0]]
        done = subprocess.run(
            [sys.executable, "-m", "ctcr", "sim", "bench", "robot.yaml", "--folder", "wires", "--", "sh", "-c", script],
            cwd=folder,
        )
        load.append(os.getloadavg()[0])
        sitting = json.loads((folder / "run" / "session.json").read_text(encoding="utf-8"))["sittings"][-1]
    head = HEAD.format(
        minutes=sitting["tracker"]["frames"] / 40 / 60,
        beside=given.beside,
        written=written_by("tools/bench_steadiness.py"),
        cores=os.cpu_count(),
        load=" and ".join(f"{value:.1f}" for value in load),
        real_time="granted" if sitting["bus"]["real_time_priority"] else "not granted",
    )
    given.output.write_text(head + "".join(f"| {a} | {b} |\n" for a, b in rows(sitting)), encoding="utf-8")
    print(given.output.read_text(encoding="utf-8"))
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
