"""Recordings as MCAP: read back by the format's own library, every row is there."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from ctcr.bench.record.folder import Folder
from ctcr.bench.record.row_file import RowFile
from ctcr.cli import cli
from ctcr.errors import InputError
from ctcr.table.csv_table import read_columns
from ctcr.table.measurements import column_names
from ctcr.track.recording import COLUMNS, CONTROL, write_mcap
from simulated_bench import ROBOT

reader = pytest.importorskip("mcap.reader", reason="mcap is not installed")


@pytest.fixture
def recording(tmp_path):
    """Of random rows; some have no pose."""
    rng = np.random.default_rng(8)
    folder = Folder(tmp_path / "out", {"robot": str(ROBOT), "bench": str(ROBOT)}, {}, 3)
    control = RowFile(folder.path / CONTROL, COLUMNS)
    for number in range(50):
        row = np.concatenate([[0.025 * number, 1], rng.standard_normal(len(column_names(3)) - 2)])
        row[11:] = math.nan if number % 7 == 0 else row[11:]
        folder.rows.append([row])
        if number > 10:
            control.append([[0.025 * number, 1, *rng.standard_normal(len(COLUMNS) - 2)]])
    folder.save()
    return folder


def messages(path):
    with open(path, "rb") as file:
        found = {}
        for schema, channel, message in reader.make_reader(file).iter_messages():
            assert schema.encoding == "jsonschema" and channel.message_encoding == "json"
            content = json.loads(message.data)
            properties = json.loads(schema.data)["properties"]
            assert list(content) == list(properties)
            values = [math.nan if value is None else value for value in content.values()]
            found.setdefault(channel.topic, []).append((message.log_time, values))
        return found


def test_rows(recording, tmp_path):
    """Every row stands at its time in its channel."""
    target = tmp_path / "out.mcap"
    counts = write_mcap(recording.path, target)
    found = messages(target)
    assert counts == {topic: len(rows) for topic, rows in found.items()}
    assert counts == {"/joints": 50, "/measurements": 50, "/reference": 39}
    names = column_names(3)
    table = read_columns(recording.path / "measurements.csv", names)
    parts = {"/joints": [*names[:8]], "/measurements": [*names[:2], *names[8:]]}
    for topic, columns in parts.items():
        expected = table[:, [names.index(name) for name in columns]]
        np.testing.assert_array_equal([values for _, values in found[topic]], expected)
    control = read_columns(recording.path / CONTROL, COLUMNS)
    np.testing.assert_array_equal([values for _, values in found["/reference"]], control)
    for rows in found.values():
        times = np.array([time for time, _ in rows]) * 1e-9 - recording.about["started_unix_s"]
        np.testing.assert_allclose(times, [values[0] for _, values in rows], atol=1e-6)


def test_attachments(recording, tmp_path):
    """The files that the recording was made with are attached."""
    target = tmp_path / "out.mcap"
    done = CliRunner().invoke(cli, ["export", str(recording.path), "-o", str(target)])
    assert done.exit_code == 0 and "/reference" in done.output
    with open(target, "rb") as file:
        attached = {one.name: one.data for one in reader.make_reader(file).iter_attachments()}
    assert set(attached) == {"session.json", "robot.yaml", "bench.yaml"}
    assert attached["robot.yaml"] == ROBOT.read_bytes()


def test_no_recording(tmp_path):
    """A folder without a recording, or with a damaged one, is refused and nothing is written."""
    with pytest.raises(InputError, match="session.json: cannot read it"):
        write_mcap(tmp_path, tmp_path / "out.mcap")
    for text in ("{", "{}", '{"started_unix_s": NaN, "settings": {}, "sittings": []}'):
        (tmp_path / "session.json").write_text(text)
        with pytest.raises(InputError, match="session.json: does not describe a recording"):
            write_mcap(tmp_path, tmp_path / "out.mcap")
    assert not (tmp_path / "out.mcap").exists()
