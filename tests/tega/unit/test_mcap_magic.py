"""A recording whose last bytes are damaged is read up to there; only a file without anything of MCAP is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

from tega.errors import RecordingError
from tega.recording.mcap_reader import McapReader


def damaged(path: Path, *, metadata: bool, channel: bool) -> Path:
    """Write a file of MCAP with these parts, the magic at its end damaged."""
    with path.open("wb") as file:
        writer: Any = Writer(file)
        writer.start()
        if metadata:
            writer.add_metadata("tega", {"format": "tega-recording"})
        if channel:
            writer.register_channel(
                "/run/state", "protobuf", writer.register_schema("State", "protobuf", b"")
            )
        writer.finish()
    path.write_bytes(path.read_bytes()[:-8] + b"\x00" * 8)
    return path


@pytest.mark.parametrize(("metadata", "channel"), [(True, False), (False, True), (True, True)])
def test_a_file_of_mcap_with_a_damaged_end_is_read_and_called_cut(
    tmp_path: Path, metadata: bool, channel: bool
) -> None:
    reader = McapReader(damaged(tmp_path / "trial-001.mcap", metadata=metadata, channel=channel))
    assert list(reader.messages()) == []
    assert reader.cut == "InvalidMagic"
    assert ("tega" in reader.metadata) == metadata


def test_a_file_with_nothing_of_mcap_is_refused(tmp_path: Path) -> None:
    reader = McapReader(damaged(tmp_path / "trial-001.mcap", metadata=False, channel=False))
    with pytest.raises(RecordingError, match="no MCAP file"):
        list(reader.messages())
