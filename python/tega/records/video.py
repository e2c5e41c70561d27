"""Define the base of records that hold encoded video."""

from __future__ import annotations

from typing import ClassVar

from tega.records.base import Ns, Record


class VideoPacket(Record, frozen=True, kw_only=True):
    """One encoded picture of a camera; a feature gives the topic.

    Attributes:
        camera: Name of the camera.
        t_ns: Time at which the machine received the picture, since the start of the session.
        data: The packet: Annex B of H.264, or a temporal unit of AV1.
        video: ``h264`` or ``av1``.
    """

    schema: ClassVar[str] = "foxglove.CompressedVideo"

    camera: str
    t_ns: Ns
    data: bytes
    video: str

    @property
    def n_bytes(self) -> int:
        """Memory of the packet, bytes."""
        return len(self.data)
