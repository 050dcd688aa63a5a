"""Jobs in order, on this machine or on a cluster. Only seeds, ranges and one robot's parameters travel."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import islice
from typing import Any

from ctcr.errors import InputError, Problem

Map = Callable[[Callable, Iterable], Iterator]


@contextmanager
def workers(address: str | None, threads: int | None = None) -> Iterator[Map]:
    """Gives map(function, jobs), which yields results in the order of the jobs; few are held at a time.

    `address` is that of a dask.distributed scheduler; None: `threads` of this machine (None: all cores).
    """
    if address is None:
        count = threads or os.cpu_count() or 1
        with ThreadPoolExecutor(count) as pool:
            try:
                yield lambda function, jobs: _in_order(pool.submit, function, jobs, 2 * count, lambda f: f.result())
            finally:
                pool.shutdown(cancel_futures=True)  # an interruption does not wait for what has not begun
        return
    client = _client(address)
    try:
        width = 2 * max(sum(client.nthreads().values()), 1)
        yield lambda function, jobs: _in_order(
            lambda f, job: client.submit(f, job, pure=False), function, jobs, width, lambda f: f.result()
        )
    finally:
        client.close()


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ModuleNotFoundError:
        text = "--dask needs the package distributed: pip install distributed"
        raise InputError(Problem(text)) from None
    try:
        return Client(address, timeout=10)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:100]
        raise InputError(Problem(f"no dask scheduler answers at {address}: {reason}")) from None


def _in_order(submit: Callable, function: Callable, jobs: Iterable, width: int, result: Callable) -> Iterator:
    waiting, rest = [], iter(jobs)
    waiting = [submit(function, job) for job in islice(rest, width)]
    while waiting:
        yield result(waiting.pop(0))
        waiting += [submit(function, job) for job in islice(rest, 1)]
