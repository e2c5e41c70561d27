"""Publish a recording's pictures, muscle samples and scene video on a run's bus, as the playhead passes them.

The records are published as those of connected devices, so the page shows a recording like a live run. Nothing is
read ahead, so a jump leaves nothing behind, and only a part of a file is in memory.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np
from msgspec.structs import replace

from tega.config.attached import with_attached
from tega.config.choose import finger_metric
from tega.devices.base import TactileFrame
from tega.errors import RecordingError
from tega.loop.inbox.frames import FrameMeter
from tega.loop.inbox.sources import SourceReport
from tega.loop.parts import Part
from tega.recording.mcap_reader import read_picture, table_ns
from tega.recording.replay.followed_file import FollowedFile, PlayedMoment, StreamFollower
from tega.recording.replay.players import refuse_namesakes
from tega.records import EmgSamples
from tega.runtime.threads import run_realtime
from tega.stages.base import MeasuredPicture

if TYPE_CHECKING:
    from tega.config.calibration import EmgMaxima
    from tega.loop.moment import LoopView
    from tega.recording.mcap_reader import Message
    from tega.recording.replay.measured import Measured
    from tega.recording.replay.playhead import Playhead
    from tega.recording.replay.recorded import Recorded
    from tega.records.bus import Bus

# A metric with a memory looks at so much before the first picture that is shown after a jump.
_WARM_NS: Final = 1_000_000_000
# Reading that is so late, in the machine's time, leaves out what lies between.
_BEHIND_S: Final = 1.0
_LOOK_S: Final = 0.01
_LEAVE_S: Final = 5.0


class PlayedFinger:
    """Measures a finger's recorded frames again for displays; the vest does not depend on it.

    Args:
        finger: Its name.
        meter: Creates the metric's meter, which is reset at each jump.
        bus: Each frame is published here.
    """

    def __init__(self, finger: str, meter: Callable[[], FrameMeter], bus: Bus) -> None:
        self.name, self.since_ns, self.n_told = finger, 0, 0
        self._make, self._bus = meter, bus
        self._meter: FrameMeter | None = None
        self._picture: Message | None = None
        self._shown_ns = 0

    def begin(self, at_ns: int, *, jumped: bool) -> None:
        """Begin a second before a position, or skip the frames before it."""
        self._picture, self._shown_ns, self.since_ns = None, at_ns, at_ns
        if jumped:
            self._meter, self.since_ns = None, at_ns - _WARM_NS

    def take(self, message: Message, known_ns: int, moment: PlayedMoment) -> None:
        """Take a picture, or the number and times that follow it."""
        if message.schema != "tega.Frame":
            self._picture = message
            return
        picture, self._picture = self._picture, None
        if picture is None:
            return
        told = message.value
        if self._meter is None:
            self._meter = self._make()
        metric = self._meter.metric
        metric.loaded = getattr(told, "loaded", False)  # earlier recordings do not say
        if getattr(told, "rezeroed", False):
            metric.rezero()
        image = read_picture(picture)
        contact = self._meter.take(TactileFrame(told.t_ns, told.seq, image, told.name))
        if contact is None or known_ns < self._shown_ns:
            return
        contact = replace(contact, t_ns=contact.t_ns + moment.shift_ns)
        self._bus.publish(MeasuredPicture(image=image, contact=contact, metric=metric))
        self.n_told += 1

    def settle(self, moment: PlayedMoment) -> None:
        """Do nothing: every frame is published as it is measured."""

    def skip(self, known_ns: int) -> None:  # noqa: ARG002  # the next one will do
        """Go on with the next picture."""
        self._picture = None


class PlayedSamples:
    """Publishes the recorded samples of the muscles, numbered by the run's time, which a jump does not change.

    Args:
        maxima: Rate and channels.
        bus: The samples are published here.
    """

    def __init__(self, maxima: EmgMaxima, bus: Bus) -> None:
        self.name, self.since_ns, self.n_told = "emg", 0, 0
        self._n_channels, self._rate_hz, self._bus = len(maxima.channels), maxima.rate_hz, bus
        self._offset: int | None = None

    def begin(self, at_ns: int, *, jumped: bool) -> None:  # noqa: ARG002  # no memory
        """Go on at a place."""
        self.since_ns = at_ns
        self._offset = None

    def take(self, message: Message, known_ns: int, moment: PlayedMoment) -> None:
        """Publish the next samples.

        Raises:
            RecordingError: The samples have another number of channels.
        """
        told = message.value
        samples = np.array(told.samples, np.float64)
        n, more = divmod(samples.size, self._n_channels)
        if told.n_channels != self._n_channels or more:
            raise RecordingError(f"{told.n_channels} channels, and the maxima are of {self._n_channels}")
        t_ns = told.t_ns + moment.shift_ns
        if self._offset is None:
            self._offset = round(t_ns * 1e-9 * self._rate_hz) - told.first_index - n
        self._bus.publish(
            EmgSamples(
                t_ns=t_ns,
                received_ns=known_ns + moment.shift_ns,
                first_index=told.first_index + self._offset,
                n_channels=self._n_channels,
                samples=samples,
            )
        )
        self.n_told += 1

    def settle(self, moment: PlayedMoment) -> None:
        """Do nothing: samples are published as they arrive."""

    def skip(self, known_ns: int) -> None:  # noqa: ARG002  # the next one will do
        """Go on with the next samples."""
        self._offset = None


class PlayedStreams(Part):
    """Follows the playhead, in a thread for each file, or in the run's own where that has no real time.

    Use as a context manager around the run. Topics without subscribers are not read.

    Args:
        path: The recording.
        recorded: The recording's content.
        measured: Settings and metric for measuring its pictures.
        playhead: Position of the playback.
        bus: The records are published here as they pass.
        others: Further files of the same time, each played by the feature that wants it.
        speed: Seconds of the recording a second; ``None`` for as fast as it goes.

    Raises:
        RecordingError: A file cannot be used, or is of another time.
    """

    def __init__(
        self,
        path: Path,
        recorded: Recorded,
        measured: Measured,
        playhead: Playhead,
        bus: Bus,
        *,
        others: Sequence[Path] = (),
        speed: float | None = 1.0,
    ) -> None:
        self._playhead = playhead
        self._moment: PlayedMoment | None = None
        self._closing = threading.Event()
        self._inline = speed is None
        behind_ns = 2**62 if speed is None else round(_BEHIND_S * 1e9 * max(speed, 1.0))
        facts = recorded.head.facts
        self._files: list[FollowedFile] = []
        topics, late = _topics(path, recorded, measured, bus)
        if recorded.reader is not None and topics:
            zero_ns = _told_ns(path, facts, "epoch_ns")
            self._files.append(
                FollowedFile(recorded.reader, zero_ns, topics, behind_ns=behind_ns, delays_ns=late)
            )
        for other in others:
            start_ns = _told_ns(path, facts, "start_ns")
            for player in recorded.players:
                followed = player.beside(
                    other, bus, start_ns=start_ns, end_ns=playhead.end_ns, behind_ns=behind_ns
                )
                if followed is not None:
                    self._files.append(followed)
        self._followers = [one for file in self._files for one in file.followers]
        refuse_namesakes(self._followers)
        self._threads = [
            threading.Thread(target=partial(self._work, file), name="tega-played", daemon=True)
            for file in self._files
        ]
        playhead.fills.append(self.fill)

    def __enter__(self) -> Self:
        """Begin to follow."""
        if not self._inline:
            for thread in self._threads:
                thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the threads."""
        self._closing.set()
        for thread in self._threads:
            if thread.ident is not None:
                thread.join(_LEAVE_S)

    def fill(self, t_ns: int) -> None:
        """Update the position for a time of the run."""
        playhead = self._playhead
        at_ns = t_ns - playhead.shift_ns
        if at_ns < playhead.from_ns and not playhead.n_jumps:
            return
        self._moment = PlayedMoment(playhead.n_jumps, at_ns, playhead.shift_ns)
        if self._inline:
            for file in self._files:
                file.follow(self._moment, self._closing)

    @run_realtime("beside")
    def _work(self, file: FollowedFile) -> None:
        while not self._closing.wait(_LOOK_S):
            if (moment := self._moment) is not None:
                file.follow(moment, self._closing)

    @property
    def problems(self) -> tuple[str, ...]:
        """Parts of the recording that cannot be shown, a sentence each."""
        return tuple(said for file in self._files for said in tuple(file.problems.values()))

    def shown(self, view: LoopView) -> LoopView:
        """Add the parts that cannot be shown to a view of the loop."""
        return view._replace(alerts=(*view.alerts, *problems)) if (problems := self.problems) else view

    def n_shown(self) -> dict[str, int]:
        """Return the number of published frames and chunks of samples, by finger, camera and ``emg``."""
        return {one.name: one.n_told for one in self._followers}


