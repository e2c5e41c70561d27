"""Define the record of what a scene camera films."""

from __future__ import annotations

from typing import ClassVar

from tega.records.base import Ns, Record


class SceneVideo(Record, frozen=True, kw_only=True):
    """One encoded picture of a scene camera.

    Attributes:
        camera: Its name.
        t_ns: When the machine had the picture, since the start of the session.
        data: The packet: Annex B of H.264, or a temporal unit of AV1.
        video: ``h264`` or ``av1``.
    """

    topic: ClassVar[str] = "/scene/{camera}/video"
    schema: ClassVar[str] = "foxglove.CompressedVideo"

    camera: str
    t_ns: Ns
    data: bytes
    video: str

    @property
    def n_bytes(self) -> int:
        """Memory of the packet, bytes."""
        return len(self.data)
