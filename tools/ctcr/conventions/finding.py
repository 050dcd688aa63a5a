"""A wrong convention that was found: what it is, how much error it makes, and how to correct it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from ctcr.show.wording import short


@dataclass(frozen=True)
class Finding:
    """One wrong convention of a table or of a robot file."""

    kind: str
    text: str  # a sentence without its full stop
    columns: Sequence[str]  # of the table; empty where the robot file is wrong
    fix: str
    runs: Sequence[int] = ()  # empty: all
    rms_mm: tuple[float, float] = (0.0, 0.0)  # error of calibrated positions, as given and corrected
    rms_deg: tuple[float, float] | None = None  # of orientations, where these decide

    @property
    def clarity(self) -> float:
        """Factor by which the error falls."""
        before, after = self.rms_deg or self.rms_mm
        return before / max(after, 1e-9)

    def with_errors(self, before_mm: float, after_mm: float) -> "Finding":
        return replace(self, rms_mm=(before_mm, after_mm))

    @property
    def sentence(self) -> str:
        """All of it for people."""
        (before, after), unit = (self.rms_deg, "deg") if self.rms_deg else (self.rms_mm, "mm")
        given = short(before) if isfinite(before) else "without solution"
        return f"{self.text}: {given} -> {short(after)} {unit}; {self.fix}."

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        found: dict[str, Any] = {"kind": self.kind, "columns": list(self.columns), "runs": list(self.runs)}
        for name in ("rms_mm", "rms_deg"):
            if errors := getattr(self, name):
                found[name] = dict(zip(("before", "after"), errors, strict=True))
        return found | {"fix": self.fix, "text": self.text}
