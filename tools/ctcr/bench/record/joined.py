"""Recordings of one session as one table. The robot stood still between them, so the history of its effects goes on."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ctcr.bench.record.folder import ABOUT
from ctcr.table.measurements import Measurements

PAUSE_S = 60.0  # between tables whose start is not known


def joined(tables: Sequence[Measurements], starts: Sequence[float | None]) -> Measurements:
    """The rows of all tables, one table after the other.

    tables  in the order in which they were recorded; a column that one of them lacks is left out
    starts  the time at which t_s of each was 0, by one clock [s]; None: not known
    """
    moved, end, number, row = [], 0.0, 0, 2
    for table, start in zip(tables, starts, strict=True):
        known = start is not None and starts[0] is not None
        shift = start - starts[0] if known else end + PAUSE_S * bool(moved)
        runs = number + np.unique(table.run, return_inverse=True)[1]
        rows = np.arange(row, row + len(table))
        moved.append(replace(table, t=table.t + shift, run=runs, row=rows))
        end, number, row = float(np.nanmax(moved[-1].t, initial=end)), int(runs.max()) + 1, row + len(table)

    def column(name: str):
        parts = [getattr(table, name) for table in moved]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    columns = {name: column(name) for name in Measurements.COLUMNS}
    return Measurements(**columns, from_home=tables[0].from_home)


def start_of(table: str | Path) -> float | None:
    """The time at which t_s of a recorded table was 0 [s, Unix time], from the `session.json` beside it."""
    try:
        return float(json.loads((Path(table).parent / ABOUT).read_text(encoding="utf-8"))["started_unix_s"])
    except (OSError, ValueError, LookupError, TypeError):
        return None
