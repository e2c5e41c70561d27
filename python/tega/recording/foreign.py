"""Name an MCAP file that another program wrote: its profile and its topics."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from tega.errors import RecordingError
from tega.runtime.lifecycle import require

_MOST_TOPICS: Final = 12


def no_session(path: Path, names: Iterable[str]) -> RecordingError:
    """Return the error for a file that holds no recording of a session.

    If one of ``names``, its tables and schemas, is of TEGA, the file is another kind of recording; if none
    is, the error names the profile, the topics, their types and numbers of messages.
    """
    if any(name.startswith("tega") for name in names):
        return RecordingError(f"{path.name}: no recording of a session", "name a file made with --record")
    if not path.stat().st_size:
        return RecordingError(f"{path.name}: is empty (0 bytes)", "copy it again from its source")
    profile, library, topics = _reported(path)
    listed = ", ".join(topics[:_MOST_TOPICS])
    if len(topics) > _MOST_TOPICS:
        listed += f" and {len(topics) - _MOST_TOPICS} more"
    by = f"profile {profile}" if profile else f"written by {library}" if library else "no profile"
    hint = "name a recording made with --record"
    if profile == "ros2":
        hint = f"replay pictures or arrays in it: tega-teleop replay --tactile thumb={path.name} --topic thumb=TOPIC"
    text = f"its topics: {listed}" if listed else "it holds no topic"
    return RecordingError(f"{path.name}: not recorded by TEGA ({by}); {text}"[:2000], hint)


def _reported(path: Path) -> tuple[str, str, list[str]]:
    """Return profile, library, and topics as ``/camera sensor_msgs/msg/Image (120)``, as far as the file has them."""
    make_reader: Any = require("mcap.reader", driver="recording", extra="record").make_reader
    profile = library = ""
    try:
        with path.open("rb") as file:
            reader = make_reader(file)
            header = reader.get_header()
            profile, library = header.profile, header.library
            summary = reader.get_summary()
        counts = summary.statistics.channel_message_counts if summary.statistics else {}
        types = {number: schema.name for number, schema in summary.schemas.items()} | {0: "no schema"}
        topics = [
            f"{channel.topic} {types[channel.schema_id]} ({counts.get(number, 0)})"
            for number, channel in summary.channels.items()
        ]
    except Exception:  # of a file that was cut the reader raises what it likes; it has no summary
        topics = []
    return profile, library, sorted(topics)
