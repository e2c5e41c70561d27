"""Read the pictures of a fingertip from a ROS 2 bag."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tega.devices.base import Options, TactileFrame
from tega.devices.fingertip.images import RecordedPictures
from tega.errors import RecordingError
from tega.runtime.opencv import decode_image
from tega_ros2.bag import Ros2Bag, picture_of

# Pictures whose distances give the rate.
_FIRST = 200


class Ros2PicturesOptions(Options, frozen=True):
    """Settings of :class:`Ros2Pictures`.

    Attributes:
        file: An MCAP file of a bag, or the bag's folder.
        topic: Topic with ``sensor_msgs/msg/Image`` or ``CompressedImage``; by default the only one.
    """

    file: Path
    topic: str = ""


class Ros2Pictures(RecordedPictures):
    """The pictures of a topic, each at its own time from the beginning of the bag."""

    name: ClassVar[str] = "ros2-pictures"
    summary: ClassVar[str] = "pictures of a topic in a ROS 2 bag (MCAP)"
    extra: ClassVar[str] = "ros2"
    requires: ClassVar[tuple[str, ...]] = ("mcap", "mcap_ros2")
    options_type: ClassVar[type[Options]] = Ros2PicturesOptions

    def __init__(self, options: Ros2PicturesOptions) -> None:
        super().__init__(options.file.name)
        self._options = options
        self._bag: Ros2Bag | None = None
        self._messages: Iterator[tuple[int, Any]] = iter(())
        self._pending: tuple[int, Any] | None = None

    def open(self) -> None:
        """Open the bag, and measure the rate over its first pictures."""
        self.close()
        bag = Ros2Bag(self._options.file, topic=self._options.topic, pictures=True)
        times = np.array([t_ns for (t_ns, _), _ in zip(bag.messages(), range(_FIRST), strict=False)])
        if not len(times):
            raise RecordingError(
                f"{self._options.file.name}: {bag.topic} holds no picture", "name another topic"
            )
        self._rate_hz = 1e9 / float(np.median(np.diff(times))) if len(times) > 1 else 1.0
        self._begin(bag.n_messages)
        self._bag, self._messages = bag, bag.messages()
        self._pending = next(self._messages, None)

    def close(self) -> None:
        """Close the bag."""
        self._messages, self._pending, self._bag, self._n_pictures = iter(()), None, None, None

    @property
    def ended(self) -> bool:
        """Whether all pictures were read."""
        return self._bag is not None and self._pending is None

    def skip(self, n_frames: int) -> None:
        """Pass over pictures without decoding their pixels."""
        for _ in range(n_frames):
            if self._pending is not None:
                self._pending = next(self._messages, None)
                self._seq += 1

    def read(self, timeout_s: float) -> TactileFrame | None:  # noqa: ARG002  # a file never keeps one waiting
        """Return the next picture; ``RecordingError`` unless it has 8 bits and the first one's size."""
        if self._bag is None:
            raise self._closed()
        if self._pending is None:
            return None
        (t_ns, value), seq = self._pending, self._seq
        self.skip(1)
        name = f"{self._label} {self._bag.topic} picture {seq}"
        found = picture_of(value, self._bag.kind, name)
        image = decode_image(found, name, driver=self.name) if isinstance(found, bytes) else found
        return self._frame(seq, t_ns, image, name, "cut the bag there")
