"""Make a recording the input of a run: every item comes at the tick at which it came then."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from tega.devices.base import DeviceInfo
from tega.foreign_file import tells_damage
from tega.hand import split_level
from tega.inbox.prepared import Finger, Muscles, Prepared
from tega.inbox.sources import EmgBlock, SourceReport
from tega.inbox.stream import Item, PulledStream
from tega.replay.measured import contact_items, level_items
from tega.stages.attached import with_attached
from tega.stages.choose import muscle_decoder
from tega.teleop.loop import FIRST_LEVEL

if TYPE_CHECKING:
    from tega.replay.measured import Measured
    from tega.replay.play_clock import PlayClock
    from tega.replay.recorded import Recorded


@tells_damage
def played_input(recorded: Recorded, measured: Measured, *, lead_ns: int, note: str) -> Prepared:
    """Make the prepared sources of a run from a recording.

    Args:
        recorded: The recording.
        measured: What was measured in it again.
        lead_ns: What comes before it.
        note: What a reader of the results must know.
    """
    head = recorded.head
    end_ns = lead_ns + (recorded.last_tick_ns if recorded.end is None else recorded.end[0])

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
        items = [
            (taken + lead_ns, (t_ns + lead_ns, metrics))
            for taken, (t_ns, metrics) in contact_items(recorded, measured, finger)
        ]
        fingers[finger] = Finger(
            source(finger, head.sources[finger].rate_hz),
            head.baselines[finger],
            "recording",
            SourceReport(n_items=len(items)),
            stream=_as_known(items, end_ns),
        )
    muscles, emg = None, measured.calibration.emg
    if "emg" in head.sources and emg is not None:
        blocks = _asked(recorded, level_items(recorded, measured), len(emg.channels), lead_ns)
        with with_attached(measured.config.stages, head.files) as stages:
            decoder = muscle_decoder(stages, measured.config.session.preset, emg)
        muscles = Muscles(
            source("emg", emg.rate_hz),
            emg,
            decoder,
            SourceReport(),
            stream=_as_known(blocks, end_ns),
        )
    name = head.facts["calibration"]
    return Prepared(fingers, muscles, measured.calibration, "" if name == "self-calibrated" else name)


def _asked(
    recorded: Recorded, items: Sequence[tuple[int, EmgBlock]], n_channels: int, lead_ns: int
) -> list[tuple[int, EmgBlock]]:
    """Return what the hand was asked for: the muscles' level, or the one that was set against them."""
    nothing = (0,) * n_channels
    first = next((level for _, level, _ in recorded.hand), 0) or FIRST_LEVEL
    asked: list[tuple[int, EmgBlock]] = [(0, _imposed(EmgBlock(0, nothing, FIRST_LEVEL), first))]
    imposed: float = 0
    block = EmgBlock(0, nothing, FIRST_LEVEL)
    changes: list[tuple[int, int, Any]] = [(taken, 0, block) for taken, block in items]
    changes += [(t_ns, 1, level) for t_ns, level in recorded.imposed]
    for tick_ns, is_imposed, what in sorted(changes, key=lambda change: change[:2]):
        if is_imposed:
            imposed = what
        else:
            block = what
        at_ns = lead_ns + (tick_ns if is_imposed else block[0])
        at = block._replace(t_ns=at_ns)
        asked.append((lead_ns + tick_ns, _imposed(at, imposed) if imposed else at))
    return asked


def _imposed(block: EmgBlock, level: float) -> EmgBlock:
    """Return a block that asks for a level set against the muscles."""
    whole, closure = split_level(level)
    return block._replace(level=whole, closure=closure)


def _as_known(items: Sequence[tuple[int, Item]], end_ns: int) -> PulledStream[Item]:
    """Return a stream whose items come when they were known then."""
    return PulledStream([item for _, item in items], known=[known for known, _ in items], end_ns=end_ns)


class _Played:
    """Stands for a source whose items are there already."""

    def __init__(self, info: DeviceInfo) -> None:
        self.info = info


class Switched:
    """Says whether the motors may turn: when they did, and somebody else allows it."""

    def __init__(self, recorded: Recorded, clock: PlayClock, lead_ns: int, other: Callable[[], bool]) -> None:
        self._changes = [(lead_ns + t_ns, on) for _, on, t_ns in recorded.haptics]
        self._clock = clock
        self._other = other
        self._on = True

    def __call__(self) -> bool:
        """Tell it for the tick that the clock is at."""
        while self._changes and self._changes[0][0] <= self._clock.tick_ns:
            self._on = self._changes.pop(0)[1]
        return self._on and self._other()
