"""Fixtures of the tests that run_on_bench runs, as a plugin of theirs alone."""

import os

import pytest
from ctcr.bench.devices import bench_file
from simulated_bench import mended_bench


@pytest.fixture(scope="module")
def bench():
    return bench_file.load(os.environ["BENCH_FILE"])


@pytest.fixture
def folder():
    return mended_bench()
