"""Keep how late a scene recording's cameras are: ``session.offsets.json`` beside ``session.mcap``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import read_foreign
from tega.runtime.files.whole_file import write_whole

MOST_LATE_S, LEAST_LATE_S = 2.0, -0.1
"""Delays that a camera may have, seconds."""


class CameraOffset(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Delay of a camera.

    ``late_s`` is how much later than the middle of its exposure a picture has its time, ``error_s`` its
    standard error, ``n_edges`` the switchings of the light that it comes from.
    """

    late_s: Annotated[float, msgspec.Meta(ge=LEAST_LATE_S, le=MOST_LATE_S)]
    error_s: Annotated[float, msgspec.Meta(ge=0, le=MOST_LATE_S)]
    n_edges: Annotated[int, msgspec.Meta(ge=1, le=1_000_000)]

    @property
    def late_ns(self) -> int:
        """The delay in nanoseconds."""
        return round(self.late_s * 1e9)


def offsets_path(recording: Path) -> Path:
    """Return where the offsets of a scene recording are: ``session.mcap`` has ``session.offsets.json``."""
    return recording.with_suffix(".offsets.json")


def read_offsets(recording: Path) -> dict[str, CameraOffset]:
    """Return the offsets of a scene recording by camera; none where none were estimated."""
    path = offsets_path(recording)
    if not path.exists():
        return {}
    try:
        return msgspec.json.decode(read_foreign(path, most_mib=1), type=dict[str, CameraOffset])
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise RecordingError(
            f"{path.name}: no offsets of scene cameras: {error}",
            "estimate them again with tega-teleop scene offset, or remove the file",
        ) from error


def keep_offset(recording: Path, name: str, offset: CameraOffset) -> None:
    """Write a camera's offset beside its recording; those of its other cameras stay."""
    offsets = read_offsets(recording) | {name: offset}
    text = msgspec.json.format(msgspec.json.encode(offsets), indent=2).decode() + "\n"
    write_whole(offsets_path(recording), text)
