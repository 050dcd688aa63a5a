"""A recording as MCAP, the container that viewers of robot data read: each row at its time, in JSON."""

import json
from pathlib import Path

from ctcr.arrays import Array
from ctcr.bench.devices.fault import needed
from ctcr.bench.record.folder import ABOUT, COPIES, TABLE
from ctcr.errors import InputError, Problem, file_fault
from ctcr.robot import robot_file
from ctcr.show.output import atomic_writer
from ctcr.table.csv_table import read_columns
from ctcr.table.measurements import column_names, group_columns
from ctcr.track.recording import COLUMNS, CONTROL

JOINTS, MEASUREMENTS, REFERENCE = "/joints", "/measurements", "/reference"


def write_mcap(folder: str | Path, target: str | Path) -> dict[str, int]:
    """Writes the recording of a folder; the number of messages on each channel.

    A message holds the columns of its channel under their names, which carry the units; null was not measured. Times
    are those of the day. The files that the recording was made with are attached. Raises InputError where the folder
    holds no recording, or the package mcap is missing.
    """
    writer_of = needed("mcap", "mcap.writer", "export").Writer
    folder = Path(folder)
    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
    except OSError as error:
        raise file_fault(error, folder / ABOUT, "read") from None
    except ValueError:
        raise InputError(Problem("is no JSON: is this the folder of a recording?", str(folder / ABOUT))) from None
    start, counts = about["started_unix_s"], {}
    with atomic_writer(target, binary=True) as file:
        writer = writer_of(file)
        writer.start(profile="", library="ctcr")
        for channel, (columns, rows) in _channels(folder).items():
            counts[channel] = _write(writer, channel, columns, rows, start)
        for name in (ABOUT, *COPIES.values()):
            if (folder / name).exists():
                kind = "application/json" if name.endswith(".json") else "text/plain"
                stamp = _ns(start)
                writer.add_attachment(stamp, stamp, name, kind, (folder / name).read_bytes())
        writer.finish()
    return counts


def _channels(folder: Path) -> dict[str, tuple[list[str], Array]]:
    """Columns and rows of each channel; the first column is t_s."""
    n = robot_file.load(folder / COPIES["robot"]).n_tubes
    names, groups = column_names(n), group_columns(n)
    table = read_columns(folder / TABLE, names)
    kept = {
        JOINTS: [name for group in ("t", "run", "beta", "alpha") for name in groups[group]],
        MEASUREMENTS: [name for group in ("t", "run", "force", "position", "quaternion") for name in groups[group]],
    }
    found = {channel: (columns, table[:, [names.index(name) for name in columns]]) for channel, columns in kept.items()}
    if (folder / CONTROL).exists():
        found[REFERENCE] = list(COLUMNS), read_columns(folder / CONTROL, COLUMNS)
    return found


def _write(writer, topic: str, columns: list[str], rows: Array, start: float) -> int:
    schema = {
        "type": "object",
        "required": columns,
        "properties": {name: {"type": ["number", "null"]} for name in columns},
    }
    described = writer.register_schema(f"ctcr{topic}", "jsonschema", json.dumps(schema).encode())
    channel = writer.register_channel(topic, "json", described)
    for number, row in enumerate(rows):
        message = {name: None if value != value else value for name, value in zip(columns, row.tolist(), strict=True)}
        time = _ns(start + row[0])
        writer.add_message(channel, time, json.dumps(message).encode(), time, number)
    return len(rows)


def _ns(seconds: float) -> int:
    return round(1e9 * seconds)
