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
        values = [f"{value:.4g} {self.unit}".strip() for value in (self.paper, self.ours)]
        return [self.where, self.what, self.why, *values, ratio]


COLUMNS = ["where", "what", "why ours differs", "paper", "ours", "ratio"]
