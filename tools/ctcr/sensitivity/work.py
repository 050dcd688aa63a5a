"""Long studies: jobs in order, on this machine or on a cluster, and their progress in a file.

Only seeds, ranges and the parameters of one robot travel.
"""

import json
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from ctcr import inputs
from ctcr.errors import InputError, Problem
from ctcr.show.output import atomic_writer


@contextmanager
def workers(address: str | None, threads: int | None = None) -> Iterator[Callable[[Callable, Iterable], Iterator]]:
    """Gives map(function, jobs), which yields results in the order of the jobs; few are held at a time.

    `address` is that of a dask.distributed scheduler; None: `threads` of this machine (None: all cores).
    """
    if address is None:
        count = threads or os.cpu_count() or 1
        pool = ThreadPoolExecutor(count)
        submit, close = pool.submit, partial(pool.shutdown, cancel_futures=True)  # waits only for jobs that have begun
    else:
        client = _client(address)
        count = max(sum(client.nthreads().values()), 1)
        submit, close = partial(client.submit, pure=False), client.close
    try:
        yield lambda function, jobs: _in_order(submit, function, jobs, 2 * count)
    finally:
        close()


def _client(address: str) -> Any:
    try:
        from distributed import Client  # late: an optional package
    except ModuleNotFoundError:
        raise InputError(Problem("--dask needs the package distributed: pip install distributed")) from None
    try:
        return Client(address, timeout=10)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:100]
        raise InputError(Problem(f"no dask scheduler answers at {address}: {reason}")) from None


def _in_order(submit: Callable, function: Callable, jobs: Iterable, width: int) -> Iterator:
    rest = iter(jobs)
    waiting = [submit(function, job) for job in islice(rest, width)]
    while waiting:
        yield waiting.pop(0).result()
        waiting += [submit(function, job) for job in islice(rest, 1)]


class ProgressFile:
    """The last state of a study; `settings` must be the same when it is resumed. Without a path nothing is kept."""

    def __init__(self, path: str | Path | None, settings: dict[str, Any]):
        self.path, self.settings = path, json.loads(json.dumps(settings))

    def load(self) -> Any:
        """The state, or None where there is none yet. Raises InputError where it belongs to another study."""
        if self.path is None or not Path(self.path).exists():
            return None
        content = inputs.read(self.path, "this is not the progress of a study")
        try:
            kept = json.loads(content)
            settings, state = kept["settings"], kept["state"]
        except (ValueError, KeyError, TypeError):
            raise InputError(Problem("is not the progress of a sensitivity study", str(self.path))) from None
        if settings != self.settings:
            text = "belongs to a study with another robot or other options: delete it, or name another file"
            raise InputError(Problem(text, str(self.path)))
        return state

    def save(self, state: Any) -> None:
        if self.path is not None:
            with atomic_writer(self.path) as file:
                json.dump({"settings": self.settings, "state": state}, file)
