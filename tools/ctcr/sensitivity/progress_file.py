"""What a long study has done so far, so that it goes on after an interruption."""

import json
from pathlib import Path
from typing import Any

from ctcr.errors import InputError, Problem, file_fault
from ctcr.show.output import atomic_writer


class ProgressFile:
    """Holds the last state of a study; `settings` must be the same when it goes on. None: nothing is kept."""

    def __init__(self, path: str | Path | None, settings: dict[str, Any]):
        self.path, self.settings = path, json.loads(json.dumps(settings))

    def load(self) -> dict[str, Any] | None:
        """The state, or None where there is none yet. Raises InputError where it belongs to another study."""
        if self.path is None or not Path(self.path).exists():
            return None
        try:
            kept = json.loads(Path(self.path).read_text(encoding="utf-8"))
            settings, state = kept["settings"], kept["state"]
        except OSError as error:
            raise file_fault(error, self.path, "read") from None
        except (ValueError, KeyError, TypeError):
            raise InputError(Problem("is not the progress of a sensitivity study", str(self.path))) from None
        if settings != self.settings:
            text = "belongs to a study with another robot or other options: delete it, or name another file"
            raise InputError(Problem(text, str(self.path)))
        return state

    def save(self, state: dict[str, Any]) -> None:
        if self.path is not None:
            with atomic_writer(self.path) as file:
                json.dump({"settings": self.settings, "state": state}, file)
