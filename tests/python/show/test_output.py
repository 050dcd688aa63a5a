"""Files are whole or absent, JSON is valid JSON, a progress bar waits."""

import io
import json
import os
import resource
import stat
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from ctcr.errors import InputError
from ctcr.show import output
from rich.console import Console


def test_write(tmp_path):
    """A file appears whole and replaces the old one."""
    path = tmp_path / "a.txt"
    for content in ("first", "second"):
        with output.atomic_writer(path) as file:
            file.write(content)
            assert not path.exists() or path.read_text() != content
        assert path.read_text() == content
    assert os.listdir(tmp_path) == ["a.txt"]


def test_write_error(tmp_path):
    """An error leaves the old file and nothing else."""
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), output.atomic_writer(path) as file:
        file.write("half")
        file.flush()
        raise ZeroDivisionError
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["a.txt"]


def test_full_disk(tmp_path):
    """A full disk is one sentence, and no part of the file stays."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))  # the disk takes no more than this
    try:
        with pytest.raises(InputError, match="cannot write it: file too large"):
            with output.atomic_writer(tmp_path / "a") as file:
                file.write("x" * 100_000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert os.listdir(tmp_path) == []


def test_pipe(tmp_path):
    """A pipe is written, never replaced."""
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    with output.atomic_writer(tmp_path / "pipe") as file:
        file.write("through")
    assert os.read(reader, 100) == b"through"
    assert stat.S_ISFIFO(os.stat(tmp_path / "pipe").st_mode)
    os.close(reader)


def test_read_only_folder():
    """A folder that cannot be written is an error and stays empty."""
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o555)
        user = os.geteuid()
        if user == 0:
            os.seteuid(65534)  # root writes everywhere
        try:
            with pytest.raises(InputError, match="cannot write it: permission denied"):
                with output.atomic_writer(Path(folder) / "a.txt") as file:
                    file.write("x")
        finally:
            os.seteuid(user)
        assert os.listdir(folder) == []


def test_absent_folder(tmp_path):
    """A folder that is absent, or stands where the file should."""
    for path, why in ((tmp_path / "absent" / "a.txt", "make the folder .*absent first"), (tmp_path, "it is a folder")):
        with pytest.raises(InputError, match=f"cannot write it: {why}"), output.atomic_writer(path) as file:
            file.write("x")


def test_link(tmp_path):
    """Writing through a link changes the file that it points to."""
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    with output.atomic_writer(tmp_path / "link") as file:
        file.write("new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real").read_text() == "new"


def test_permissions(tmp_path):
    """Results have the permissions of other new files."""
    with output.atomic_writer(tmp_path / "a") as file:
        file.write("x")
    (tmp_path / "b").write_text("x")
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


def test_json(tmp_path, capsys):
    """Arrays become lists, numbers that are not finite null."""
    data = {"a": np.array([[1.5, np.nan], [np.inf, 2]]), "b": np.int64(3), "c": (True, None, "x"), 4: float("nan")}
    expected = {"a": [[1.5, None], [None, 2.0]], "b": 3, "c": [True, None, "x"], "4": None}
    output.write_json(data, str(tmp_path / "a.json"))
    output.write_json(data, "-")
    assert json.loads((tmp_path / "a.json").read_text()) == expected == json.loads(capsys.readouterr().out)


def test_narrow_table():
    """A narrow table breaks sentences, and cuts no word or number."""
    sentence, number = "floor of a model without any history", "0.034 ± 0.006"
    made = output.table("", ["", "id", "what", "p"], [[sentence, "precurvature_profile", sentence, number]], 3)
    narrow = Console(width=80, file=io.StringIO())
    narrow.print(made)
    text = narrow.file.getvalue()
    assert max(map(len, text.splitlines())) <= 80
    assert number in text and sentence not in text  # it had to give way
    for word in ("precurvature_profile", *sentence.split()):
        assert word in text


def test_width(monkeypatch):
    """Tables keep to COLUMNS where they fit and are never cut; in a file, lines stay whole."""
    made = output.table("", ["name", "mean x", "95 %"], [["a sentence", "-1234.567", "1234.567"]])

    def printed(what, columns: str) -> list[str]:
        monkeypatch.setattr(sys, "stdout", io.StringIO())
        monkeypatch.setenv("COLUMNS", columns)
        output.console().print(what)
        return sys.stdout.getvalue().splitlines()

    assert max(map(len, printed(made, "50"))) <= 50
    assert len(printed("word " * 50, "50")) == 1
    for word in ("sentence", "-1234.567", "1234.567", "mean x", "95 %"):
        assert any(word in line for line in printed(made, "10"))


def test_progress(monkeypatch):
    """The bar waits a second and needs a terminal."""

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    for stream, seconds, shown in ((Terminal(), 5, True), (Terminal(), 0.5, False), (io.StringIO(), 5, False)):
        clock = iter([0.0, seconds])
        with monkeypatch.context() as patch:
            patch.setattr(output.time, "monotonic", lambda clock=clock: next(clock))
            patch.setattr(output.Progress, "_show", lambda self: setattr(self, "shown", True))
            patch.setattr("sys.stderr", stream)
            bar = output.Progress("work", 2)
            bar.advance(1)
            assert getattr(bar, "shown", False) == shown
