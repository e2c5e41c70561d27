"""A recording as the input of a run: every item comes at the tick at which it came then."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from tega.devices.base import DeviceInfo
from tega.hand import split_level
from tega.replay.measured import contact_items, level_items
from tega.stages.attached import with_attached
from tega.stages.choose import muscle_decoder
from tega.teleop.loop import FIRST_LEVEL
from tega.teleop.prepare import Finger, Muscles, Prepared
from tega.teleop.sources import Block, SourceReport
from tega.teleop.streams import NEVER_NS

if TYPE_CHECKING:
    from tega.replay.measured import Measured
    from tega.replay.play_clock import PlayClock
    from tega.replay.recorded import Recorded

__all__ = ["Switched", "played_input"]

Item = TypeVar("Item", bound=tuple[Any, ...])


def played_input(recorded: Recorded, measured: Measured, *, lead_ns: int, note: str) -> Prepared:
    """Make of a recording what a run starts with.

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
            stream=_Due(items, end_ns=end_ns),
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
            stream=_Due(blocks, end_ns=end_ns),
        )
    name = head.facts["calibration"]
    return Prepared(fingers, muscles, measured.calibration, "" if name == "self-calibrated" else name)


def _asked(
    recorded: Recorded, items: Sequence[tuple[int, Block]], n_channels: int, lead_ns: int
) -> list[tuple[int, Block]]:
    """Return what the hand was asked for: the muscles' level, or the one that was set against them."""
    nothing = (0,) * n_channels
    first = next((level for _, level, _ in recorded.hand), 0) or FIRST_LEVEL
    asked: list[tuple[int, Block]] = [(0, _imposed(Block(0, nothing, FIRST_LEVEL), first))]
    imposed: float = 0
    block = Block(0, nothing, FIRST_LEVEL)
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


def _imposed(block: Block, level: float) -> Block:
    """Return a block that asks for a level set against the muscles."""
    whole, closure = split_level(level)
    return block._replace(level=whole, closure=closure)


class _Played:
    """Stands for a source whose items are there already."""

    def __init__(self, info: DeviceInfo) -> None:
        self.info = info


class _Due(Generic[Item]):
    """A stream whose items are known later than at the time they are stamped with.

    Args:
        items: When each is known, and it; in that order.
        end_ns: When the stream ends.
    """

    def __init__(self, items: Sequence[tuple[int, Item]], *, end_ns: int) -> None:
        self._items = items
        self._next = 0
        self.end_ns = end_ns
        self.ended = False
        self.due_ns = 0
        self._look()

    def _look(self) -> None:
        self.ended = self._next >= len(self._items)
        self.due_ns = NEVER_NS if self.ended else self._items[self._next][0]

    def next_until(self, t_ns: int) -> Item | None:
        if self.due_ns > t_ns:
            return None
        item = self._items[self._next][1]
        self._next += 1
        self._look()
        return item

    def close(self) -> None:
        self._next = len(self._items)
        self._look()


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
