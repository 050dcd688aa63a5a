"""What the pages of docs/ that tools write say of their figures: by which tool, on which day, at which commit."""

import subprocess
from datetime import date
from pathlib import Path

ROOT = Path(__file__).parents[1]


def written_by(tool: str) -> str:
    """The sentence on it, of today; it also says where files of the commit were changed."""
    command = ["git", "describe", "--always", "--exclude=*", "--dirty= and changes"]
    commit = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    return f"Written by `{tool}` on {date.today()}, commit {commit.stdout.strip() or 'unknown'}."
