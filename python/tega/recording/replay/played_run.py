"""Play a recording in a run: its input, and what else it holds for displays, each item when it came then.

Pictures, samples and video are published as those of connected devices, so the page shows a recording like a live run.
Only a part of a file is in memory. Nothing of the recorded arm moves an arm.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from msgspec.structs import replace

from tega.arm.messages import Health
from tega.config.attached import with_attached
from tega.config.choose import muscle_decoder
from tega.errors import ConfigError, RecordingError
from tega.loop.arm_records import arm_view
from tega.loop.inbox.inputs import Finger, Muscles, Prepared
from tega.loop.inbox.reader import Reader
from tega.loop.inbox.sources import SourceReport
from tega.loop.loop import FIRST_LEVEL
from tega.loop.parts import Part, RunStart
from tega.loop.snapshot import LoopView
from tega.recording.mcap_reader import table_ns
from tega.recording.replay.feed import RecordFeed
from tega.recording.replay.followed_file import (
    FollowedFile,
    Follower,
    PlayedFinger,
    PlayedMoment,
    PlayedSamples,
    Player,
)
from tega.recording.replay.measured import Measured
from tega.recording.replay.playhead import PlayedItems, Playhead, Track
from tega.records import ArmTurn, Contact, EmgSamples, HandCommand, HandLook, Haptics, Imposed, Intent, Marker
from tega.records.bus import Bus
from tega.runtime.features import call_member, having
from tega.runtime.files.foreign_file import reports_damage
from tega.runtime.lifecycle import Elsewhere
from tega.stages.base import MeasuredPicture

PLAYED: Final = "recording"
"""Source of a marker that is published again."""

# Reading that is so late, in the machine's time, leaves out what lies between.
_BEHIND_S: Final = 1.0
_POLL_S: Final = 0.01


class PlayedRun(Part):
    """Plays a recording's records as the playhead passes them; read ``feed`` before the rest is used.

    ``facts`` are the summary's about the playback, besides what happened in it.
    """

    def __init__(self, feed: RecordFeed, playhead: Playhead) -> None:
        self.feed, self._playhead = feed, playhead
        self._measured = Measured(feed, Bus())
        self._contacts, self._intents = feed.collect(Contact), feed.collect(Intent)
        self._commands, self._imposed = feed.collect(HandCommand), feed.collect(Imposed)
        self._checks, self._haptics = feed.collect(HandLook), feed.collect(Haptics)
        self._marked, self._turned = feed.collect(Marker), feed.collect(ArmTurn)
        self._bus, self._files, self._readers = Bus(), list[FollowedFile](), list[Reader[PlayedMoment]]()
        self._closing = threading.Event()
        self._snapshot: PlayedMoment | None = None
        self.facts: dict[str, Any] = {}
        self._players: list[Player] = [call_member(feature, "played") for feature in having("played")]
        for player in self._players:
            player.listen(feed.bus)

    @reports_damage
    def sources(self, note: str) -> Prepared:
        """Return the sources of the run, with a note for readers of its results."""
        head, muscles, emg = self.feed.head, None, self.feed.head.calibration.emg

        def source(name: str) -> Any:
            then = head.sources[name]
            label = f"{then.driver} {then.label}"
            return Elsewhere(
                replace(then, driver="recorded", label=label, live=False, n_items=None, notes=(note,))
            )

        fingers = {}
        for finger, baseline in head.baselines.items():
            rows = [row for row in self._contacts if row.finger == finger]
            now = [
                replace(one, taken_ns=row.taken_ns) for row in rows if (one := self._measured.contact(row))
            ]
            report, stream = SourceReport(n_items=len(now)), PlayedItems(now, self._playhead).stream
            fingers[finger] = Finger(source(finger), baseline, "recording", report, stream=stream)
        if "emg" in head.sources and emg is not None:
            with with_attached(head.config.stages, head.files) as stages:
                decoder = muscle_decoder(stages, head.config.session.preset, emg)
            levels = self._levels(len(emg.channels))
            muscles = Muscles(source("emg"), emg, decoder, SourceReport(), stream=levels.stream)
        name = "" if head.facts["calibration"] == "self-calibrated" else head.facts["calibration"]
        looks = {check.t_ns: check for check in self._checks}
        check = played_checks(list(looks.values()), self._playhead) if looks else None
        return Prepared(fingers, muscles, head.calibration, name, poll_hand=check)

    def haptics(self, permitted: Callable[[], bool]) -> Callable[[], bool]:
        """Return the function that allows motors to vibrate if the run did then, and another function does."""
        switches = Track(self._haptics, self._playhead)
        return lambda: ((switch := switches.at_playhead()) is None or switch.on) and permitted()

    def follow(self, bus: Bus, others: Sequence[Path]) -> None:
        """Open the files to follow: a thread for each, or the run's own where that has no real time.

        Topics without subscribers on the bus are not read. A jump publishes no marker. ``ConfigError`` where
        two streams have the same name, ``RecordingError`` where a file is of another time.
        """
        feed, playhead, self._bus = self.feed, self._playhead, bus
        markers = (Marker(t_ns=one.t_ns, text=one.text, source=PLAYED) for one in self._marked)
        self._markers = Track(sorted(markers, key=lambda marker: marker.t_ns), playhead)
        self._turns = Track(self._turned, playhead)
        if topics := _topics(feed, bus, self._players):
            self._files.append(FollowedFile(feed.reader, feed.epoch_ns, topics))
        start_ns = table_ns(feed.head.facts, "start_ns")
        for other in others:
            if start_ns is None:
                raise RecordingError(f"{feed.reader.path.name}: does not say when it began: no start_ns")
            times = {"start_ns": start_ns, "end_ns": playhead.end_ns}
            self._files += filter(None, (player.beside(other, bus, **times) for player in self._players))
        self._followers = [one for file in self._files for one in file.followers]
        for name, n in Counter(one.name for one in self._followers).items():
            if n > 1:
                raise ConfigError(f"two streams to be played are called {name!r}", "leave one of them out")
        playhead.fills.append(self.fill)

    def begin(self, run: RunStart) -> None:  # noqa: ARG002  # the files know all that is needed
        """Start the threads."""
        if self._playhead.speed is not None:
            self._readers = [
                Reader("played", self._snapshots, partial(file.follow, closing=self._closing), rank="beside")
                for file in self._files
            ]

    def end(self) -> None:
        """End the threads."""
        self._closing.set()
        for reader in self._readers:
            reader.close()

    def fill(self, t_ns: int) -> None:  # noqa: ARG002  # the playhead has it
        """Publish the markers that have passed, and let the files follow."""
        playhead = self._playhead
        for marker in self._markers.due():
            self._bus.publish(replace(marker, t_ns=marker.t_ns + playhead.shift_ns))
        if playhead.at_ns < playhead.from_ns and not playhead.n_jumps:
            return
        snapshot = PlayedMoment(playhead.n_jumps, playhead.at_ns, playhead.shift_ns)
        if playhead.speed is not None:
            self._snapshot = snapshot._replace(behind_ns=round(_BEHIND_S * 1e9 * max(playhead.speed, 1.0)))
            return
        for file in self._files:
            file.follow(snapshot, self._closing)

    def _snapshots(self, _stopped: Callable[[], bool]) -> Iterator[PlayedMoment]:
        """Yield the newest position, again and again until the run ends."""
        while not self._closing.wait(_POLL_S):
            if (snapshot := self._snapshot) is not None:
                yield snapshot

    @property
    def problems(self) -> tuple[str, ...]:
        """Parts of the recording that cannot be shown, a sentence each."""
        return tuple(problem for file in self._files for problem in tuple(file.problems.values()))

    def displayed(self, view: LoopView) -> LoopView:
        """Add the recorded state of the arm, and the parts that cannot be shown, to a view of the loop."""
        if problems := self.problems:
            view = view._replace(alerts=(*view.alerts, *problems))
        turn = self._turns.at_playhead()
        if turn is None:
            return view
        arm, words = arm_view(turn, Health()), f"as recorded: {turn.state}: {turn.reason}"
        height_m = None if arm.hand_m is None else arm.hand_m[2]
        return view._replace(arm=words, seen_arm=arm, arm_height_m=height_m)

    def finish(self, summary: dict[str, Any]) -> None:
        """Add what was played, with the number of frames and chunks of samples by finger, camera and ``emg``."""
        playhead = self._playhead
        summary["played"] = self.facts | {
            "from_s": playhead.from_ns / 1e9,
            "jumps": playhead.n_jumps,
            "shown": {one.name: one.n_published for one in self._followers},
            "not_shown": list(self.problems),
        }
        if playhead.speed is not None:
            # The loop counts in the session's time; who waits for a tick waits in real time.
            summary["pacing"] |= {"overruns": playhead.n_late, "worst_late_ms": playhead.worst_late_ns / 1e6}

    def _levels(self, n_channels: int) -> PlayedItems[Intent]:
        """Return the hand's intents: the muscles' level, or the one imposed instead."""
        intent = Intent(t_ns=0, channels=(0,) * n_channels, level=FIRST_LEVEL)
        imposed, found = None, list[Intent]()
        began = next((one for one in self._commands[:1] if one.level), intent)
        first = replace(intent, level=began.level, closure=began.closure)
        changes: list[Intent | Imposed] = [*self._intents, *self._imposed]
        for change in sorted(changes, key=lambda one: one.log_ns):
            if isinstance(change, Imposed):
                imposed = change if change.level else None
            elif (now := self._measured.intent(change)) is not None:
                intent = now
            else:
                continue
            at = replace(intent, t_ns=change.t_ns, taken_ns=change.log_ns)
            found.append(at if imposed is None else replace(at, level=imposed.level, closure=imposed.closure))
        return PlayedItems(found, self._playhead, first)


def _topics(feed: RecordFeed, bus: Bus, players: Sequence[Player]) -> dict[str, Follower]:
    head, topics = feed.head, dict[str, Follower]()
    if bus.wants(MeasuredPicture):
        for finger in head.baselines:
            follower = PlayedFinger(finger, head, bus)
            topics |= {f"/tactile/{finger}/image": follower, f"/tactile/{finger}/frame": follower}
    if bus.wants(EmgSamples) and (maxima := head.calibration.emg) is not None:
        topics[EmgSamples.topic] = PlayedSamples(maxima, bus)
    for player in players:
        topics |= player.topics(feed.reader.path, bus)
    return topics


def played_checks(looks: list[HandLook], playhead: Playhead) -> Callable[[int, float], HandLook | None]:
    """Return the function that gives the recorded looks at hand and arm, each at the tick at which it came then."""
    track = Track(looks, playhead)

    def check(t_ns: int, _level: float) -> HandLook | None:
        if (found := next(track.due(), None)) is None:
            return None
        return replace(found, t_ns=t_ns, seen_ns=found.seen_ns + playhead.shift_ns)

    return check
