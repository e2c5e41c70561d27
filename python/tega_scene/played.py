"""Decode a scene recording's video at the playhead, from the last picture that stands alone."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.loop.inbox.stream import NEVER_NS
from tega.recording.mcap_index import open_indexed
from tega.recording.mcap_reader import Message
from tega.recording.replay.followed_file import FollowedFile, Follower, PlayedMoment
from tega.records.bus import Bus
from tega.records.display import DisplayPicture
from tega.runtime.files.foreign_file import reports_damage
from tega_scene.pictures import read_offsets
from tega_scene.record import scene_epoch
from tega_scene.video import SceneDecoder, SceneVideo, note_key

VIDEO: Final = "foxglove.CompressedVideo"
# A picture that is older than this is none of the moment.
_OLD_NS: Final = 1_000_000_000
_NO_KEY: Final = "no picture of its video stands alone, as one of H.264 or AV1 does at least once a second"


class PlayedCamera(Follower):
    """Decodes a camera's video up to the playhead, and converts the one picture that is to be seen.

    ``topic`` is ``/scene/NAME/video``. ``keys_ns`` is when pictures came that stand alone, rising, time of
    the recording; ``delay_ns`` the delay of the video after what it shows.
    """

    def __init__(self, topic: str, keys_ns: Iterable[int], bus: Bus, *, delay_ns: int = 0) -> None:
        super().__init__(topic.removeprefix("/scene/").removesuffix("/video"), delay_ns=delay_ns)
        self._keys_ns, self._bus = sorted(keys_ns), bus
        self._decoder: SceneDecoder | None = None
        self._decoded_ns = -1
        self._reports_none = not self._keys_ns
        self._displayed_ns: int | None = None

    def begin(self, at_ns: int, *, jumped: bool) -> None:
        """Go on from the last picture before a place that stands alone; from the first one after it, if there is none.

        If such a frame is next anyway, decoding continues.
        """
        place = max(bisect_right(self._keys_ns, at_ns) - 1, 0)
        key_ns = self._keys_ns[place] if self._keys_ns else NEVER_NS
        if jumped or key_ns > self._decoded_ns:
            self._decoder, self.since_ns, self._decoded_ns = None, key_ns, key_ns - 1
        else:
            self.since_ns = self._decoded_ns + 1

    def take(self, message: Message, known_ns: int, snapshot: PlayedMoment) -> None:  # noqa: ARG002  # it is told in settle
        """Decode the next picture."""
        if self._decoder is None:
            self._decoder = SceneDecoder(message.value.format)
        self._decoder.take(known_ns, message.value.data)
        self._decoded_ns = known_ns

    def settle(self, snapshot: PlayedMoment) -> None:
        """Report the newest frame, and that there is none once it is a second old.

        A frame that cannot be converted raises :class:`RecordingError`; that there is none raises it once.
        """
        if self._reports_none:
            self._reports_none = False
            raise RecordingError(_NO_KEY)
        newest = None if self._decoder is None else self._decoder.image()
        if newest is not None and snapshot.at_ns - newest[0] <= _OLD_NS:
            self._displayed_ns, image = newest
            self.n_published += 1
            self._notify(self._displayed_ns + snapshot.shift_ns, image)
        elif self._displayed_ns is not None and not 0 <= snapshot.at_ns - self._displayed_ns <= _OLD_NS:
            self._displayed_ns = None
            self._notify(snapshot.at_ns + snapshot.shift_ns, None)

    def _notify(self, t_ns: int, image: NDArray[np.uint8] | None) -> None:
        self._bus.publish(DisplayPicture(name=self.name, t_ns=t_ns, image=image))

    def skip(self, known_ns: int) -> None:
        """Go on with the next picture that stands alone."""
        place = bisect_right(self._keys_ns, known_ns)
        self.since_ns = self._keys_ns[place] if place < len(self._keys_ns) else NEVER_NS
        self._decoder = None


@reports_damage
def followed_scene(path: Path, bus: Bus, *, start_ns: int, end_ns: int) -> FollowedFile:
    """Open a scene recording, to be played beside a recording of the same machine.

    ``path`` is the MCAP file of ``scene record``; ``start_ns`` the machine's clock at the recording's
    beginning, ``end_ns`` the recording's length. One of another time raises :class:`RecordingError`.
    """
    reader = open_indexed(path)
    keys: dict[str, array[int]] = {}
    first_ns, last_ns = NEVER_NS, 0
    for message in reader.messages(lambda topic: not topic.endswith("/image")):
        if message.schema == VIDEO and message.value is not None:
            note_key(keys, message.topic, message.log_ns, message.value.format, message.value.data)
            first_ns, last_ns = min(first_ns, message.log_ns), max(last_ns, message.log_ns)
    if not keys:
        raise RecordingError(
            f"{path.name}: holds no scene camera", "name a file that tega-teleop scene record wrote"
        )
    for topic, found in keys.items():
        if not found:
            raise RecordingError(f"{path.name}: {topic}: {_NO_KEY}", "record it again with scene record")
    zero_ns = scene_epoch(reader) + start_ns
    if first_ns - zero_ns > end_ns or last_ns < zero_ns:
        raise RecordingError(
            f"{path.name}: goes from {(first_ns - zero_ns) / 1e9:.1f} to {(last_ns - zero_ns) / 1e9:.1f} s of a "
            f"recording of {end_ns / 1e9:.1f} s",
            "name the scene that was recorded beside it, on the same machine",
        )
    return FollowedFile(reader, zero_ns, _cameras(path, keys, zero_ns, bus))


def _cameras(path: Path, keys: Mapping[str, Iterable[int]], zero_ns: int, bus: Bus) -> dict[str, Follower]:
    late = {f"/scene/{name}/video": offset.late_ns for name, offset in read_offsets(path).items()}
    found = dict[str, Follower]()
    for topic, times_ns in keys.items():
        delay_ns = late.get(topic, 0)
        keys_ns = [time_ns - zero_ns - delay_ns for time_ns in times_ns]
        found[topic] = PlayedCamera(topic, keys_ns, bus, delay_ns=delay_ns)
    return found


class PlayedScene:
    """Plays the scene cameras of a recording, and scene recordings beside it."""

    def __init__(self) -> None:
        self._keys_ns: dict[str, array[int]] = {}

    def listen(self, bus: Bus) -> None:
        """Note the pictures of a video that stand alone."""
        bus.subscribe(SceneVideo, self._note, vital=True)

    def _note(self, packet: SceneVideo) -> None:
        note_key(self._keys_ns, packet.where, packet.log_ns, packet.video, packet.data)

    def topics(self, path: Path, bus: Bus) -> Mapping[str, Follower]:
        """Return the videos of the recording."""
        wanted = self._keys_ns and bus.wants(DisplayPicture)
        return _cameras(path, self._keys_ns, 0, bus) if wanted else {}

    def beside(self, path: Path, bus: Bus, *, start_ns: int, end_ns: int) -> FollowedFile | None:
        """Return a scene recording of the same machine."""
        if not bus.wants(DisplayPicture):
            return None
        return followed_scene(path, bus, start_ns=start_ns, end_ns=end_ns)
