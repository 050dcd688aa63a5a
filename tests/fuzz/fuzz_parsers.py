"""Feeds the parsers with mutated files: whatever comes in, nothing but an InputError may come out.

python tests/fuzz/fuzz_parsers.py --seconds 10 [--seed 1]
"""

import argparse
import random
import re
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from ctcr.errors import InputError
from ctcr.intake.choices import Choices
from ctcr.intake.convert import convert
from ctcr.intake.reading import read
from ctcr.model import parameters
from ctcr.robot import robot_file
from ctcr.table import csv_table, measurements

ROBOT = (Path(__file__).parents[2] / "examples" / "robots" / "table2.yaml").read_bytes()
TABLE = b"""t_s,run,beta1_m,beta2_m,alpha1_rad,alpha2_rad,fx_N,fy_N,fz_N,x_m,y_m,z_m,qw,qx,qy,qz
0,0,-0.3,-0.2,0.5,-2.25,0,-0,0,-0.06,-0.11,0.06,1,0,0,0
0.5,0,-0.31,-0.2,.5e0,-2.5,0,0.1,0,,,,,,,
,1,-0.32,-0.21,1E-3,+2.75,0,0,0,-0.06,-0.11,0.06,0.5,-0.5,0.5,-0.5
"""
LOG = b"""Session 3;;
Index;Time [ms];Run;Ext1 [mm];Ext2 [mm];Rot1 [deg];Rot2 [deg];X;Y;Z;q0;qx;qy;qz;State
1;0;a;-124,4;-100,3;107,8;178,4;-128,7;-7,4;22,6;0,487;-0,027;0,237;0,839;OK
2;25;a;-124,4;-100,3;105,2;175,2;MISSING;;;;;;;MISSING
3;50;b;-124,5;-100,3;105,2;175,2;-124,4;-8,0;21,5;0,493;-0,026;0,230;0,838;OK
"""
TOKENS = [
    *(b"", b" ", b"\n", b"\r\n", b"\r", b",", b",,", b";", b"\t", b"\0", b'"', b"'", b"#", b":", b"- ", b"? "),
    *(b"nan", b".nan", b"inf", b"-.inf", b"1e999", b"-1e-999", b"1_000", b"0x1f", b"0o7", b"1:30", b"9" * 400),
    *(b"null", b"~", b"true", b"on", b"2020-01-01", b"[1, 2, 3]", b"{a: 1}", b"[[[[", b"{{{", b"!!python/none x"),
    *(b"&a [*a]", b"*a", b"<<: *a", b"|\n  x", b">-\n", b"---\n", b"...\n", b"%YAML 1.1\n---\n", b"!!binary x"),
    *(b"!!float x", b"!!int 1.5", b"!!timestamp 2020-99-99", b"!!set {1}", b"!!omap [a: 1]", b"-", b"+", b"e", b"."),
    *(
        b"\xff\xfe",
        b"\xef\xbb\xbf",
        b"\xc3",
        "\u0661\u2212\u00a0".encode(),
        b"-300",
        b"-0.25",
        b"-0.1",
        b"0.1",
        b"1e300",
        b"beta9_m",
        b"qw",
    ),
]


def mutated(content: bytes, source: random.Random) -> bytes:
    """A few random edits: bytes, tokens, fields, lines."""
    for _ in range(source.choice((1, 1, 1, 2, 3, 8))):
        start = source.randrange(len(content) + 1)
        end = min(len(content), start + source.choice((0, 1, 2, 5, 40)))
        lines = content.splitlines(keepends=True)
        match source.randrange(7):
            case 0:
                content = content[:start] + bytes([source.randrange(256)]) + content[end:]
            case 1:
                content = content[:start] + source.choice(TOKENS) + content[end:]
            case 2 if fields := list(re.finditer(rb"[^\s,:]+", content)):
                field = source.choice(fields)
                content = content[: field.start()] + source.choice(TOKENS) + content[field.end() :]
            case 3 if lines:
                lines.insert(source.randrange(len(lines)), source.choice(lines))
                content = b"".join(lines)
            case 4 if lines:
                lines.pop(source.randrange(len(lines)))
                content = b"".join(lines)
            case 5 if lines:
                i, j = source.randrange(len(lines)), source.randrange(len(lines))
                lines[i], lines[j] = lines[j], lines[i]
                content = b"".join(lines)
            case _:
                content = content[:start]
    return content


def read_robot(content: bytes) -> None:
    """Parses, and uses what was accepted."""
    robot = robot_file.parse(content)
    robot_file.warnings(robot)
    assert np.isfinite(parameters.values(robot)).all()


def read_table(content: bytes) -> None:
    """Parses, and checks what every accepted table promises."""
    with tempfile.NamedTemporaryFile(suffix=".csv") as file:
        file.write(content)
        file.flush()
        table = measurements.load(file.name, 2)
    assert len(table) == len(table.row) > 0
    assert np.isfinite(table.beta).all() and np.isfinite(table.alpha).all() and np.isfinite(table.force).all()
    assert (np.diff(table.beta, axis=1) >= -measurements.JOINT_ORDER_SLACK_M).all()
    if table.quaternion is not None:
        norms = np.linalg.norm(table.quaternion, axis=1)
        assert (np.isnan(norms) | (np.abs(norms - 1) < 1e-12)).all()


def read_log(content: bytes) -> None:
    """Imports, and checks that the table says which rows of the log it holds."""
    with tempfile.NamedTemporaryFile(suffix=".csv") as file:
        file.write(content)
        file.flush()
        log = read(file.name)
        table = convert(log, Choices()).table
    assert len(table) == len(table.row) > 0 and set(table.row) <= set(log.rows)
    assert np.isfinite(table.beta).all() and np.isfinite(table.alpha).all() and np.isfinite(table.force).all()


PARSERS: list[tuple[Callable[[bytes], None], bytes]] = [(read_robot, ROBOT), (read_table, TABLE), (read_log, LOG)]


def fuzz(parser: Callable[[bytes], None], seed_file: bytes, source: random.Random, seconds: float) -> tuple[int, int]:
    """Runs for `seconds`; returns how many files were tried and refused. Raises AssertionError with the culprit."""
    tried = refused = 0
    stop = time.monotonic() + seconds
    while time.monotonic() < stop:
        content = mutated(seed_file, source)
        tried += 1
        try:
            parser(content)
        except InputError as error:
            refused += 1
            told = str(error)
            assert told and len(told) < 20_000, f"an error without end or words: {content!r}"
        except Exception as error:
            trace = "".join(traceback.format_exception(error)[-3:])
            raise AssertionError(f"{parser.__name__} let out {error!r} on\n{content!r}\n{trace}") from error
    return tried, refused


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--seconds", type=float, default=10)
    arguments.add_argument("--seed", type=int, default=1)
    options = arguments.parse_args()
    csv_table.BLOCK_BYTES = 100  # so that small files have several blocks
    warnings.simplefilter("error")  # a stray warning on the user's screen is a fault too
    for parser, seed_file in PARSERS:
        source = random.Random(options.seed)
        try:
            tried, refused = fuzz(parser, seed_file, source, options.seconds / len(PARSERS))
        except AssertionError as error:
            print(error, file=sys.stderr)
            return 1
        print(f"{parser.__name__}: {tried} files, {refused} refused, none let out anything but an InputError")
    return 0


if __name__ == "__main__":
    sys.exit(main())
