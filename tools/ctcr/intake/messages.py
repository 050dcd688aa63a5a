"""Logs of messages: MCAP with JSON, as `ctcr export` writes it. Bags of ROS are refused with the way round."""

import io
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from ctcr.errors import InputError, Problem
from ctcr.intake.log import Log
from ctcr.intake.packages import needed
from ctcr.show.wording import listed

MCAP = b"\x89MCAP0\r\n"
_OURS = ("/joints", "/measurements")
_NO_BAGS = (
    "bags of ROS are not read: play the bag, write each topic to a text file with"
    " `ros2 topic echo --csv TOPIC > topic.csv`, and import these (docs/formats.md)"
)
BAGS = {
    b"#ROSBAG V2.0": f"is a bag of ROS 1: {_NO_BAGS}",
    b"SQLite format 3\0": f"is a database of SQLite, as ROS 2 records bags: {_NO_BAGS}",
}


def read_mcap(path: Path, content: bytes) -> Log:
    """JSON messages; those of several channels at one time are one row."""
    make_reader = needed("mcap", "mcap.reader", "bench", path).make_reader
    rows: dict[int, dict[str, Any]] = {}
    skipped: Counter[tuple[str, str]] = Counter()  # by topic and encoding
    try:
        messages = list(make_reader(io.BytesIO(content)).iter_messages())
        ours = any(channel.topic in _OURS for _, channel, _ in messages)
        for _, channel, message in messages:
            if channel.message_encoding != "json" or ours and channel.topic not in _OURS:
                skipped[channel.topic, channel.message_encoding] += 1
                continue
            rows.setdefault(message.log_time, {}).update(json.loads(message.data))
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(Problem(f"is a damaged MCAP file: {reason}", str(path))) from None
    if not rows:
        held = listed([f"{topic} ({encoding})" for topic, encoding in skipped]) if skipped else "no messages"
        ros = any(encoding in ("cdr", "ros1") for _, encoding in skipped)
        todo = _NO_BAGS if ros else "export it with `ctcr export`, or as text"
        raise InputError(Problem(f"holds no JSON messages, but {held}: {todo}", str(path)))
    ordered = [row for _, row in sorted(rows.items())]
    names = tuple(dict.fromkeys(name for row in ordered for name in row))
    values = tuple(["" if row.get(name) is None else str(row[name]) for row in ordered] for name in names)
    notes = [f"channel {topic}: {count} messages left out" for (topic, _), count in skipped.items()]
    return Log(path, "MCAP", names, values, np.arange(1, len(ordered) + 1), notes=notes)