def _told_ns(path: Path, facts: Mapping[str, str], name: str) -> int:
    if (told := table_ns(facts, name)) is None:
        raise RecordingError(
            f"{path.name}: does not say when it began: {name} = {facts.get(name, '')[:40]!r}"
        )
    return told


def _topics(
    path: Path, recorded: Recorded, measured: Measured, bus: Bus
) -> tuple[dict[str, StreamFollower], dict[str, int]]:
    """Return the follower of each topic, and how much later than it was taken its data came, nanoseconds."""
    head, topics, late = recorded.head, dict[str, StreamFollower](), dict[str, int]()
    zero_ns = table_ns(head.facts, "epoch_ns") or 0
    if bus.wants(MeasuredPicture):
        for finger, baseline in head.baselines.items():
            one = PlayedFinger(finger, partial(_meter, recorded, measured, finger, baseline), bus)
            topics |= {f"/tactile/{finger}/image": one, f"/tactile/{finger}/frame": one}
    if bus.wants(EmgSamples) and (maxima := measured.calibration.emg) is not None:
        topics[EmgSamples.topic] = PlayedSamples(maxima, bus)
    for player in recorded.players:
        played = player.topics(path, zero_ns, bus)
        topics |= played.followers
        late |= played.delays_ns
    return topics, late


def _meter(recorded: Recorded, measured: Measured, finger: str, baseline: Any) -> FrameMeter:
    """Make a finger's meter, as in the run."""
    head, config = recorded.head, measured.config
    with with_attached(config.stages, head.files) as stages:
        calibration = measured.calibration.touch(finger)
        metric = finger_metric(stages, config.session.preset, finger, baseline, calibration)
    live = head.sources[finger].live and head.lossless
    return FrameMeter(baseline, metric, SourceReport(), live=live)
