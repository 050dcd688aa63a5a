"""How late a periodic loop wakes up: counted as it runs, without growing."""

import numpy as np

BIN_S = 20e-6
BINS = 5000  # up to 0.1 s; what is later counts as that


class Lateness:
    """`add` every time, then `as_dict`."""

    def __init__(self) -> None:
        self._counts = np.zeros(BINS, np.int64)
        self.worst = 0.0  # [s]

    def add(self, late: float) -> None:
        self._counts[min(BINS - 1, max(0, int(late / BIN_S)))] += 1
        self.worst = max(self.worst, late)

    def quantile(self, share: float) -> float:
        """[s], rounded up to BIN_S; 0 without any."""
        total = int(self._counts.sum())
        if not total:
            return 0.0
        return BIN_S * (1 + int(np.searchsorted(np.cumsum(self._counts), share * total)))

    def as_dict(self) -> dict[str, float]:
        return {
            "count": int(self._counts.sum()),
            "p50_ms": 1e3 * self.quantile(0.5),
            "p99_ms": 1e3 * self.quantile(0.99),
            "worst_ms": 1e3 * self.worst,
        }
