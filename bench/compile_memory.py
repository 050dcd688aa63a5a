#!/usr/bin/env python3
"""Peak memory of the compiler for programs of users. Unlike times, it does not depend on the load of the machine.

Compiles with -O2 for AVX2: plainly, with CTCR_FAST_COMPILE, and with the solver in a file of its own (ctcr::solver_3).
Exit code 1 when a program takes over GROWTH more than it did."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
GROWTH = 0.05
STEP = """
#include <ctcr/ctcr.hpp>
ctcr::Status one_step(const ctcr::Model<3>& model, const ctcr::Joints<3>& q, ctcr::Workspace<3>& ws,
                      ctcr::Solution<3>& out) {
  return ctcr::step(model, q, {}, ws, out);
}
"""
CONTROL = (ROOT / "examples" / "03_control.cpp").read_text()
FLAGS = ["-std=c++20", "-O2", "-march=x86-64-v3", "-ffp-contract=fast", "-Wno-psabi", "-c", "-x", "c++"]
FAST = "-DCTCR_FAST_COMPILE"
SOLVER = "-DCTCR_SOLVER_3"  # ctcr::solver_3: the solver stands in a file of its own
COMPILER = "g++ (Debian 12.2.0-14+deb12u1) 12.2.0"  # that the figures are of
PROGRAMS = {  # MB
    "step() of 3 tubes": (STEP, [], 658),
    "step() of 3 tubes, fast compile": (STEP, [FAST], 546),
    "step() of 3 tubes, compiled solver": (STEP, [SOLVER], 408),
    "examples/03_control.cpp": (CONTROL, [], 1208),
    "examples/03_control.cpp, fast compile": (CONTROL, [FAST], 813),
    "examples/03_control.cpp, compiled solver": (CONTROL, [SOLVER], 610),
}


def main() -> int:
    compiler = subprocess.run(["g++", "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    grown = False
    print(f"peak memory of {compiler}, MB\n{'':40}{'now':>6}{'recorded':>10}")
    for name, (source, flags, recorded) in PROGRAMS.items():
        peak = peak_mb(source, flags)
        grown |= compiler == COMPILER and peak > (1 + GROWTH) * recorded
        print(f"{name:40}{peak:6.0f}{recorded:10}", flush=True)
    if compiler != COMPILER:
        print(f"not compared: recorded with {COMPILER}")
    return int(grown)


def peak_mb(source: str, flags: list[str]) -> float:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "program.cpp"
        file.write_text(source)
        include = ["-I", str(ROOT / "include"), "-isystem", "/usr/include/eigen3"]
        process = subprocess.Popen(["g++", *FLAGS, *flags, *include, str(file), "-o", str(file.with_suffix(".o"))])
        _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"compile_memory: exit status {status} of the compiler")
    return usage.ru_maxrss / 1024


if __name__ == "__main__":
    sys.exit(main())
