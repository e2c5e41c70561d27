"""Keep the requests made on the page until the program polls them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from tega.errors import InvalidValueError

if TYPE_CHECKING:
    from tega.loop.controls import MotorAnswer
    from tega.recording.replay.playhead import Playhead


class Controls:
    """Requests of the page's user; what is ``None``, false or empty is not offered.

    Every request is one attribute, which the page's thread writes and the program reads. A real hand has no
    pause. With ``can_go`` the run waits, armed, for the Go button. ``try_motor`` has a motor of the vest
    vibrate, by its place in the frame. ``undo`` undoes the online adaptation of EMG, or starts it again.
    ``rezero`` has every finger take a new baseline; there is none where no live finger is measured.
    ``playhead`` is that of the recording that is played; ``reflex`` is the reflex's authority at the start.
    ``annotate`` codes an event by a key at the moment played, and returns the effect in words.
    """

    def __init__(
        self,
        *,
        can_pause: bool = False,
        can_mute: bool = False,
        objects: Sequence[str] = (),
        try_motor: Callable[[int], MotorAnswer] | None = None,
        can_go: bool = False,
        playhead: Playhead | None = None,
        reflex: float | None = None,
        annotate: Callable[[str], str] | None = None,
    ) -> None:
        self.can_pause = can_pause
        self.can_mute = can_mute
        self.objects = tuple(objects)
        self.try_motor, self.can_go = try_motor, can_go
        self.undo: Callable[[], None] | None = None
        self.rezero: Callable[[], None] | None = None
        self.playhead, self.annotate = playhead, annotate
        self.stopped = self._gone = self._paused = False
        self._haptics = True
        self._reflex = reflex
        self._object: deque[str] = deque(maxlen=1)

    def stop(self) -> None:
        """Ask for the end of the run."""
        self.stopped = True

    @property
    def paused(self) -> bool:
        """Whether the run should stand still; never with the wish to stop."""
        return self._paused and not self.stopped

    @paused.setter
    def paused(self, wanted: bool) -> None:
        self._paused = wanted and self.can_pause

    @property
    def haptics(self) -> bool:
        """Whether the vest should be driven."""
        return self._haptics

    @haptics.setter
    def haptics(self, wanted: bool) -> None:
        self._haptics = wanted or not self.can_mute

    @property
    def reflex(self) -> float | None:
        """Authority that the reflex should have, 0 to 1; ``None`` where there is none."""
        return self._reflex

    @reflex.setter
    def reflex(self, wanted: object) -> None:
        # What comes from a browser may be anything.
        if isinstance(wanted, int | float) and not isinstance(wanted, bool) and math.isfinite(wanted):
            self._reflex = None if self._reflex is None else min(max(float(wanted), 0.0), 1.0)

    def go(self) -> None:
        """Let an armed run become active."""
        self._gone = True

    @property
    def may_go(self) -> bool:
        """Whether an armed run may become active."""
        return self._gone or not self.can_go

    def choose(self, name: str) -> None:
        """Ask for an object, one of those offered."""
        if name not in self.objects:
            raise InvalidValueError(f"object {name!r} is not one of {', '.join(self.objects) or 'none'}")
        self._object.append(name)

    def take_object(self) -> str | None:
        """Return the object asked for since the last call, ``None`` without a new wish."""
        return self._object.pop() if self._object else None
