"""How wrong the model is, and where: `compare` gives the numbers, `report` and `terminal` show them."""

from ctcr.compare.analysis import Comparison, compare

__all__ = ["Comparison", "compare"]
