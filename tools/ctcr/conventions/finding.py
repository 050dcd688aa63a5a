"""A wrong convention that was found: what it is, how much error it makes, and how to correct it."""

from collections.abc import Sequence
from dataclasses import dataclass
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
    rows: Sequence[int] = ()  # of the table, where only some are wrong
    rivals: Sequence["Finding"] = ()  # of another kind, which explain the readings as well

    @property
    def is_wrong(self) -> bool:
        """Whether it must be corrected; poses that the tracker repeated are only left out."""
        return self.kind != "frozen"

    @property
    def clarity(self) -> float:
        """Factor by which the error falls."""
        before, after = self.rms_deg or self.rms_mm
        return before / max(after, 1e-9)

    @property
    def what(self) -> str:
        """Its text, and what may be wrong instead."""
        others = "".join(f", or {rival.text}" for rival in self.rivals)
        return f"{self.text}{others} (these readings do not tell)" if others else self.text

    @property
    def remedy(self) -> str:
        """Its fix, and that of what may be wrong instead."""
        return "; or ".join(one.fix for one in (self, *self.rivals))

    @property
    def sentence(self) -> str:
        """All of it for people."""
        (before, after), unit = (self.rms_deg, "deg") if self.rms_deg else (self.rms_mm, "mm")
        given = short(before) if isfinite(before) else "without solution"
        return f"{self.what}: {given} -> {short(after)} {unit}; {self.remedy}."

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        found: dict[str, Any] = {"kind": self.kind, "columns": list(self.columns), "runs": list(self.runs)}
        for name in ("rms_mm", "rms_deg"):
            if errors := getattr(self, name):
                found[name] = dict(zip(("before", "after"), errors, strict=True))
        if self.rows:
            found["rows"] = list(self.rows)
        if self.rivals:
            found["rivals"] = [{"kind": one.kind, "columns": list(one.columns), "fix": one.fix} for one in self.rivals]
        return found | {"fix": self.remedy, "text": self.what}
