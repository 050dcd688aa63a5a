#!/usr/bin/env python3
"""Instructions of one Newton step, counted by callgrind: a speed that load does not change.

The driver runs all 1000 configurations once and three times over; the difference is two passes, everything in
them counted, set-up cancelled. A Newton step is what the paper times (residual, B_u, and with them J and C);
rows step/.. are the whole control step() around it: checks, prediction, corrected pose, outputs; row effects is the
Newton step with J and C of a robot with every effect of the catalogue at work. Compares with
instructions.json; exit code 1 when a case grew by more than GROWTH or was not recorded, or when nothing could be
counted.
"""

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

GROWTH = 0.03
BASELINE = Path(__file__).with_name("instructions.json")
REQUIRED = {  # instructions per step that must not be exceeded (3 tubes, AVX2)
    "unloaded": 2150,
    "unloaded_jacobian": 4500,
    "loaded": 8050,
    "loaded_jacobian": 13350,
    "loaded_jacobian_compliance": 16500,
}
CASES = [*REQUIRED, *(f"step/{case}" for case in REQUIRED), "effects"]
RIVALS = {case: f"rival/{case}" for case in REQUIRED} | {"effects": "rival/loaded_jacobian_compliance"}
CONFIGURATIONS = 1000


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--driver", type=Path, required=True, help="the built count_driver")
    parser.add_argument("--update", action="store_true", help="write the counts to instructions.json")
    parser.add_argument("--rival", action="store_true", help="also count the rival's steps (slower)")
    arguments = parser.parse_args()
    try:
        compiler = run([str(arguments.driver), "--about"]).strip()
        counts = {case: per_step(arguments.driver, case) for case in CASES}
        rivals = {case: per_step(arguments.driver, rival) for case, rival in RIVALS.items() if arguments.rival}
    except (OSError, RuntimeError) as error:
        print(f"count_instructions: {error}", file=sys.stderr)
        return 1

    if arguments.update:
        record = {"compiler": compiler, "instructions_per_step": counts}
        BASELINE.write_text(json.dumps(record, indent=2) + "\n")
    baseline = json.loads(BASELINE.read_text()) if BASELINE.exists() else {}
    comparable = baseline.get("compiler") == compiler
    recorded = baseline["instructions_per_step"] if comparable else {}
    print_table(counts, recorded, rivals)
    if not comparable:
        print(f"not compared: recorded with {baseline.get('compiler')}, this is {compiler}; --update records it")
        return 0
    wrong = []
    for case, count in counts.items():
        if case not in recorded:
            wrong.append(f"{case}: {count} instructions, none recorded: --update records them")
        elif count > (1 + GROWTH) * recorded[case]:
            wrong.append(f"{case}: {count} instructions, {recorded[case]} recorded, grew by over {GROWTH:.0%}")
    print(*wrong, sep="\n")
    return 1 if wrong else 0


def per_step(driver: Path, case: str) -> int:
    """Instructions per step [1], mean over the configurations."""
    once, thrice = (collected(driver, case, passes) for passes in (1, 3))
    return round((thrice - once) / (2 * CONFIGURATIONS))


def collected(driver: Path, case: str, passes: int) -> int:
    callgrind = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null"]
    found = re.search(r"Collected\s*:\s*(\d+)", run([*callgrind, str(driver), case, str(passes)]))
    if not found:
        raise RuntimeError(f"callgrind printed no count for {case}")
    return int(found.group(1))


def run(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr.strip()}")
    return done.stdout + done.stderr


def print_table(counts: dict[str, int], recorded: dict[str, int], rivals: dict[str, int]) -> None:
    print("instructions per Newton step, 3 tubes, 1000 random configurations of the Table II robot")
    header = f"{'':28}{'now':>9}{'recorded':>10}{'change':>9}{'limit':>9}"
    print(header + (f"{'rival':>9}{'ratio':>8}" if rivals else ""))
    for case, count in counts.items():
        old = recorded.get(case)
        change = f"{count / old - 1:+9.1%}" if old else f"{'-':>9}"
        row = f"{case:28}{count:9d}{old if old else '-':>10}{change}{REQUIRED.get(case, '-'):>9}"
        row += "  over" if count > REQUIRED.get(case, count) else ""
        print(row + (f"{rivals[case]:9d}{rivals[case] / count:8.1f}" if case in rivals else ""))


if __name__ == "__main__":
    sys.exit(main())
