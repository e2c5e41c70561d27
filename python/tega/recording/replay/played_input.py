"""Make a recording the input of a run: every item comes at the tick at which it came then."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import msgspec

from tega.config.attached import with_attached
from tega.config.choose import muscle_decoder
from tega.devices.base import DeviceInfo
from tega.hand import joined_level, split_level
from tega.loop.inbox.prepared import Finger, Muscles, Prepared
from tega.loop.inbox.sources import SourceReport
from tega.loop.loop import FIRST_LEVEL
from tega.recording.replay.playhead import PlayedItems
from tega.records import Contact, HandCommand, Haptics, Intent
from tega.runtime.files.foreign_file import tells_damage

if TYPE_CHECKING:
    from tega.recording.replay.measured import Measured
    from tega.recording.replay.play_clock import PlayClock
    from tega.recording.replay.playhead import Playhead
    from tega.recording.replay.recorded import Recorded
    from tega.records import HandLook


@tells_damage
def played_input(
    recorded: Recorded, measured: Measured, *, playhead: Playhead, lead_ns: int, note: str
) -> Prepared:
    """Make the prepared sources of a run from a recording.

    Args:
        recorded: The recording.
        measured: The contacts and intents measured again.
        playhead: Position of the playback.
        lead_ns: Time before the recording begins.
        note: Note for readers of the results.
    """
    head = recorded.head
    playhead.begin(recorded.last_tick_ns if recorded.end is None else recorded.end.end_ns, lead_ns)

    def source(name: str, rate_hz: float | None) -> Any:
        then = head.sources[name]
        label = f"{then.driver} {then.label}"
        return _Played(
            DeviceInfo(
                driver="recorded",
                kind=then.kind,
                label=label,
                live=False,
                rate_hz=rate_hz,
                channels=then.channels,
                unit=then.unit,
                notes=(note,),
            )
        )

    fingers = {}
    for finger in recorded.contacts:
        items = _contact_items(recorded, measured, finger)
        fingers[finger] = Finger(
            source(finger, head.sources[finger].rate_hz),
            head.baselines[finger],
            "recording",
            SourceReport(n_items=len(items)),
            stream=PlayedItems(
                [item for _, item in items],
                [known for known, _ in items],
                playhead=playhead,
            ).stream,
        )
    muscles, emg = None, measured.calibration.emg
    if "emg" in head.sources and emg is not None:
        first, asked = _asked(recorded, _level_items(recorded, measured), len(emg.channels))
        with with_attached(measured.config.stages, head.files) as stages:
            decoder = muscle_decoder(stages, measured.config.session.preset, emg)
        muscles = Muscles(
            source("emg", emg.rate_hz),
            emg,
            decoder,
            SourceReport(),
            stream=PlayedItems(
                [intent for _, intent in asked],
                [known for known, _ in asked],
                playhead=playhead,
                first=first,
            ).stream,
        )
    name = head.facts["calibration"]
    return Prepared(
        fingers,
        muscles,
        measured.calibration,
        "" if name == "self-calibrated" else name,
        look=PlayedLooks(list(looks.values()), playhead) if (looks := recorded.looks) else None,
    )


def _contact_items(recorded: Recorded, measured: Measured, finger: str) -> list[tuple[int, Contact]]:
    """Pair every frame that the loop received with its contact, measured now or in the run."""
    if not measured.again:
        return [(c.taken_ns, c) for c in recorded.contacts[finger]]
    again = {c.t_ns: c for c in measured.contacts[finger].rows}
    n_early = recorded.n_early.get(finger, 0)  # of which there are no pictures
    again |= {c.t_ns: c for c in recorded.contacts[finger][:n_early]}
    return [(c.taken_ns, again[c.t_ns]) for c in recorded.contacts[finger] if c.t_ns in again]


def _level_items(recorded: Recorded, measured: Measured) -> list[tuple[int, Intent]]:
    """Pair every intent that the loop received with that of the samples now, where it was decoded here."""
    if not measured.decodes:
        return [(row.taken_ns, row) for row in recorded.of(Intent)]
    again = {intent.t_ns: intent for intent in measured.intents.rows}
    return [(row.taken_ns, again[row.t_ns]) for row in recorded.of(Intent) if row.t_ns in again]


def _asked(
    recorded: Recorded, items: Sequence[tuple[int, Intent]], n_channels: int
) -> tuple[Intent, list[tuple[int, Intent]]]:
    """Return the hand's first intent and the later ones: the muscles' level, or the one imposed instead."""
    intent = nothing = Intent(t_ns=0, channels=(0,) * n_channels, level=FIRST_LEVEL)
    first = next((joined_level(c.level, c.closure) for c in recorded.of(HandCommand)), 0) or FIRST_LEVEL
    asked: list[tuple[int, Intent]] = []
    imposed: float = 0
    changes: list[tuple[int, int, Any]] = [(taken, 0, one) for taken, one in items]
    changes += [(t_ns, 1, level) for t_ns, level in recorded.imposed]
    for tick_ns, is_imposed, what in sorted(changes, key=lambda change: change[:2]):
        if is_imposed:
            imposed = what
        else:
            intent = what
        at = msgspec.structs.replace(intent, t_ns=tick_ns) if is_imposed else intent
        asked.append((tick_ns, _imposed(at, imposed) if imposed else at))
    return _imposed(nothing, first), asked


def _imposed(intent: Intent, level: float) -> Intent:
    """Return an intent that asks for a level set against the muscles."""
    whole, closure = split_level(level)
    return msgspec.structs.replace(intent, level=whole, closure=closure)


class _Played:
    """Stands in for a source with items that exist already."""

    def __init__(self, info: DeviceInfo) -> None:
        self.info = info


class PlayedLooks:
    """Gives the recorded looks at hand and arm, each at the tick at which it came then.

    Args:
        looks: In the order of their times.
        playhead: Position of the playback.
    """

    def __init__(self, looks: Sequence[HandLook], playhead: Playhead) -> None:
        self._looks, self._playhead = looks, playhead
        self._n_jumps = playhead.n_jumps
        self._next = bisect_left(looks, playhead.from_ns, key=lambda look: look.t_ns)

    def __call__(self, t_ns: int, _level: float) -> HandLook | None:
        """Return the look that is due at a tick of the run; ``None`` where none is."""
        shift_ns = self._playhead.shift_ns
        if self._n_jumps != self._playhead.n_jumps:
            self._n_jumps = self._playhead.n_jumps
            self._next = bisect_right(self._looks, t_ns - shift_ns, key=lambda look: look.t_ns)
        if self._next >= len(self._looks) or self._looks[self._next].t_ns + shift_ns > t_ns:
            return None
        look = self._looks[self._next]
        self._next += 1
        return msgspec.structs.replace(look, t_ns=t_ns, seen_ns=look.seen_ns + shift_ns)


class Switched:
    """Allows the motors to vibrate if the recording did and the other check does."""

    def __init__(
        self, recorded: Recorded, clock: PlayClock, playhead: Playhead, other: Callable[[], bool]
    ) -> None:
        self._changes = [(one.t_ns, one.on) for one in recorded.of(Haptics)]
        self._clock, self._playhead = clock, playhead
        self._other = other

    def __call__(self) -> bool:
        """Return the permission at the clock's tick."""
        at_ns = self._clock.tick_ns - self._playhead.shift_ns
        place = bisect_right(self._changes, at_ns, key=lambda change: change[0])
        return (place == 0 or self._changes[place - 1][1]) and self._other()
