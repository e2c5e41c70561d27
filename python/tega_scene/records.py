"""Define the record of a scene camera's video."""

from __future__ import annotations

from typing import ClassVar

from tega.records.base import VideoPacket


class SceneVideo(VideoPacket, frozen=True, kw_only=True):
    """One encoded picture of a scene camera."""

    topic: ClassVar[str] = "/scene/{camera}/video"


RECORDS = (SceneVideo,)
"""Record types of scene cameras."""
