"""One number of the paper beside ours."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Claim:
    """`paper` and `ours` in `unit`; `why` says where they differ, and what ours means."""

    where: str
    what: str
    paper: float
    ours: float
    unit: str
    why: str = ""

    @property
    def ratio(self) -> float | None:
        return self.ours / self.paper if self.paper else None

    def row(self) -> list[str]:
        ratio = "" if self.ratio is None else f"{self.ratio:.3g}"
        return [
            self.where,
            self.what,
            f"{self.paper:.4g} {self.unit}",
            f"{self.ours:.4g} {self.unit}",
            ratio,
            self.why,
        ]


COLUMNS = ["where", "what", "paper", "ours", "ratio", "why"]
