"""The fuzzer finds planted bugs; a longer run is part of `tools/dev check`."""

import importlib.util
import random
from pathlib import Path

import pytest
from ctcr.robot import checks
from ctcr.table import measurements

SCRIPT = Path(__file__).parents[2] / "fuzz" / "fuzz_parsers.py"
ENOUGH_S = 20  # it stops at the first finding, mostly within a second


@pytest.fixture(scope="module")
def fuzzer():
    spec = importlib.util.spec_from_file_location("fuzz_parsers", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_planted_bug_of_the_table_is_found(fuzzer, monkeypatch):
    """A check that does not survive an empty field."""
    monkeypatch.setattr(measurements, "check", lambda name, block, *_: [int(value) for value in block.ravel()])
    with pytest.raises(AssertionError, match="read_table let out ValueError"):
        fuzzer.fuzz(fuzzer.read_table, fuzzer.TABLE, random.Random(1), ENOUGH_S)


def test_a_check_that_is_left_out_is_found(fuzzer, monkeypatch):
    """A table that breaks its promises is a finding too, not only an exception."""
    monkeypatch.setattr(measurements, "_check_joint_order", lambda *_: None)
    with pytest.raises(AssertionError, match="read_table let out AssertionError"):
        fuzzer.fuzz(fuzzer.read_table, fuzzer.TABLE, random.Random(1), ENOUGH_S)


def test_planted_bug(fuzzer, monkeypatch):
    """A relation that trusts its fields to be numbers."""
    monkeypatch.setattr(checks, "_number", lambda section, key: float(section.get(key, 0)))
    with pytest.raises(AssertionError, match="read_robot let out"):
        fuzzer.fuzz(fuzzer.read_robot, fuzzer.ROBOT, random.Random(1), ENOUGH_S)
