"""Compares the benchmarks of this tree with those of another commit: same machine, runs interleaved.

The two programs take turns, so that a change of the machine's load or clock meets both; each pair of neighbouring
runs gives one ratio of CPU times. Absolute times mean nothing on another machine, the ratios mean little.
"""

import argparse
import json
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
Times = dict[str, float]  # benchmark name -> CPU time [ns]
NANOSECONDS = {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9}


def git(*arguments: str) -> str:
    done = subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr.strip())
    return done.stdout.strip()


def checkout(revision: str) -> Path:
    """A separate tree of `revision` under build/, made once for each commit."""
    commit = git("rev-parse", "--verify", f"{revision}^{{commit}}")
    tree = ROOT / "build" / "against" / commit[:12]
    if not tree.exists():
        git("worktree", "prune")
        git("worktree", "add", "--detach", str(tree), commit)
    return tree


def build(tree: Path) -> dict[str, Path]:
    """Builds the benchmarks of a tree as its own preset says; their programs by name."""
    for step in (["cmake", "--preset", "bench"], ["cmake", "--build", "--preset", "bench"]):
        subprocess.run(step, cwd=tree, check=True, stdout=subprocess.DEVNULL)
    return {path.name: path for path in sorted((tree / "build/bench/bench").glob("*_bench"))}


def run(program: Path, options: list[str]) -> Times:
    result = program.with_suffix(".json")
    subprocess.run(
        [program, f"--benchmark_out={result}", "--benchmark_out_format=json", *options],
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=ROOT,
    )
    return cpu_times(json.loads(result.read_text()))


def cpu_times(report: dict) -> Times:
    """CPU times of a Google Benchmark report; a benchmark that failed its own check has none."""
    return {
        entry["name"]: entry["cpu_time"] * NANOSECONDS[entry["time_unit"]]
        for entry in report["benchmarks"]
        if entry.get("run_type") == "iteration" and not entry.get("error_occurred")
    }


def interleave(old: Path, new: Path, rounds: int, options: list[str]) -> list[tuple[Times, Times]]:
    """Rounds of (old, new) times; who runs first alternates."""
    pairs = []
    for number in range(rounds):
        order = (old, new) if number % 2 == 0 else (new, old)
        times = {program: run(program, options) for program in order}
        pairs.append((times[old], times[new]))
        print(f"\r{new.name}: round {number + 1} of {rounds}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return pairs


def summary(pairs: list[tuple[Times, Times]]) -> list[str]:
    """One line for each benchmark that both commits have: median times, and the quartiles of new / old."""
    lines = []
    for name in pairs[0][1]:
        both = [(old[name], new[name]) for old, new in pairs if name in old and name in new]
        if len(both) < 2:
            lines.append(f"{name:44} only in one commit")
            continue
        low, middle, high = statistics.quantiles([new / old for old, new in both], method="inclusive")
        verdict = "faster" if high < 1 else "slower" if low > 1 else ""
        old_ns, new_ns = (statistics.median(column) for column in zip(*both, strict=True))
        lines.append(f"{name:44} {old_ns:12.1f} {new_ns:12.1f}  {middle:6.3f}  [{low:.3f}, {high:.3f}]  {verdict}")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(prog="tools/dev bench --against", description=__doc__)
    parser.add_argument("revision", help="commit, branch or tag to compare with")
    parser.add_argument("--rounds", type=int, default=9, help="runs of each program (default 9)")
    arguments, options = parser.parse_known_args()
    options = options or ["--benchmark_min_time=0.05"]
    if arguments.rounds < 2:
        parser.error("at least 2 rounds, or there is no spread")

    old, new = build(checkout(arguments.revision)), build(ROOT)
    if not old.keys() & new.keys():
        sys.exit(f"{arguments.revision} has no benchmark program in common with this tree")
    lines = []
    for name in sorted(old.keys() & new.keys()):
        lines += summary(interleave(old[name], new[name], arguments.rounds, options))
    print(f"{'benchmark':44} {'old [ns]':>12} {'new [ns]':>12}  {'ratio':>6}  quartiles of the ratio")
    print(*lines, sep="\n")


if __name__ == "__main__":
    main()
