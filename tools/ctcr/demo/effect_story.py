"""The story of `ctcr demo`: measurements that the model contradicts, the effect that is missing, the error with it."""

import shutil
import subprocess
import sys
from pathlib import Path

from ctcr.demo.story import LOG
from ctcr.show.output import Terminal

_HERE = Path(__file__).resolve().parent
_FILES = [_HERE / "effect", _HERE.parents[2] / "examples" / "data" / "demo"]  # of a package, of a checkout
STEPS = {
    "How wrong is the model?": "compare robot.yaml measurements.csv --report 1_before.html",
    "Which physical effect is missing?": "diagnose robot.yaml measurements.csv --json found.json --report 2_found.html",
    "Add it": "add robot.yaml --diagnosis found.json --fit measurements.csv -o with_effect.yaml",
    "Compare again: the error falls": "compare with_effect.yaml measurements.csv --report 3_after.html",
    "Show the history of the robot file": "history with_effect.yaml",
}


def tell(folder: Path, console: Terminal) -> int:
    """Runs the commands in the folder, each with its own output. Returns the exit code of one that fails, else 0."""
    files = next(path for path in _FILES if path.is_dir())
    for name in ("robot.yaml", "measurements.csv"):
        shutil.copy(files / name, folder)
    (folder / LOG).write_text("".join(f"$ ctcr {command}\n" for command in STEPS.values()))
    for number, (why, command) in enumerate(STEPS.items(), 1):
        console.print(f"\n{number}. {why}\n   $ ctcr {command}\n", style="bold", soft_wrap=True)
        if code := subprocess.run([sys.executable, "-m", "ctcr", *command.split()], cwd=folder).returncode:
            return code
    console.print(f"\nThe reports: {folder}/1_before.html, 2_found.html, 3_after.html", soft_wrap=True)
    return 0
