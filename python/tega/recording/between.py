"""What is put between the parts of a session, so that what passes is seen: each does what it stands before."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from tega.devices.base import InputEvent
    from tega.haptics import VestFrame
    from tega.recording.tap import SessionTap
    from tega.tactile import ContactMetrics
    from tega.teleop.hand import Hand
    from tega.teleop.inputs import Inputs
    from tega.teleop.loop import Recorder
    from tega.teleop.touch import Felt
    from tega.wire import CanFrame

__all__ = ["HandTap", "InputsTap", "LoopTap", "SentTap", "Written"]

Item = TypeVar("Item")


class LoopTap:
    """What the loop tells its recorder, told twice."""

    def __init__(self, tap: SessionTap, other: Recorder | None) -> None:
        self._tap = tap
        self._other = other

    def contact(self, t_ns: int, finger: str, metrics: ContactMetrics, felt: Felt) -> None:
        """Pass a contact on, and tell it."""
        if self._other is not None:
            self._other.contact(t_ns, finger, metrics, felt)
        self._tap.contact(t_ns, finger, metrics, felt)

    def levels(self, t_ns: int, channels: Sequence[int], fused: int) -> None:
        """Pass a block of levels on, and tell it."""
        if self._other is not None:
            self._other.levels(t_ns, channels, fused)
        self._tap.levels(t_ns, channels, fused)


class HandTap:
    """A hand whose last level is known; otherwise the hand itself."""

    def __init__(self, hand: Hand, see: Callable[[int], None]) -> None:
        self._hand = hand
        self._see = see
        self.level = 0

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """Joint angles, radians."""
        return self._hand.angles_rad

    def step(self, level: int) -> Sequence[CanFrame]:
        """Ask the hand for a level, and tell it."""
        self.level = level
        self._see(level)
        return self._hand.step(level)

    def limp(self) -> Sequence[CanFrame]:
        """Let the hand go."""
        self.level = 0
        return self._hand.limp()


class InputsTap:
    """The operator's inputs, looked at by somebody else too."""

    def __init__(self, inputs: Inputs, tap: SessionTap) -> None:
        self._inputs = inputs
        self._tap = tap
        self._said: dict[str, tuple[Any, ...]] = {}

    def __getattr__(self, name: str) -> Any:
        """Return whatever else the inputs have."""
        return getattr(self._inputs, name)

    def look(self) -> dict[str, list[InputEvent]]:
        """Look at the devices, and tell what has changed."""
        events = self._inputs.look()
        for seat, seen in self._inputs.seen.items():
            said = seen.state[1:]  # without the time at which the device was last heard
            if self._said.get(seat) != said:
                self._said[seat] = said
                self._tap.input_state(seat, seen.state)
        for seat, pressed in events.items():
            for event in pressed:
                self._tap.input_event(seat, event)
        return events


class SentTap:
    """A vest whose answers are seen; otherwise the vest itself."""

    def __init__(self, vest: Any, tap: SessionTap) -> None:
        self._vest = vest
        self._tap = tap

    def __getattr__(self, name: str) -> Any:
        """Return whatever else the vest has."""
        return getattr(self._vest, name)

    def write(self, t_ns: int, frame: VestFrame) -> VestFrame:
        """Send a frame, and tell what was sent of it."""
        sent: VestFrame = self._vest.write(t_ns, frame)
        self._tap.sent(t_ns, sent)
        return sent


class Written(Generic[Item]):
    """A sink that only tells."""

    def __init__(self, tell: Callable[[int, Item], None]) -> None:
        self._tell = tell

    def write(self, t_ns: int, sent: Item, /) -> object:
        """Tell what was sent."""
        self._tell(t_ns, sent)
        return sent
